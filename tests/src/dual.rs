//! Dual numbers as the tests use them.

use sarrus_dynamics::Model;
use sarrus_dynamics::scalar::{Dual, Real};

/// One first derivative in double.
pub type First = Dual<f64>;
/// Two first derivatives and the mixed second one in double.
pub type Second = Dual<Dual<f64>>;

/// A model over duals: its constants have no derivative.
pub fn model<S: Real>(of: &Model<S>) -> Model<Dual<S>> {
    of.convert(Dual::constant)
}
