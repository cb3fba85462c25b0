//! The degrees of freedom of joints: their motion, their axis, the pose that coordinates give,
//! and how a step changes them.

use nalgebra::{Matrix3, Vector3};

use crate::mechanism::Body;
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose, from_quaternion};

/// The motion that a body's joint allows, along or about its z axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    Revolute,
    Prismatic,
    Spherical,
    Floating,
}

impl Motion {
    /// Number of velocities and coordinates.
    pub(crate) const fn n_v(self) -> usize {
        match self {
            Motion::Revolute | Motion::Prismatic => 1,
            Motion::Spherical => 3,
            Motion::Floating => 6,
        }
    }
    pub(crate) const fn n_q(self) -> usize {
        match self {
            Motion::Revolute | Motion::Prismatic => 1,
            Motion::Spherical => 4,
            Motion::Floating => 7,
        }
    }
}

/// One velocity of a cluster with its joint and body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dof {
    /// Local velocity, first local coordinate of its joint, local body.
    pub(crate) v: usize,
    pub(crate) q: usize,
    pub(crate) body: usize,
    /// Which degree of freedom of the joint it is.
    pub(crate) k: usize,
    pub(crate) motion: Motion,
    /// It is the only one of its joint, along or about z.
    pub(crate) single: bool,
}

impl Dof {
    /// True where the velocity is that of a length.
    #[inline(always)]
    pub(crate) fn slides(&self) -> bool {
        self.motion == Motion::Prismatic || self.k >= 3
    }

    /// The axis of its body along or about which it moves, from the body's axes.
    #[inline(always)]
    pub(crate) fn axis<T: Real>(&self, R: &Matrix3<T>) -> Vector3<T> {
        if self.single { R.col(2) } else { R.col(self.k % 3) }
    }

    /// Moves the degree of freedom by a step in the cluster's coordinates.
    #[inline(always)]
    pub(crate) fn advance<T: Real>(&self, q: &mut [T], step: T) {
        if self.single {
            q[self.q] += step;
        } else {
            advance(self.motion, self.k, &mut q[self.q..], step);
        }
    }
}

/// Pose of a body in its parent from the cosine and sine and the coordinates of its joint, which
/// come first in `q`, and the place of the joint.
#[inline(always)]
pub(crate) fn joint_pose<T: Real>(
    body: &Body<T>,
    place: &Vector3<T>,
    q: &[T],
    cos_sin: (T, T),
) -> Pose<T> {
    match body.motion {
        Motion::Revolute | Motion::Prismatic => {
            single_pose(body, &Pose { R: body.R_parent_body, p: *place }, q[0], cos_sin)
        }
        Motion::Spherical | Motion::Floating => free_pose(body, place, q),
    }
}

/// Pose by a joint of several degrees of freedom.
#[inline(never)]
fn free_pose<T: Real>(body: &Body<T>, place: &Vector3<T>, q: &[T]) -> Pose<T> {
    let R: Matrix3<T> = body.R_parent_body;
    if body.motion == Motion::Spherical {
        return Pose { R: R.times(from_quaternion(q[0], q[1], q[2], q[3])), p: *place };
    }
    let p = R.apply_add(Vector3::new(q[0], q[1], q[2]), *place);
    Pose { R: R.times(from_quaternion(q[3], q[4], q[5], q[6])), p }
}

/// Pose of a body with one degree of freedom from that at zero of its joint.
#[inline(always)]
pub(crate) fn single_pose<T: Real>(
    body: &Body<T>,
    base: &Pose<T>,
    q: T,
    cos_sin: (T, T),
) -> Pose<T> {
    if body.motion == Motion::Revolute {
        Pose { R: base.R.turn_z(cos_sin.0, cos_sin.1), p: base.p }
    } else {
        Pose { R: base.R, p: base.p.add_scaled(base.R.col(2), q) }
    }
}

/// Moves one degree of freedom of a joint by a step; `q` starts with the joint's coordinates.
/// Quaternions stay of unit length.
#[inline(never)]
fn advance<T: Real>(motion: Motion, k: usize, q: &mut [T], step: T) {
    match (motion, k) {
        (Motion::Revolute | Motion::Prismatic, _) => q[0] += step,
        (Motion::Spherical, _) => turn_quaternion(&mut q[..4], k, step),
        (Motion::Floating, 0..3) => turn_quaternion(&mut q[3..7], k, step),
        (Motion::Floating, _) => {
            let R = from_quaternion(q[3], q[4], q[5], q[6]);
            for i in 0..3 {
                q[i] = R[(i, k - 3)].mul_add(step, q[i]);
            }
        }
    }
}

/// x y z w ← x y z w · (e_k sin(step/2), cos(step/2)), to unit length.
fn turn_quaternion<T: Real>(q: &mut [T], k: usize, step: T) {
    let (s, c) = (step * T::from_f64(0.5)).sin_cos();
    let i = (k + 1) % 3;
    let j = (k + 2) % 3;
    // along k the product acts as two plane turns: (k, w) and (i, j)
    let x = c.mul_add(q[k], s * q[3]);
    let w = c.mul_add(q[3], -(s * q[k]));
    let a = c.mul_add(q[i], s * q[j]);
    let b = c.mul_add(q[j], -(s * q[i]));
    let square = x.mul_add(x, w.mul_add(w, a.mul_add(a, b * b)));
    let scale = T::ONE / square.sqrt();
    (q[k], q[3], q[i], q[j]) = (x * scale, w * scale, a * scale, b * scale);
}
