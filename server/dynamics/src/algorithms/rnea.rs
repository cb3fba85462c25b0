//! Recursive Newton-Euler: forces from motion [LWP80; F08, 5.3, in classical accelerations].
//!
//! Every joint moves along or about z of its body, so that its motion affects single components.
//! Vectors are in body axes at the body's origin; accelerations are classical, and the world
//! accelerates against gravity.

use nalgebra::Vector3;

use crate::algorithms::terms::{joint_forces, spring_forces};
use crate::mechanism::{Body, Motion, joint_pose};
use crate::model::{Model, Runs, Scope};
use crate::scalar::{Real, Triple};
use crate::spatial::{Columns, Matrix};
use crate::workspace::BodyState;

/// Poses of the given bodies in their parents, from the coordinates and their cosines and sines.
#[inline(always)]
pub(crate) fn joint_poses<T: Real>(
    model: &Model<T>,
    bodies: &Runs,
    q: &[T],
    cos_sin: &[(T, T)],
    motion: &mut [BodyState<T>],
) {
    for run in bodies.runs() {
        let joints = model.bodies[run.clone()].iter().zip(&cos_sin[run.clone()]);
        for ((body, cos_sin), state) in joints.zip(&mut motion[run]) {
            // written in place: a pose of a packet is large
            let at_zero = || T::Triple::columns_of(&body.R_parent_body);
            state.p = T::Triple::of(&body.p_parent_body);
            match body.motion {
                Motion::Revolute => state.R = at_zero().turn_z(cos_sin.0, cos_sin.1),
                Motion::Prismatic => {
                    state.R = at_zero();
                    state.p = state.p.add_scaled(state.R[2], q[body.q]);
                }
                Motion::Spherical | Motion::Floating => {
                    let pose = joint_pose(body, &body.p_parent_body, &q[body.q..], *cos_sin);
                    (state.R, state.p) = (T::Triple::columns_of(&pose.R), T::Triple::of(&pose.p));
                }
            }
        }
    }
}

/// A motion of the tree, in the order of the bodies.
pub(crate) struct TreeMotion<'a, T> {
    /// Coordinates (n_q), velocities and accelerations (n_v).
    pub(crate) q: &'a [T],
    pub(crate) qd: &'a [T],
    pub(crate) qdd: &'a [T],
}

/// τ = M q̈ + C − Σ Jᵀ w at the joints of the scope's affected bodies. Needs [`joint_poses`];
/// `wrench` holds the external wrench on each body, if there are any.
#[inline]
pub(crate) fn newton_euler<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    &TreeMotion { q, qd, qdd }: &TreeMotion<'_, T>,
    wrench: Option<&[(Vector3<T>, Vector3<T>)]>,
    motion: &mut [BodyState<T>],
    tau: &mut [T],
) {
    // the world accelerates against gravity: ω_0 = 0, α_0 = 0, a_0 = −g
    motion[0].w = T::Triple::zero();
    motion[0].alpha = T::Triple::zero();
    motion[0].a = -T::Triple::of(&model.gravity);

    // (ω_i, α_i, a_i) from those of the parent p(i), from the root outwards; n_i = 0, f_i = 0
    for i in scope.ancestors.indices() {
        let body = &model.bodies[i];
        let (before, state) = motion.split_at_mut(i);
        let state = &mut state[0];
        (state.w, state.alpha, state.a) = accelerate(body, state, &before[body.parent], qd, qdd);
        (state.n, state.f) = (T::Triple::zero(), T::Triple::zero());
    }
    // and n_i = I α + ω × I ω + h × a − n_ext, f_i = m a + α × h + ω × (ω × h) − f_ext
    for run in scope.affected.runs() {
        let bodies = &model.bodies[..run.end];
        let motion = &mut motion[..run.end];
        for i in run {
            let body = &bodies[i];
            let (before, state) = motion.split_at_mut(i);
            let state = &mut state[0];
            (state.w, state.alpha, state.a) =
                accelerate(body, state, &before[body.parent], qd, qdd);
            (state.n, state.f) = inertial_force::<T>(body, &state.w, &state.alpha, &state.a);
            if let Some(wrench) = wrench {
                state.n -= T::Triple::of(&wrench[i].0);
                state.f -= T::Triple::of(&wrench[i].1);
            }
        }
    }

    forces_to_root(model, scope, motion, tau);
    // springs, dampers and rotors of the joints
    joint_forces(model, scope, q, qd, qdd, tau);
}

/// Static forces: gravity, springs and wrenches, with the bits of [`newton_euler`] at q̇ = q̈ = 0.
#[inline]
pub(crate) fn rest_forces<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    q: &[T],
    wrench: Option<&[(Vector3<T>, Vector3<T>)]>,
    motion: &mut [BodyState<T>],
    tau: &mut [T],
) {
    // a_0 = −g, a_i = R_iᵀ a_p, n_i = h × a − n_ext, f_i = m a − f_ext
    motion[0].a = -T::Triple::of(&model.gravity);
    for i in scope.ancestors.indices() {
        let (before, state) = motion.split_at_mut(i);
        state[0].a = rows(&state[0]).apply(before[model.bodies[i].parent].a);
        (state[0].n, state[0].f) = (T::Triple::zero(), T::Triple::zero());
    }
    for run in scope.affected.runs() {
        let bodies = &model.bodies[..run.end];
        let motion = &mut motion[..run.end];
        for i in run {
            let body = &bodies[i];
            let (before, state) = motion.split_at_mut(i);
            let state = &mut state[0];
            state.a = rows(state).apply(before[body.parent].a);
            state.n = T::Triple::of(&body.h).cross(state.a);
            state.f = state.a.times(T::Triple::splat(body.mass));
            if let Some(wrench) = wrench {
                state.n -= T::Triple::of(&wrench[i].0);
                state.f -= T::Triple::of(&wrench[i].1);
            }
        }
    }
    forces_to_root(model, scope, motion, tau);
    spring_forces(model, scope, q, tau);
}

/// The forces that the joints transmit, from those on the bodies, from the leaves to the root.
#[inline(always)]
fn forces_to_root<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    motion: &mut [BodyState<T>],
    tau: &mut [T],
) {
    for run in scope.affected.runs().rev() {
        let mut motion = &mut motion[..run.end];
        for body in model.bodies[run].iter().rev() {
            let Some((state, before)) = motion.split_last_mut() else { return };
            match body.motion {
                // τ_i = S_iᵀ (n_i, f_i); + 0 removes the sign of a zero
                Motion::Revolute => tau[body.v] = state.n[2] + T::ZERO,
                Motion::Prismatic => tau[body.v] = state.f[2] + T::ZERO,
                Motion::Spherical => (0..3).for_each(|k| tau[body.v + k] = state.n[k] + T::ZERO),
                Motion::Floating => {
                    for k in 0..3 {
                        tau[body.v + k] = state.n[k] + T::ZERO;
                        tau[body.v + 3 + k] = state.f[k] + T::ZERO;
                    }
                }
            }
            // f_p ← f_p + R f_i,  n_p ← n_p + R n_i + p × R f_i
            if body.parent != 0 {
                let f = state.R.apply(state.f);
                let parent = &mut before[body.parent];
                let n = state.R.apply_add(state.n, parent.n);
                parent.n = n.add_cross(state.p, f);
                parent.f += f;
            }
            motion = before;
        }
    }
}

/// R_iᵀ, which takes vectors of the parent into the axes of the body.
#[inline(always)]
fn rows<T: Real>(state: &BodyState<T>) -> Columns<T> {
    T::Triple::transposed(&state.R)
}

/// ω, α, a of a body from its pose, those of its parent p and the rates of its joint.
#[inline(always)]
pub(super) fn accelerate<T: Real>(
    body: &Body<T>,
    state: &BodyState<T>,
    p: &BodyState<T>,
    qd: &[T],
    qdd: &[T],
) -> (T::Triple, T::Triple, T::Triple) {
    // ω_i' = R ω_p,  α_i' = R α_p,  a_i' = R (a_p + α_p × r + ω_p × (ω_p × r)),  R = R_iᵀ, r = p_i
    let to_body = rows(state);
    let mut w = to_body.apply(p.w);
    let alpha = to_body.apply(p.alpha);
    let a = p.a.add_cross(p.alpha, state.p).add_cross(p.w, p.w.cross(state.p));
    let a = to_body.apply(a);
    let of = |x: &[T]| T::Triple::new(x[0], x[1], x[2]);
    match body.motion {
        // α_i = α_i' + ω_i' × z q̇ + z q̈,  ω_i = ω_i' + z q̇
        Motion::Revolute => {
            let v = qd[body.v];
            let vd = qdd[body.v];
            let alpha = along_z::<T>(&w, v, vd, &alpha);
            w[2] += v;
            (w, alpha, a)
        }
        // a_i = a_i' + 2 ω_i' × z q̇ + z q̈
        Motion::Prismatic => {
            let v = qd[body.v];
            let vd = qdd[body.v];
            (w, alpha, along_z::<T>(&w, v + v, vd, &a))
        }
        // α_i = α_i' + ω_i' × ω_j + ω̇_j,  ω_i = ω_i' + ω_j
        Motion::Spherical => {
            let w_j = of(&qd[body.v..body.v + 3]);
            let vd = of(&qdd[body.v..body.v + 3]);
            let alpha = (alpha + vd).add_cross(w, w_j);
            (w + w_j, alpha, a)
        }
        // and a_i = a_i' + (ω_i' + ω_i) × v_j + v̇_j
        Motion::Floating => {
            let vd = &qdd[body.v..body.v + 6];
            let w_j = of(&qd[body.v..body.v + 3]);
            let v_j = of(&qd[body.v + 3..body.v + 6]);
            let alpha = (alpha + of(vd)).add_cross(w, w_j);
            let w_i = w + w_j;
            let a = (a + of(&vd[3..])).add_cross(w + w_i, v_j);
            (w_i, alpha, a)
        }
    }
}

/// c + ω × z v + z v̇.
#[inline(always)]
fn along_z<T: Real>(w: &T::Triple, v: T, vd: T, c: &T::Triple) -> T::Triple {
    T::Triple::new(w[1], w[0], T::ONE).mul_add(T::Triple::new(v, -v, vd), *c)
}

/// n = I α + ω × I ω + h × a and f = m a + α × h + ω × (ω × h).
#[inline(always)]
fn inertial_force<T: Real>(
    body: &Body<T>,
    w: &T::Triple,
    alpha: &T::Triple,
    a: &T::Triple,
) -> (T::Triple, T::Triple) {
    let h = T::Triple::of(&body.h);
    let [xx, xy, xz, yy, yz, zz] = body.inertia;
    let inertia = T::Triple::columns_from([xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let n = inertia.apply(*alpha).add_cross(h, *a).add_cross(*w, inertia.apply(*w));
    let weight = a.times(T::Triple::splat(body.mass));
    let f = weight.add_cross(*alpha, h).add_cross(*w, (*w).cross(h));
    (n, f)
}
