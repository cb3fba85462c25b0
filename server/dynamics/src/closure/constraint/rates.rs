//! Velocities and accelerations at q̈ = 0 of the bodies of a cluster, in the axes of its parent
//! body.

use nalgebra::{Matrix3, Vector3};

use crate::closure::Rate;
use crate::mechanism::{Body, Cluster, Motion};
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose, zero};

/// Rates of every local body at q̈ = 0.
pub(crate) fn local_rates<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    qd: &[T],
    pose: &[Pose<T>],
    rate: &mut [Rate<T>],
) {
    rate[0] = Rate::at_rest();
    for j in 0..cluster.n {
        rate_of(cluster, bodies, j, qd, pose, rate);
    }
}

/// Rates of one local body at q̈ = 0 from those of its parent.
#[inline(always)]
pub(in crate::closure) fn rate_of<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    j: usize,
    qd: &[T],
    pose: &[Pose<T>],
    rate: &mut [Rate<T>],
) {
    let body = &bodies[j];
    let parent = cluster.local_parent[j];
    rate[j + 1] = rate[parent].moved(
        body.motion,
        &(pose[j + 1].p - pose[parent].p),
        &pose[j + 1].R,
        &qd[body.v - cluster.v..],
    );
}

impl<T: Real> Rate<T> {
    pub(crate) fn at_rest() -> Rate<T> {
        Rate { w: zero(), v: zero(), alpha: zero(), a: zero() }
    }

    /// Rates of a body at q̈ = 0 whose origin lies r from this one's, from the rates of its joint
    /// along the axes R.
    #[inline]
    pub(in crate::closure) fn moved(
        &self,
        motion: Motion,
        r: &Vector3<T>,
        R: &Matrix3<T>,
        qd: &[T],
    ) -> Rate<T> {
        let mut x = Rate {
            w: self.w,
            v: self.v.add_cross(self.w, *r),
            alpha: self.alpha,
            a: self.acceleration(*r),
        };
        match motion {
            Motion::Revolute => {
                let z = R.col(2);
                x.alpha = self.alpha.add_scaled(self.w.cross(z), qd[0]);
                x.w = self.w.add_scaled(z, qd[0]);
            }
            Motion::Prismatic => {
                let z = R.col(2);
                x.a = x.a.add_scaled(self.w.cross(z), qd[0] + qd[0]);
                x.v = x.v.add_scaled(z, qd[0]);
            }
            Motion::Spherical | Motion::Floating => self.moved_freely(motion, R, qd, &mut x),
        }
        x
    }

    /// Acceleration of a point of the body that lies r from its origin.
    #[inline(always)]
    pub(in crate::closure) fn acceleration(&self, r: Vector3<T>) -> Vector3<T> {
        self.a.add_cross(self.alpha, r).add_cross(self.w, self.w.cross(r))
    }

    #[inline(never)]
    fn moved_freely(&self, motion: Motion, R: &Matrix3<T>, qd: &[T], x: &mut Rate<T>) {
        let w = R.apply(Vector3::new(qd[0], qd[1], qd[2]));
        x.alpha = self.alpha.add_cross(self.w, w);
        x.w += w;
        if motion == Motion::Floating {
            let v = R.apply(Vector3::new(qd[3], qd[4], qd[5]));
            x.a = x.a.add_cross(self.w + x.w, v);
            x.v += v;
        }
    }
}
