//! A model whose numerical closures end early.

use crate::closure::{Closure, End};
use crate::model::Model;
use crate::scalar::Real;

impl<C: Real> Model<C> {
    /// Replaces the tolerance of Newton's method, for measurements of error against run time.
    ///
    /// An attempt at a pose ends after a step below `tolerance`, in radians or cluster lengths, and
    /// after `steps` steps at the latest (one at least). The pose that is reached then stands, with
    /// status ok, as long as every step was sound: an answer is as good as the tolerance makes it.
    /// Without this a step ends it whose successor would be rounding, and a pose that ten steps do
    /// not reach is looked for along the path. Closed forms have no such end. Allocates.
    pub fn with_tolerance(&self, tolerance: f64, steps: u32) -> Model<C> {
        let mut model = self.clone();
        for numerical in model.closures.iter_mut().filter_map(Closure::numerical) {
            numerical.end = End { tolerance: Some(tolerance), steps: steps.max(1) };
        }
        model
    }
}
