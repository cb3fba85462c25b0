//! Dual numbers of the tests.

use sarrus_dynamics::Model;
use sarrus_dynamics::scalar::{Dual, Real};

/// First derivatives in one direction.
pub type First = Dual<f64>;
/// First derivatives in two directions, and the mixed second derivative.
pub type Second = Dual<Dual<f64>>;

/// A model over duals, whose constants have no derivative.
pub fn model<S: Real>(of: &Model<S>) -> Model<Dual<S>> {
    of.convert(Dual::constant)
}
