//! Recursive Newton-Euler: forces from motion [LWP80; F08, 5.3, in classical accelerations].
//!
//! Every joint moves along or about z of its body, so that a joint's motion touches single
//! components. Vectors are in body axes at the body's origin; accelerations are classical, and the
//! world accelerates against gravity.

use nalgebra::Vector3;

use crate::algorithms::terms::{joint_forces, spring_forces};
use crate::mechanism::{Body, Motion, joint_pose};
use crate::model::{Model, Runs, Scope};
use crate::scalar::{Real, Triple};
use crate::spatial::triples::{
    Columns, columns, cross, cross_add, lift, lift_columns, mul, mul_add, scale_add, triple,
    turn_z, zero,
};
use crate::workspace::BodyState;

/// Poses of the given bodies in their parents, from the coordinates and their cosines and sines.
#[inline(always)]
pub(crate) fn joint_poses<T: Real>(
    model: &Model<T::Const>,
    bodies: &Runs,
    q: &[T],
    cos_sin: &[(T, T)],
    motion: &mut [BodyState<T>],
) {
    for run in bodies.runs() {
        let joints = model.bodies[run.clone()].iter().zip(&cos_sin[run.clone()]);
        for ((body, cos_sin), state) in joints.zip(&mut motion[run]) {
            // straight to its place: a pose of lanes is large
            let at_zero = || lift_columns::<T>(&body.R_parent_body);
            state.p = lift::<T>(&body.p_parent_body);
            match body.motion {
                Motion::Revolute => state.R = turn_z::<T>(&at_zero(), cos_sin.0, cos_sin.1),
                Motion::Prismatic => {
                    state.R = at_zero();
                    state.p = scale_add::<T>(&state.R[2], q[body.q], &state.p);
                }
                Motion::Spherical | Motion::Floating => {
                    let pose = joint_pose(body, &q[body.q..], *cos_sin);
                    (state.R, state.p) = (columns(&pose.R), triple(&pose.p));
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

/// τ = M q̈ + C − Σ Jᵀ w at the joints of the scope's driven bodies. Needs [`joint_poses`];
/// `wrench` holds what acts on each body, `None` where nothing does.
#[inline]
pub(crate) fn newton_euler<T: Real>(
    model: &Model<T::Const>,
    scope: &Scope,
    &TreeMotion { q, qd, qdd }: &TreeMotion<'_, T>,
    wrench: Option<&[(Vector3<T>, Vector3<T>)]>,
    motion: &mut [BodyState<T>],
    tau: &mut [T],
) {
    // the world accelerates against gravity
    motion[0].w = zero::<T>();
    motion[0].alpha = zero::<T>();
    motion[0].a = -lift::<T>(&model.gravity);

    // motion, from the root outwards
    for i in scope.carriers.places() {
        let body = &model.bodies[i];
        let (before, state) = motion.split_at_mut(i);
        let state = &mut state[0];
        (state.w, state.alpha, state.a) = accelerate(body, state, &before[body.parent], qd, qdd);
        (state.n, state.f) = (zero::<T>(), zero::<T>());
    }
    for run in scope.driven.runs() {
        let (bodies, motion) = (&model.bodies[..run.end], &mut motion[..run.end]);
        for i in run {
            let body = &bodies[i];
            let (before, state) = motion.split_at_mut(i);
            let state = &mut state[0];
            (state.w, state.alpha, state.a) =
                accelerate(body, state, &before[body.parent], qd, qdd);
            (state.n, state.f) = inertial_force::<T>(body, &state.w, &state.alpha, &state.a);
            if let Some(wrench) = wrench {
                state.n -= triple(&wrench[i].0);
                state.f -= triple(&wrench[i].1);
            }
        }
    }

    forces_to_root(model, scope, motion, tau);
    // what acts in the joints themselves
    joint_forces(model, scope, q, qd, qdd, tau);
}

/// The same of a tree at rest: what gravity, springs and wrenches ask, with the bits of
/// [`newton_euler`] at q̇ = q̈ = 0.
#[inline]
pub(crate) fn rest_forces<T: Real>(
    model: &Model<T::Const>,
    scope: &Scope,
    q: &[T],
    wrench: Option<&[(Vector3<T>, Vector3<T>)]>,
    motion: &mut [BodyState<T>],
    tau: &mut [T],
) {
    motion[0].a = -lift::<T>(&model.gravity);
    for i in scope.carriers.places() {
        let (before, state) = motion.split_at_mut(i);
        state[0].a = mul::<T>(&rows(&state[0]), &before[model.bodies[i].parent].a);
        (state[0].n, state[0].f) = (zero::<T>(), zero::<T>());
    }
    for run in scope.driven.runs() {
        let (bodies, motion) = (&model.bodies[..run.end], &mut motion[..run.end]);
        for i in run {
            let body = &bodies[i];
            let (before, state) = motion.split_at_mut(i);
            let state = &mut state[0];
            state.a = mul::<T>(&rows(state), &before[body.parent].a);
            state.n = cross::<T>(&lift::<T>(&body.h), &state.a);
            state.f = state.a.times(T::Triple::splat(T::lift(body.mass)));
            if let Some(wrench) = wrench {
                state.n -= triple(&wrench[i].0);
                state.f -= triple(&wrench[i].1);
            }
        }
    }
    forces_to_root(model, scope, motion, tau);
    spring_forces(model, scope, q, tau);
}

/// What each joint transmits, from the forces on the bodies.
#[inline(always)]
fn forces_to_root<T: Real>(
    model: &Model<T::Const>,
    scope: &Scope,
    motion: &mut [BodyState<T>],
    tau: &mut [T],
) {
    for run in scope.driven.runs().rev() {
        let mut motion = &mut motion[..run.end];
        for body in model.bodies[run].iter().rev() {
            let Some((state, before)) = motion.split_last_mut() else { return };
            match body.motion {
                // a zero without a sign, whatever was left out before
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
            if body.parent != 0 {
                let f = mul::<T>(&state.R, &state.f);
                let parent = &mut before[body.parent];
                let n = mul_add::<T>(&state.R, &state.n, &parent.n);
                parent.n = cross_add::<T>(&state.p, &f, &n);
                parent.f += f;
            }
            motion = before;
        }
    }
}

/// The rows of a body's rotation: by them vectors of the parent are turned into its axes.
#[inline(always)]
fn rows<T: Real>(state: &BodyState<T>) -> Columns<T> {
    T::Triple::transposed(&state.R)
}

/// ω, α, a of a body from its pose, those of its parent p and the rates of its joint.
#[inline(always)]
pub(super) fn accelerate<T: Real>(
    body: &Body<T::Const>,
    state: &BodyState<T>,
    p: &BodyState<T>,
    qd: &[T],
    qdd: &[T],
) -> (T::Triple, T::Triple, T::Triple) {
    let to_body = rows(state);
    let mut w = mul::<T>(&to_body, &p.w);
    let alpha = mul::<T>(&to_body, &p.alpha);
    let inner = cross::<T>(&p.w, &state.p);
    let a = cross_add::<T>(&p.w, &inner, &cross_add::<T>(&p.alpha, &state.p, &p.a));
    let a = mul::<T>(&to_body, &a);
    let of = |x: &[T]| T::Triple::new(x[0], x[1], x[2]);
    match body.motion {
        // x + ω × z v + z v̇
        Motion::Revolute => {
            let (v, vd) = (qd[body.v], qdd[body.v]);
            let alpha = along_z::<T>(&w, v, vd, &alpha);
            w[2] += v;
            (w, alpha, a)
        }
        Motion::Prismatic => {
            let (v, vd) = (qd[body.v], qdd[body.v]);
            (w, alpha, along_z::<T>(&w, v + v, vd, &a))
        }
        Motion::Spherical => {
            let (w_j, vd) = (of(&qd[body.v..body.v + 3]), of(&qdd[body.v..body.v + 3]));
            let alpha = cross_add::<T>(&w, &w_j, &(alpha + vd));
            (w + w_j, alpha, a)
        }
        Motion::Floating => {
            let (v, vd) = (&qd[body.v..body.v + 6], &qdd[body.v..body.v + 6]);
            let (w_j, v_j) = (of(v), of(&v[3..]));
            let alpha = cross_add::<T>(&w, &w_j, &(alpha + of(vd)));
            let w_i = w + w_j;
            let a = cross_add::<T>(&(w + w_i), &v_j, &(a + of(&vd[3..])));
            (w_i, alpha, a)
        }
    }
}

/// c + ω × z v + z v̇.
#[inline(always)]
fn along_z<T: Real>(w: &T::Triple, v: T, vd: T, c: &T::Triple) -> T::Triple {
    T::Triple::new(w[1], w[0], T::ONE).fused(T::Triple::new(v, -v, vd), *c)
}

/// n = I α + ω × I ω + h × a and f = m a + α × h + ω × (ω × h).
#[inline(always)]
fn inertial_force<T: Real>(
    body: &Body<T::Const>,
    w: &T::Triple,
    alpha: &T::Triple,
    a: &T::Triple,
) -> (T::Triple, T::Triple) {
    let h = lift::<T>(&body.h);
    let [xx, xy, xz, yy, yz, zz] = body.inertia.map(T::lift);
    let inertia = T::Triple::columns([xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let turning = cross_add::<T>(&h, a, &mul::<T>(&inertia, alpha));
    let n = cross_add::<T>(w, &mul::<T>(&inertia, w), &turning);
    let weight = a.times(T::Triple::splat(T::lift(body.mass)));
    let f = cross_add::<T>(w, &cross::<T>(w, &h), &cross_add::<T>(alpha, &h, &weight));
    (n, f)
}
