//! Recursive Newton-Euler: forces from motion [LWP80; F08, 5.3, in classical accelerations].
//!
//! Every joint moves along or about z of its body, so that a joint's motion touches single
//! components. Vectors are in body axes at the body's origin; accelerations are classical, and the
//! world accelerates against gravity.

use nalgebra::Vector3;

use crate::algorithms::terms::{joint_forces, spring_forces};
use crate::mechanism::{Body, Motion, joint_pose};
use crate::model::{Model, Runs, Scope};
use crate::scalar::Real;
use crate::spatial::{cross, cross_add, lift, lift_mat, mul, mul_add, t_mul, turn_z, zero};
use crate::workspace::BodyState;

/// Poses of the given bodies in their parents, from the coordinates and their cosines and sines.
#[inline]
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
            if body.motion == Motion::Revolute {
                // straight to its place: a pose of lanes is large
                state.R = turn_z(&lift_mat(&body.R_parent_body), cos_sin.0, cos_sin.1);
                state.p = lift(&body.p_parent_body);
            } else {
                let pose = joint_pose(body, &q[body.q..], *cos_sin);
                (state.R, state.p) = (pose.R, pose.p);
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
    motion[0].w = zero();
    motion[0].alpha = zero();
    motion[0].a = -lift::<T>(&model.gravity);

    // motion, from the root outwards
    for i in scope.carriers.places() {
        let body = &model.bodies[i];
        let (before, state) = motion.split_at_mut(i);
        let state = &mut state[0];
        (state.w, state.alpha, state.a) = accelerate(body, state, &before[body.parent], qd, qdd);
        (state.n, state.f) = (zero(), zero());
    }
    for run in scope.driven.runs() {
        let (bodies, motion) = (&model.bodies[..run.end], &mut motion[..run.end]);
        for i in run {
            let body = &bodies[i];
            let (before, state) = motion.split_at_mut(i);
            let state = &mut state[0];
            (state.w, state.alpha, state.a) =
                accelerate(body, state, &before[body.parent], qd, qdd);
            (state.n, state.f) = inertial_force(body, &state.w, &state.alpha, &state.a);
            if let Some(wrench) = wrench {
                state.n -= wrench[i].0;
                state.f -= wrench[i].1;
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
        state[0].a = t_mul(&state[0].R, &before[model.bodies[i].parent].a);
        (state[0].n, state[0].f) = (zero(), zero());
    }
    for run in scope.driven.runs() {
        let (bodies, motion) = (&model.bodies[..run.end], &mut motion[..run.end]);
        for i in run {
            let body = &bodies[i];
            let (before, state) = motion.split_at_mut(i);
            let state = &mut state[0];
            state.a = t_mul(&state.R, &before[body.parent].a);
            state.n = cross(&lift(&body.h), &state.a);
            state.f = state.a * T::lift(body.mass);
            if let Some(wrench) = wrench {
                state.n -= wrench[i].0;
                state.f -= wrench[i].1;
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
                let f = mul(&state.R, &state.f);
                let parent = &mut before[body.parent];
                parent.n = cross_add(&state.p, &f, &mul_add(&state.R, &state.n, &parent.n));
                parent.f += f;
            }
            motion = before;
        }
    }
}

/// ω, α, a of a body from its pose, those of its parent p and the rates of its joint.
#[inline(always)]
pub(super) fn accelerate<T: Real>(
    body: &Body<T::Const>,
    state: &BodyState<T>,
    p: &BodyState<T>,
    qd: &[T],
    qdd: &[T],
) -> (Vector3<T>, Vector3<T>, Vector3<T>) {
    let w = t_mul(&state.R, &p.w);
    let alpha = t_mul(&state.R, &p.alpha);
    let a = t_mul(
        &state.R,
        &cross_add(&p.w, &cross(&p.w, &state.p), &cross_add(&p.alpha, &state.p, &p.a)),
    );
    match body.motion {
        Motion::Revolute => {
            let (v, vd) = (qd[body.v], qdd[body.v]);
            let alpha_x = w[1].mul_add(v, alpha[0]);
            let alpha_y = (-w[0]).mul_add(v, alpha[1]);
            let w = Vector3::new(w[0], w[1], w[2] + v);
            (w, Vector3::new(alpha_x, alpha_y, alpha[2] + vd), a)
        }
        Motion::Prismatic => {
            let (v, vd) = (qd[body.v], qdd[body.v]);
            let v2 = v + v;
            let a = Vector3::new(w[1].mul_add(v2, a[0]), (-w[0]).mul_add(v2, a[1]), a[2] + vd);
            (w, alpha, a)
        }
        Motion::Spherical => {
            let (v, vd) = (&qd[body.v..body.v + 3], &qdd[body.v..body.v + 3]);
            let w_j = Vector3::new(v[0], v[1], v[2]);
            let alpha = cross_add(&w, &w_j, &(alpha + Vector3::new(vd[0], vd[1], vd[2])));
            (w + w_j, alpha, a)
        }
        Motion::Floating => {
            let (v, vd) = (&qd[body.v..body.v + 6], &qdd[body.v..body.v + 6]);
            let (w_j, v_j) = (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
            let alpha = cross_add(&w, &w_j, &(alpha + Vector3::new(vd[0], vd[1], vd[2])));
            let w_i = w + w_j;
            let a = cross_add(&(w + w_i), &v_j, &(a + Vector3::new(vd[3], vd[4], vd[5])));
            (w_i, alpha, a)
        }
    }
}

/// n = I α + ω × I ω + h × a and f = m a + α × h + ω × (ω × h).
#[inline(always)]
fn inertial_force<T: Real>(
    body: &Body<T::Const>,
    w: &Vector3<T>,
    alpha: &Vector3<T>,
    a: &Vector3<T>,
) -> (Vector3<T>, Vector3<T>) {
    let h = lift(&body.h);
    let inertia = body.inertia.map(T::lift);
    let n = cross_add(w, &turn_by(&inertia, w), &cross_add(&h, a, &turn_by(&inertia, alpha)));
    let f = cross_add(w, &cross(w, &h), &cross_add(alpha, &h, &(a * T::lift(body.mass))));
    (n, f)
}

/// I x for I = xx xy xz yy yz zz.
#[inline(always)]
pub(super) fn turn_by<T: Real>(inertia: &[T; 6], x: &Vector3<T>) -> Vector3<T> {
    let [xx, xy, xz, yy, yz, zz] = *inertia;
    Vector3::new(
        xx.mul_add(x[0], xy.mul_add(x[1], xz * x[2])),
        xy.mul_add(x[0], yy.mul_add(x[1], yz * x[2])),
        xz.mul_add(x[0], yz.mul_add(x[1], zz * x[2])),
    )
}
