//! The outcome of closing a cluster.

use sarrus_proto::Status;

use crate::scalar::{BranchValue, Real};

/// The result of closing a cluster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub(crate) status: Status,
    pub(crate) iterations: u32,
    /// 1/sin² of the angle, or of a length against its size, that vanishes at a singular pose; the
    /// product along closures that depend on each other. With Γ² for it poses are known to Γ ε,
    /// rates to Γ² ε, accelerations to Γ³ ε at worst.
    pub(crate) gain: f64,
    /// Largest gap of the rows that the solution leaves out, in radians or lengths of the cluster.
    pub(crate) open: f64,
}

impl Outcome {
    pub(crate) const FINE: Outcome = Outcome::closed(0);

    pub(crate) const fn closed(iterations: u32) -> Outcome {
        Outcome { status: Status::Ok, iterations, gain: 1.0, open: 0.0 }
    }

    pub(crate) const fn failed(status: Status, iterations: u32) -> Outcome {
        Outcome { status, iterations, gain: 1.0, open: 0.0 }
    }
}

/// Least squared sine between the links of a closed form: 1e-24, or, for scalars with too few
/// digits, the part that is lost at twice the root of their rounding.
const fn least_square_sine<T: Real>() -> f64 {
    let of_rounding = 8e7 * T::EPSILON * T::EPSILON;
    if of_rounding > 1e-24 { of_rounding } else { 1e-24 }
}

/// Whether a closed form has a solution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Validity<T: Real> {
    pub(crate) unreachable: bool,
    pub(crate) singular: bool,
    /// As [`Outcome::gain`].
    pub(crate) gain: T,
}

impl<T: Real> Validity<T> {
    pub(crate) fn fine() -> Validity<T> {
        let none = false;
        Validity { unreachable: none, singular: none, gain: T::ONE }
    }

    /// From the square of the length that vanishes at a singular pose, negative beyond it, and the
    /// square of its size elsewhere.
    #[inline(always)]
    pub(crate) fn of(square: T, size: T) -> Validity<T> {
        Validity {
            unreachable: square.lt(T::ZERO),
            singular: square.lt(T::from_f64(least_square_sine::<T>()) * size),
            gain: size / square,
        }
    }

    /// Either.
    #[inline(always)]
    pub(crate) fn or(self, other: Validity<T>) -> Validity<T> {
        Validity {
            unreachable: self.unreachable | other.unreachable,
            singular: self.singular | other.singular,
            gain: T::select_lt(self.gain, other.gain, other.gain, self.gain),
        }
    }

    /// The other one after this one, on which it depends.
    #[inline(always)]
    pub(crate) fn then(self, next: Validity<T>) -> Validity<T> {
        Validity {
            unreachable: self.unreachable | next.unreachable,
            singular: self.singular | next.singular,
            gain: T::larger(T::ONE, self.gain) * T::larger(T::ONE, next.gain),
        }
    }
}

impl<T: Real> From<Validity<T>> for Outcome {
    fn from(validity: Validity<T>) -> Outcome {
        if validity.unreachable {
            Outcome::failed(Status::Unreachable, 0)
        } else if validity.singular {
            Outcome::failed(Status::SingularClosure, 0)
        } else {
            Outcome {
                gain: validity.gain.to_branch_value(BranchValue::Gain).max(1.0),
                ..Outcome::FINE
            }
        }
    }
}
