//! What a doubtful answer is computed with again, to see how many of its digits rounding left.

use sarrus_proto::{Field, MAX_WRENCHES};

use crate::model::Model;
use crate::scalar::{Real, Scalar, Stochastic};
use crate::workspace::{Needs, Workspace};

/// Longest output that a workspace for any plan has room for.
const LONGEST: usize = 1 << 16;
/// Frames that it has room for.
const FRAMES: usize = 4;

/// A model, a workspace and the numbers of one request over [`Stochastic`].
#[derive(Clone, Debug)]
pub(crate) struct Probe {
    pub(crate) model: Model<Stochastic>,
    pub(crate) workspace: Workspace<Stochastic>,
    pub(crate) input: Vec<Stochastic>,
    pub(crate) output: Vec<Stochastic>,
}

impl Probe {
    /// For plans of up to some size on this model, `None` for scalars without one. Allocates.
    pub(crate) fn new<T: Scalar>(model: &Model<T>, needs: Needs) -> Option<Box<Probe>> {
        if !T::PROBED {
            return None;
        }
        let (sizes, model) = (model.sizes(), model.map(|c| Stochastic::constant(c.to_f64())));
        let numbers = |field: &Field, frames| {
            let (rows, columns) = field.shape(&sizes, frames, MAX_WRENCHES);
            rows.saturating_mul(columns)
        };
        let is_input = |field: &&Field| **field <= Field::Wrenches;
        let input: usize = Field::ALL.iter().filter(is_input).map(|field| numbers(field, 0)).sum();
        let output = Field::ALL
            .iter()
            .fold(0_usize, |sum, field| sum.saturating_add(numbers(field, FRAMES)));
        Some(Box::new(Probe {
            workspace: Workspace::sized(&model, needs),
            model,
            input: vec![Stochastic::ZERO; input],
            output: vec![Stochastic::ZERO; output.min(LONGEST)],
        }))
    }

    /// Makes room for a plan of this many numbers. Allocates.
    pub(crate) fn make_room(&mut self, want: usize) {
        if self.output.len() < want {
            self.output.resize(want, Stochastic::ZERO);
        }
    }
}
