//! Velocities and accelerations at q̈ = 0 of the bodies of a cluster, in the axes of its parent
//! body.

use nalgebra::{Matrix3, Vector3};

use crate::closure::Rate;
use crate::mechanism::{Body, Cluster, Motion};
use crate::scalar::Real;
use crate::spatial::{Pose, column, cross, cross_add, mul, scale_add, zero};

/// Rates of every local body at q̈ = 0.
pub(crate) fn local_rates<T: Real>(
    cluster: &Cluster<T::Const>,
    bodies: &[Body<T::Const>],
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
    cluster: &Cluster<T::Const>,
    bodies: &[Body<T::Const>],
    j: usize,
    qd: &[T],
    pose: &[Pose<T>],
    rate: &mut [Rate<T>],
) {
    let (body, parent) = (&bodies[j], cluster.local_parent[j]);
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
            v: cross_add(&self.w, r, &self.v),
            alpha: self.alpha,
            a: cross_add(&self.w, &cross(&self.w, r), &cross_add(&self.alpha, r, &self.a)),
        };
        match motion {
            Motion::Revolute => {
                let z = column(R, 2);
                x.alpha = scale_add(&cross(&self.w, &z), qd[0], &self.alpha);
                x.w = scale_add(&z, qd[0], &self.w);
            }
            Motion::Prismatic => {
                let z = column(R, 2);
                x.a = scale_add(&cross(&self.w, &z), qd[0] + qd[0], &x.a);
                x.v = scale_add(&z, qd[0], &x.v);
            }
            Motion::Spherical | Motion::Floating => self.moved_freely(motion, R, qd, &mut x),
        }
        x
    }

    #[inline(never)]
    fn moved_freely(&self, motion: Motion, R: &Matrix3<T>, qd: &[T], x: &mut Rate<T>) {
        let w = mul(R, &Vector3::new(qd[0], qd[1], qd[2]));
        x.alpha = cross_add(&self.w, &w, &self.alpha);
        x.w += w;
        if motion == Motion::Floating {
            let v = mul(R, &Vector3::new(qd[3], qd[4], qd[5]));
            x.a = cross_add(&(self.w + x.w), &v, &x.a);
            x.v += v;
        }
    }
}
