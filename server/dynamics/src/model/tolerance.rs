//! A model with early termination of numerical closures.

use crate::closure::{Closure, End};
use crate::model::Model;
use crate::scalar::Real;

impl<C: Real> Model<C> {
    /// Replaces the tolerance of Newton's method, for measurements of error against run time.
    ///
    /// An attempt at a pose ends after a step below `tolerance`, in radians or cluster lengths, and
    /// after `steps` steps at the latest (one at least). The pose reached is then the answer, with
    /// status ok, if every step was sound: its error depends on the tolerance. Without this the
    /// attempt ends when the next step would be rounding, and continuation follows the path if ten
    /// steps do not reach the pose. Closed forms are not affected. Allocates.
    pub fn with_tolerance(&self, tolerance: f64, steps: u32) -> Model<C> {
        let mut model = self.clone();
        for numerical in model.closures.iter_mut().filter_map(Closure::numerical) {
            numerical.end = End { tolerance: Some(tolerance), steps: steps.max(1) };
        }
        model
    }
}
