//! How the closing of a cluster ended.

use sarrus_proto::Status;

use crate::scalar::{Mask, Real};

/// Square of the sine, or of a length against its size, below which a pose is near a singular one:
/// rates are known to ε / δ² of their size at δ, accelerations to ε / δ³.
pub(crate) const ILL_CONDITIONED: f64 = 1e-4;

/// What came of closing a cluster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub(crate) status: Status,
    pub(crate) iterations: u32,
    /// Closed, but so ill-conditioned, near a singular pose, that rates may keep fewer than nine
    /// digits; reported from the velocity level on.
    pub(crate) ill_conditioned: bool,
}

impl Outcome {
    pub(crate) const FINE: Outcome = Outcome::closed(0);

    pub(crate) const fn closed(iterations: u32) -> Outcome {
        Outcome { status: Status::Ok, iterations, ill_conditioned: false }
    }

    pub(crate) const fn failed(status: Status, iterations: u32) -> Outcome {
        Outcome { status, iterations, ill_conditioned: false }
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
pub(crate) struct Validity<M> {
    pub(crate) unreachable: M,
    pub(crate) singular: M,
    /// As [`Outcome::ill_conditioned`].
    pub(crate) ill_conditioned: M,
}

impl<M: Mask> Validity<M> {
    pub(crate) fn fine() -> Validity<M> {
        let none = M::splat(false);
        Validity { unreachable: none, singular: none, ill_conditioned: none }
    }

    /// From the square of what vanishes at a singular pose, negative beyond it, and the square of
    /// its size elsewhere.
    #[inline(always)]
    pub(crate) fn of<T: Real<Mask = M>>(square: T, size: T) -> Validity<M> {
        let below = |floor: f64| square.lt(T::from_f64(floor) * size);
        Validity {
            unreachable: square.lt(T::ZERO),
            singular: below(least_square_sine::<T>()),
            ill_conditioned: below(ILL_CONDITIONED),
        }
    }

    /// Either.
    #[inline(always)]
    pub(crate) fn or(self, other: Validity<M>) -> Validity<M> {
        Validity {
            unreachable: self.unreachable | other.unreachable,
            singular: self.singular | other.singular,
            ill_conditioned: self.ill_conditioned | other.ill_conditioned,
        }
    }
}

impl From<Validity<bool>> for Outcome {
    fn from(validity: Validity<bool>) -> Outcome {
        if validity.unreachable {
            Outcome::failed(Status::Unreachable, 0)
        } else if validity.singular {
            Outcome::failed(Status::SingularClosure, 0)
        } else {
            Outcome { ill_conditioned: validity.ill_conditioned, ..Outcome::FINE }
        }
    }
}
