//! How the closing of a cluster ended.

use sarrus_proto::Status;

use crate::scalar::{Mask, Real};

/// Square of the sine, or of a length against its size, below which a pose is near a singular one:
/// rates are known to ε / δ² of their size at δ, accelerations to ε / δ³.
pub(crate) const NEAR: f64 = 1e-4;

/// What came of closing a cluster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub(crate) status: Status,
    pub(crate) iterations: u32,
    /// Closed, but so near a singular pose that rates may keep fewer than nine digits; told from
    /// the velocity level on.
    pub(crate) near: bool,
}

impl Outcome {
    pub(crate) const FINE: Outcome = Outcome::closed(0);

    pub(crate) const fn closed(iterations: u32) -> Outcome {
        Outcome { status: Status::Ok, iterations, near: false }
    }

    pub(crate) const fn failed(status: Status, iterations: u32) -> Outcome {
        Outcome { status, iterations, near: false }
    }
}

/// Least squared sine between the links of a closed form: 1e-24, or where the scalar has too few
/// digits for that the part of them that is lost at twice the root of its rounding.
const fn least_square_sine<T: Real>() -> f64 {
    let of_rounding = 8e7 * T::EPSILON * T::EPSILON;
    if of_rounding > 1e-24 { of_rounding } else { 1e-24 }
}

/// Which lanes a closed form could not serve, and why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Verdict<M> {
    pub(crate) unreachable: M,
    pub(crate) singular: M,
    /// As [`Outcome::near`].
    pub(crate) near: M,
}

impl<M: Mask> Verdict<M> {
    pub(crate) fn fine() -> Verdict<M> {
        let none = M::splat(false);
        Verdict { unreachable: none, singular: none, near: none }
    }

    /// From the square of what vanishes at a singular pose, negative beyond it, and the square of
    /// its size elsewhere.
    #[inline(always)]
    pub(crate) fn of<T: Real<Mask = M>>(square: T, size: T) -> Verdict<M> {
        let below = |floor: f64| square.lt(T::from_f64(floor) * size);
        Verdict {
            unreachable: square.lt(T::ZERO),
            singular: below(least_square_sine::<T>()),
            near: below(NEAR),
        }
    }

    /// Either.
    #[inline(always)]
    pub(crate) fn or(self, other: Verdict<M>) -> Verdict<M> {
        Verdict {
            unreachable: self.unreachable | other.unreachable,
            singular: self.singular | other.singular,
            near: self.near | other.near,
        }
    }
}

impl From<Verdict<bool>> for Outcome {
    fn from(verdict: Verdict<bool>) -> Outcome {
        if verdict.unreachable {
            Outcome::failed(Status::Unreachable, 0)
        } else if verdict.singular {
            Outcome::failed(Status::SingularClosure, 0)
        } else {
            Outcome { near: verdict.near, ..Outcome::FINE }
        }
    }
}
