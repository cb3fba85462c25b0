//! A platform on a chain of independent joints, held by legs that each turn about two crossing axes and slide (2SPU+1U).
//!
//! In the frame of a leg, X along its first axis and Y along its second at zero, the pin lies at v = R_x(q₁) R_y(q₂) w(ℓ) with
//! w = ℓ a + e: slider direction a, eccentricity e ⟂ a. Hence ℓ² = |v|² − |e|², then q₂ from v_x = (R_y w)_x, then q₁ in the plane
//! perpendicular to X.

use nalgebra::{Matrix3, Vector3};

use super::{Level, Local, Numerical, Rate, Verdict, least_square_sine};
use crate::model::{Body, Cluster, Freedom, Motion, joint_pose};
use crate::scalar::Real;
use crate::spatial::{Pose, cross, cross_add, dot, lift, lift_mat, scale_add, t_mul, zero};

/// A platform and its legs.
#[derive(Clone, Debug)]
pub(crate) struct Legs<C> {
    /// Freedoms of the joints that carry the platform, from the base, each with its place in y; all are independent.
    pub(crate) chain: Vec<(Freedom, usize)>,
    pub(crate) legs: Vec<Leg<C>>,
    /// Newton's method on the true rows, where the geometry is only nearly of this type.
    pub(crate) polish: Option<Numerical<C>>,
}

/// One leg: two turning joints whose axes cross, a slider, and a pin on the platform.
#[derive(Clone, Debug)]
pub(crate) struct Leg<C> {
    /// First and second turn, slider.
    pub(crate) joints: [Freedom; 3],
    /// The leg's frame {cluster's parent body}: X, Y along the axes at zero, origin where they cross.
    pub(crate) axes: Matrix3<C>,
    pub(crate) center: Vector3<C>,
    /// Pin {platform body}.
    pub(crate) pin: Vector3<C>,
    /// Slider direction and eccentricity at zero {leg}.
    pub(crate) a: Vector3<C>,
    pub(crate) e: Vector3<C>,
    /// |e|², |v|² at zero, signed slider length at zero.
    pub(crate) e_square: C,
    pub(crate) square0: C,
    pub(crate) length0: C,
    /// ±1, signs of the slider's length and of the second turn's root.
    pub(crate) side: C,
    pub(crate) root: C,
}

impl<C: nalgebra::Scalar + Copy> Legs<C> {
    /// The position, velocity and acceleration level in closed form.
    pub(crate) fn close<T: Real<Const = C>>(
        &self,
        cluster: &Cluster<C>,
        bodies: &[Body<C>],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Verdict<T::Mask> {
        // pose of the platform along the chain; its joints' axes and points are kept for the Jacobian
        let mut pose = Pose::identity();
        for (at, _) in self.chain.iter().filter(|(at, _)| at.k == 0) {
            if at.motion == Motion::Revolute {
                let (s, c) = local.q[at.q].sin_cos();
                local.turn[at.body] = (c, s);
            }
            pose = pose.then(&joint_pose(&bodies[at.body], &local.q[at.q..], local.turn[at.body]));
            local.scratch.pose[at.body + 1] = pose;
        }
        if level >= Level::Velocity {
            self.chain_rates(local);
            for (at, k) in &self.chain {
                local.G[at.v * cluster.n_vy..(at.v + 1) * cluster.n_vy].fill(T::ZERO);
                local.G[at.v * cluster.n_vy + k] = T::ONE;
                local.g[at.v] = T::ZERO;
            }
        }
        let mut verdict = Verdict::fine();
        for leg in &self.legs {
            let of_leg = leg.close(self, cluster.n_vy, &pose, local, level);
            verdict.unreachable = verdict.unreachable | of_leg.unreachable;
            verdict.singular = verdict.singular | of_leg.singular;
        }
        verdict
    }

    /// Rates of the chain's bodies at q̈ = 0.
    fn chain_rates<T: Real<Const = C>>(&self, local: &mut Local<'_, T>) {
        let (mut rate, mut origin) = (Rate::at_rest(), zero());
        for (at, _) in self.chain.iter().filter(|(at, _)| at.k == 0) {
            let pose = &local.scratch.pose[at.body + 1];
            rate = rate.moved(at.motion, &(pose.p - origin), &pose.R, &local.qd[at.v..]);
            local.scratch.rate[at.body + 1] = rate;
            origin = pose.p;
        }
    }

    /// The same geometry with every constant converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Legs<D> {
        let leg = |leg: &Leg<C>| Leg {
            joints: leg.joints,
            axes: leg.axes.map(f),
            center: leg.center.map(f),
            pin: leg.pin.map(f),
            a: leg.a.map(f),
            e: leg.e.map(f),
            e_square: f(leg.e_square),
            square0: f(leg.square0),
            length0: f(leg.length0),
            side: f(leg.side),
            root: f(leg.root),
        };
        Legs {
            chain: self.chain.clone(),
            legs: self.legs.iter().map(leg).collect(),
            polish: self.polish.as_ref().map(|numerical| numerical.map(f)),
        }
    }
}

impl<C: nalgebra::Scalar + Copy> Leg<C> {
    #[inline]
    fn close<T: Real<Const = C>>(
        &self,
        of: &Legs<C>,
        n_vy: usize,
        platform: &Pose<T>,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Verdict<T::Mask> {
        let [j1, j2, j3] = self.joints;
        let L: Matrix3<T> = lift_mat(&self.axes);
        let (a, e): (Vector3<T>, Vector3<T>) = (lift(&self.a), lift(&self.e));

        // pin from the leg's centre {leg}
        let pin = platform.point(&lift(&self.pin));
        let v = t_mul(&L, &(pin - lift(&self.center)));
        let (vy2, vz2) = (v[1] * v[1], v[2] * v[2]);
        let rho = vy2 + vz2;
        let square = v[0].mul_add(v[0], rho);

        // slider length, without cancellation in its change
        let reach = square - T::lift(self.e_square);
        let length = T::lift(self.side) * reach.sqrt();
        local.q[j3.q] = (square - T::lift(self.square0)) / (length + T::lift(self.length0));

        // second turn: w_x cos + w_z sin = v_x; the root has the sign that it has at zero
        let w = scale_add(&a, length, &e);
        let root_square = rho - w[1] * w[1];
        let root = T::lift(self.root) * root_square.sqrt();
        let n = w[0].mul_add(w[0], w[2] * w[2]);
        let inverse_n = T::ONE / n;
        let c2 = w[0].mul_add(v[0], w[2] * root) * inverse_n;
        let s2 = w[2].mul_add(v[0], -(w[0] * root)) * inverse_n;

        // first turn carries (w_y, root) onto (v_y, v_z)
        let inverse_rho = T::ONE / rho;
        let c1 = w[1].mul_add(v[1], root * v[2]) * inverse_rho;
        let s1 = w[1].mul_add(v[2], -(root * v[1])) * inverse_rho;
        local.turn[j1.body] = (c1, s1);
        local.turn[j2.body] = (c2, s2);
        local.q[j1.q] = s1.atan2(c1);
        local.q[j2.q] = s2.atan2(c2);
        let floor = T::from_f64(least_square_sine::<T>()) * T::lift(self.square0);
        let unreachable = reach.lt(T::ZERO) | root_square.lt(T::ZERO);
        let singular = reach.lt(floor) | rho.lt(floor) | root_square.lt(floor);
        let verdict = Verdict { unreachable, singular };
        if level == Level::Position {
            return verdict;
        }

        // columns of the leg's Jacobian {leg}: X × v, a2 × v, slider direction; its inverse by cross products
        let a2 = Vector3::new(T::ZERO, c1, s1);
        let J1 = Vector3::new(T::ZERO, -v[2], v[1]);
        let J2 = cross(&a2, &v);
        let ry = Vector3::new(c2.mul_add(a[0], s2 * a[2]), a[1], c2.mul_add(a[2], -(s2 * a[0])));
        let J3 = Vector3::new(ry[0], c1.mul_add(ry[1], -(s1 * ry[2])), s1.mul_add(ry[1], c1 * ry[2]));
        let (r1, r2, r3) = (cross(&J2, &J3), cross(&J3, &J1), cross(&J1, &J2));
        let inverse_det = T::ONE / dot(&J3, &r3);

        // velocity of the pin for each independent coordinate
        for (at, k) in &of.chain {
            let pose = &local.scratch.pose[at.body + 1];
            let z = at.axis(&pose.R);
            let x = t_mul(&L, &if at.slides() { z } else { cross(&z, &(pin - pose.p)) });
            local.G[j1.v * n_vy + k] = dot(&r1, &x) * inverse_det;
            local.G[j2.v * n_vy + k] = dot(&r2, &x) * inverse_det;
            local.G[j3.v * n_vy + k] = dot(&r3, &x) * inverse_det;
        }
        for j in self.joints {
            let mut qd = T::ZERO;
            for (at, k) in &of.chain {
                qd = local.G[j.v * n_vy + k].mul_add(local.qd[at.v], qd);
            }
            local.qd[j.v] = qd;
        }
        if level == Level::Velocity {
            return verdict;
        }

        // acceleration of the pin at ÿ = 0, less that of the leg at q̈ = 0 {leg}
        let arm = pin - platform.p;
        let rate = of.chain.last().map(|(at, _)| local.scratch.rate[at.body + 1]);
        let of_platform = rate.map_or(zero(), |x| cross_add(&x.w, &cross(&x.w, &arm), &cross_add(&x.alpha, &arm, &x.a)));
        let (w1, w2, slide) = (local.qd[j1.v], local.qd[j2.v], local.qd[j3.v]);
        let w_leg = Vector3::new(w1, w2 * a2[1], w2 * a2[2]);
        let alpha_leg = Vector3::new(T::ZERO, -(w1 * w_leg[2]), w1 * w_leg[1]);
        let inner = scale_add(&J3, slide + slide, &cross(&w_leg, &v));
        let of_leg = cross_add(&w_leg, &inner, &cross(&alpha_leg, &v));
        let x = t_mul(&L, &of_platform) - of_leg;
        local.g[j1.v] = dot(&r1, &x) * inverse_det;
        local.g[j2.v] = dot(&r2, &x) * inverse_det;
        local.g[j3.v] = dot(&r3, &x) * inverse_det;
        verdict
    }
}
