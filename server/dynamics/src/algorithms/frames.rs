//! Poses, twists, accelerations and Jacobians of frames; world axes at the frame's origin.

use nalgebra::Vector3;

use crate::algorithms::rnea::accelerate;
use crate::mechanism::{Frame, Motion};
use crate::model::Model;
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose, to_quaternion, zero};
use crate::workspace::BodyState;

/// Pose of the given bodies in the root frame; parents come before their children.
pub(crate) fn world_poses<T: Real>(
    model: &Model<T>,
    bodies: &[usize],
    motion: &[BodyState<T>],
    world: &mut [Pose<T>],
) {
    for &i in bodies {
        let in_parent = Pose::of(&motion[i].R, &motion[i].p);
        let parent = model.bodies[i].parent;
        world[i] = if parent == 0 { in_parent } else { world[parent].then(&in_parent) };
    }
}

/// ω and v of the given bodies, in their own axes.
pub(crate) fn velocities<T: Real>(
    model: &Model<T>,
    bodies: &[usize],
    qd: &[T],
    motion: &mut [BodyState<T>],
) {
    (motion[0].w, motion[0].v) = (T::Triple::zero(), T::Triple::zero());
    for &i in bodies {
        let body = &model.bodies[i];
        let p = motion[body.parent];
        let state = &mut motion[i];
        let rows = T::Triple::transposed(&state.R);
        state.w = rows.apply(p.w);
        state.v = rows.apply(p.v.add_cross(p.w, state.p));
        match body.motion {
            Motion::Revolute => state.w[2] += qd[body.v],
            Motion::Prismatic => state.v[2] += qd[body.v],
            Motion::Spherical => {
                state.w += T::Triple::new(qd[body.v], qd[body.v + 1], qd[body.v + 2])
            }
            Motion::Floating => {
                let rates = &qd[body.v..body.v + 6];
                state.w += T::Triple::new(rates[0], rates[1], rates[2]);
                state.v += T::Triple::new(rates[3], rates[4], rates[5]);
            }
        }
    }
}

/// ω, α and the classical acceleration of the given bodies, in their own axes, without gravity.
pub(crate) fn rates<T: Real>(
    model: &Model<T>,
    bodies: &[usize],
    qd: &[T],
    qdd: &[T],
    motion: &mut [BodyState<T>],
) {
    accelerate_all(model, T::Triple::zero(), bodies.iter().copied(), (qd, qdd), motion);
}

/// The same of bodies in the order of the tree, where the world has this acceleration.
#[inline(always)]
pub(super) fn accelerate_all<T: Real>(
    model: &Model<T>,
    root: T::Triple,
    bodies: impl Iterator<Item = usize>,
    (qd, qdd): (&[T], &[T]),
    motion: &mut [BodyState<T>],
) {
    let still = T::Triple::zero();
    (motion[0].w, motion[0].alpha, motion[0].a) = (still, still, root);
    for i in bodies {
        let body = &model.bodies[i];
        let (before, state) = motion.split_at_mut(i);
        let state = &mut state[0];
        (state.w, state.alpha, state.a) = accelerate(body, state, &before[body.parent], qd, qdd);
    }
}

/// Position and quaternion x, y, z, w of a frame.
pub(crate) fn frame_pose<T: Real>(frame: &Frame<T>, world: &[Pose<T>]) -> [T; 7] {
    pose_numbers(&in_root(frame, world))
}

/// Position and quaternion x, y, z, w.
pub(crate) fn pose_numbers<T: Real>(pose: &Pose<T>) -> [T; 7] {
    let [x, y, z, w] = to_quaternion(&pose.R);
    [pose.p[0], pose.p[1], pose.p[2], x, y, z, w]
}

/// [ω; v] of a frame after [`velocities`].
pub(crate) fn frame_twist<T: Real>(
    frame: &Frame<T>,
    world: &[Pose<T>],
    motion: &[BodyState<T>],
) -> [T; 6] {
    let state = &motion[frame.body];
    let R = &world[frame.body].R;
    let w = state.w.vector();
    let v = state.v.vector();
    let v = v.add_cross(w, frame.x_body_frame.p);
    pack(&R.apply(w), &R.apply(v))
}

/// [α; a] of a frame after [`rates`].
pub(crate) fn frame_acceleration<T: Real>(
    frame: &Frame<T>,
    world: &[Pose<T>],
    motion: &[BodyState<T>],
) -> [T; 6] {
    let state = &motion[frame.body];
    let R = &world[frame.body].R;
    let arm = frame.x_body_frame.p;
    let w = state.w.vector();
    let alpha = state.alpha.vector();
    let a = state.a.vector().add_cross(alpha, arm);
    let a = a.add_cross(w, w.cross(arm));
    pack(&R.apply(alpha), &R.apply(a))
}

/// Columns of the Jacobian over the tree velocities of a frame against a body, 0 for the root:
/// calls `each(internal velocity, column)` for the joints between them.
pub(crate) fn frame_jacobian<T: Real>(
    model: &Model<T>,
    frame: &Frame<T>,
    against: usize,
    world: &[Pose<T>],
    mut each: impl FnMut(usize, [T; 6]),
) {
    let point = in_root(frame, world).p;
    each_between(model, frame.body, against, |i, moves| {
        let mut each = |v: usize, column: [T; 6]| {
            each(v, if moves { column } else { column.map(|x| -x) });
        };
        let body = &model.bodies[i];
        let pose = &world[i];
        let arm = point - pose.p;
        let turn = |k: usize| {
            let axis = pose.R.col(k);
            pack(&axis, &axis.cross(arm))
        };
        let slide = |k: usize| pack(&zero(), &pose.R.col(k));
        match body.motion {
            Motion::Revolute => each(body.v, turn(2)),
            Motion::Prismatic => each(body.v, slide(2)),
            Motion::Spherical => (0..3).for_each(|k| each(body.v + k, turn(k))),
            Motion::Floating => {
                for k in 0..3 {
                    each(body.v + k, turn(k));
                    each(body.v + 3 + k, slide(k));
                }
            }
        }
    });
}

/// Calls `each(body, moves)` for the joints between two bodies: those that move the first one
/// against the other, and those that move the other.
#[inline(always)]
fn each_between<T>(
    model: &Model<T>,
    mut carries: usize,
    mut against: usize,
    mut each: impl FnMut(usize, bool),
) {
    // parents have smaller numbers: both paths end where they meet
    while carries != against {
        let moves = carries > against;
        let i = carries.max(against);
        each(i, moves);
        *(if moves { &mut carries } else { &mut against }) = model.bodies[i].parent;
    }
}

/// Columns of a frame against a body, 0 for the root, over turns and slides of the origins of the
/// joints between them: calls `each(number of the joint, k, column)`.
pub(crate) fn frame_by_geometry<T: Real>(
    model: &Model<T>,
    frame: &Frame<T>,
    against: usize,
    world: &[Pose<T>],
    mut each: impl FnMut(usize, usize, [T; 6]),
) {
    let point = in_root(frame, world).p;
    each_between(model, frame.body, against, |i, moves| {
        let Some((joint, link)) = model.order.joint_of(i) else { return };
        let body = &model.bodies[i];
        let origin = Pose { R: body.R_parent_body, p: body.p_parent_body };
        let origin = world[body.parent].then(&origin);
        let R = origin.R.times(model.frames[link].x_body_frame.R);
        let arm = point - origin.p;
        for k in 0..6 {
            let axis = if moves { R.col(k % 3) } else { -R.col(k % 3) };
            let turn = if k < 3 { pack(&axis, &axis.cross(arm)) } else { pack(&zero(), &axis) };
            each(joint, k, turn);
        }
    });
}

/// A wrench `[n; f]` in world axes at a frame's origin, as (n, f) in the axes of the frame's body
/// at its origin.
pub(crate) fn frame_wrench<T: Real>(
    frame: &Frame<T>,
    world: &[Pose<T>],
    wrench: &[T],
) -> (Vector3<T>, Vector3<T>) {
    let R = &world[frame.body].R;
    let n = R.apply_transposed(Vector3::new(wrench[0], wrench[1], wrench[2]));
    let f = R.apply_transposed(Vector3::new(wrench[3], wrench[4], wrench[5]));
    (n.add_cross(frame.x_body_frame.p, f), f)
}

/// Pose of a frame in the root.
pub(crate) fn in_root<T: Real>(frame: &Frame<T>, world: &[Pose<T>]) -> Pose<T> {
    let x = Pose { R: frame.x_body_frame.R, p: frame.x_body_frame.p };
    let body = &world[frame.body];
    Pose { R: body.R.times(x.R), p: body.point(&x.p) }
}

/// [a; b].
pub(crate) fn pack<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> [T; 6] {
    [a[0], a[1], a[2], b[0], b[1], b[2]]
}
