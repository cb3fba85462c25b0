//! Vectors of a plane, and a link that moves in it.

use crate::closure::numerical::seeds::MOST;
use crate::scalar::{Real, constants};

pub(super) type Plane<T> = [T; 2];

#[inline(always)]
pub(super) fn dot<T: Real>(x: &Plane<T>, y: &Plane<T>) -> T {
    x[0].mul_add(y[0], x[1] * y[1])
}

/// x × y = J x · y.
#[inline(always)]
pub(super) fn cross<T: Real>(x: &Plane<T>, y: &Plane<T>) -> T {
    x[0].mul_add(y[1], -(x[1] * y[0]))
}

/// y + s x.
#[inline(always)]
pub(super) fn add<T: Real>(x: &Plane<T>, s: T, y: &Plane<T>) -> Plane<T> {
    [x[0].mul_add(s, y[0]), x[1].mul_add(s, y[1])]
}

/// J x.
#[inline(always)]
pub(super) fn right<T: Real>(x: &Plane<T>) -> Plane<T> {
    [-x[1], x[0]]
}

/// A point of a link: its arm from the link's anchor at zero.
#[derive(Clone, Debug)]
pub(crate) struct Point<T> {
    pub(crate) link: usize,
    pub(crate) arm: Plane<T>,
}

constants! { Point:
    keep link;
    map arm;
}

/// A link at a pose: cosine and sine of its turn since zero, its anchor, the rates of both for each
/// independent, and their accelerations at ÿ = 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneLink<T> {
    pub(super) turn: (T, T),
    pub(super) at: Plane<T>,
    pub(super) rate: [(T, Plane<T>); MOST],
    /// θ̇ for the ẏ that is given.
    pub(super) speed: T,
    pub(super) bias: (T, Plane<T>),
    /// As [`crate::closure::Outcome::gain`].
    pub(super) gain: T,
}

impl<T: Real> PlaneLink<T> {
    /// The base.
    pub(crate) fn at_rest() -> PlaneLink<T> {
        let none = [T::ZERO; 2];
        PlaneLink {
            turn: (T::ONE, T::ZERO),
            at: none,
            rate: [(T::ZERO, none); MOST],
            speed: T::ZERO,
            bias: (T::ZERO, none),
            gain: T::ONE,
        }
    }

    /// The arm of a point as it is turned.
    #[inline(always)]
    pub(super) fn arm(&self, point: &Plane<T>) -> Plane<T> {
        let (c, s) = self.turn;
        [c.mul_add(point[0], -(s * point[1])), s.mul_add(point[0], c * point[1])]
    }

    /// Velocity of a point for one independent.
    #[inline(always)]
    pub(super) fn velocity(&self, arm: &Plane<T>, k: usize) -> Plane<T> {
        add(&right(arm), self.rate[k].0, &self.rate[k].1)
    }

    /// Acceleration of a point at ÿ = 0.
    #[inline(always)]
    pub(super) fn acceleration(&self, arm: &Plane<T>) -> Plane<T> {
        let turned = add(&right(arm), self.bias.0, &self.bias.1);
        add(arm, -(self.speed * self.speed), &turned)
    }
}
