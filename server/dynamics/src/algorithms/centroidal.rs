//! Sums over the moving links: centre of mass, momentum, centroidal matrix, energy [OGL13: Orin,
//! Goswami, Lee, Centroidal dynamics of a humanoid robot, Autonomous Robots 35, 2013; here the
//! columns of the tree velocities come from composite inertias].

use nalgebra::Vector3;

use crate::mechanism::Body;
use crate::model::Model;
use crate::scalar::{Real, Symmetric, Triple};
use crate::spatial::{Matrix, Pose, zero};
use crate::workspace::{BodyState, Composite};

/// The moving links at one state.
pub(crate) struct Links<'a, T: Real> {
    model: &'a Model<T>,
    world: &'a [Pose<T>],
    motion: &'a [BodyState<T>],
    pub(crate) mass: T,
}

impl<'a, T: Real> Links<'a, T> {
    pub(crate) fn of(
        model: &'a Model<T>,
        world: &'a [Pose<T>],
        motion: &'a [BodyState<T>],
    ) -> Links<'a, T> {
        let mass = model.bodies[1..].iter().fold(T::ZERO, |sum, body| sum + body.mass);
        Links { model, world, motion, mass }
    }

    /// Bodies with their places in the root and their motions.
    fn each(&self) -> impl Iterator<Item = (&'a Body<T>, &'a Pose<T>, &'a BodyState<T>)> {
        let bodies = self.model.bodies.iter().zip(self.world).zip(self.motion).skip(1);
        bodies.map(|((body, world), motion)| (body, world, motion))
    }

    /// Σ (m p + R h) / m.
    pub(crate) fn com(&self) -> Vector3<T> {
        let moment = self.each().fold(zero(), |sum: Vector3<T>, (body, at, _)| {
            sum + at.p * body.mass + at.R.apply(body.h)
        });
        self.per_mass(moment)
    }

    /// Σ R (m a + α × h + ω × (ω × h)) / m, after [`super::rates`] at ÿ = 0.
    pub(crate) fn com_bias(&self) -> Vector3<T> {
        let force = self.each().fold(zero(), |sum: Vector3<T>, (body, at, state)| {
            let [w, alpha, a] = [state.w, state.alpha, state.a].map(|x| x.vector());
            let h = body.h;
            sum + at.R.apply((a * body.mass).add_cross(alpha, h).add_cross(w, w.cross(h)))
        });
        self.per_mass(force)
    }

    fn per_mass(&self, x: Vector3<T>) -> Vector3<T> {
        x.map(|x| x / self.mass)
    }

    /// (I ω + h × v, m v + ω × h) of a body, in its axes at its origin.
    fn momentum_of(body: &Body<T>, state: &BodyState<T>) -> (Vector3<T>, Vector3<T>) {
        let [w, v] = [state.w, state.v].map(|x| x.vector());
        let inertia = T::Symmetric::new(body.inertia);
        let turned = [0, 1, 2].map(|k| inertia.column(k)).apply(state.w).vector();
        (turned.add_cross(body.h, v), (v * body.mass).add_cross(w, body.h))
    }

    /// The momentum about the centre of mass, [angular; linear], after [`super::velocities`].
    pub(crate) fn momentum(&self) -> [T; 6] {
        let com = self.com();
        let none: (Vector3<T>, Vector3<T>) = (zero(), zero());
        let (k, l) = self.each().fold(none, |(k, l), (body, at, state)| {
            let (angular, linear) = Links::momentum_of(body, state);
            let linear = at.R.apply(linear);
            (k + at.R.apply(angular).add_cross(at.p - com, linear), l + linear)
        });
        [k[0], k[1], k[2], l[0], l[1], l[2]]
    }

    /// [½ Σ (ωᵀ k + vᵀ l) + ½ Σ N² I q̇², −gᵀ Σ m c + ½ Σ k (q − rest)²], after
    /// [`super::velocities`].
    pub(crate) fn energy(&self, q: &[T], qd: &[T]) -> [T; 2] {
        let terms = &self.model.terms;
        let mut twice = [T::ZERO; 2];
        for (body, at, state) in self.each() {
            let (angular, linear) = Links::momentum_of(body, state);
            let moment = at.p * body.mass + at.R.apply(body.h);
            twice[0] += state.w.vector().dot(angular) + state.v.vector().dot(linear);
            let weight = self.model.gravity.dot(moment);
            twice[1] -= weight + weight;
        }
        for rotor in &terms.rotors {
            twice[0] = (rotor.inertia * qd[rotor.v]).mul_add(qd[rotor.v], twice[0]);
        }
        for spring in &terms.springs {
            let stretch = q[spring.q] - spring.rest;
            twice[1] = (spring.stiffness * stretch).mul_add(stretch, twice[1]);
        }
        twice.map(|x| x * T::from_f64(0.5))
    }

    /// Columns of the momentum about the centre of mass over the tree velocities: calls
    /// `each(internal velocity, [angular; linear])`.
    pub(crate) fn columns(
        &self,
        composite: &mut [Composite<T>],
        mut each: impl FnMut(usize, &[T; 6]),
    ) {
        let bodies = &self.model.bodies;
        for (of_body, body) in composite.iter_mut().zip(bodies).skip(1) {
            *of_body = Composite::of(body);
        }
        for i in (1..bodies.len()).rev() {
            let parent = bodies[i].parent;
            if parent != 0 {
                let carried = composite[i].transformed(&self.motion[i]);
                composite[parent].add(&carried);
            }
        }
        let com = self.com();
        for (i, body) in bodies.iter().enumerate().skip(1) {
            let at = &self.world[i];
            for k in 0..body.motion.n_v() {
                let (n, f) = composite[i].column(body.motion, k);
                let l = at.R.apply(f.vector());
                let k_com = at.R.apply(n.vector()).add_cross(at.p - com, l);
                each(body.v + k, &[k_com[0], k_com[1], k_com[2], l[0], l[1], l[2]]);
            }
        }
    }
}
