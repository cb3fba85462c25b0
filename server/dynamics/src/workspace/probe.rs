//! Scratch to compute a doubtful answer again and count its sound digits.

use sarrus_proto::{Field, MAX_WRENCHES};

use crate::model::Model;
use crate::scalar::{Real, Stochastic};
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
    pub(crate) fn for_any_plan<T: Real>(model: &Model<T>, needs: Needs) -> Option<Box<Probe>> {
        let output = Field::ALL
            .iter()
            .fold(0_usize, |sum, field| sum.saturating_add(numbers(model, field, FRAMES)));
        Probe::new(model, needs, longest_input(model), output.min(LONGEST))
    }

    /// For plans of up to these counts of numbers. Allocates.
    pub(crate) fn new<T: Real>(
        model: &Model<T>,
        needs: Needs,
        input: usize,
        output: usize,
    ) -> Option<Box<Probe>> {
        T::PROBED.then(|| {
            let model = model.map(|c| Stochastic::constant(c.to_f64()));
            Box::new(Probe {
                workspace: Workspace::sized(&model, needs),
                model,
                input: vec![Stochastic::ZERO; input],
                output: vec![Stochastic::ZERO; output],
            })
        })
    }
}

/// More numbers than any plan is given.
pub(crate) fn longest_input<C>(model: &Model<C>) -> usize {
    let is_input = |field: &&Field| **field <= Field::Wrenches;
    Field::ALL.iter().filter(is_input).map(|field| numbers(model, field, 0)).sum()
}

fn numbers<C>(model: &Model<C>, field: &Field, frames: usize) -> usize {
    let (rows, columns) = field.shape(&model.sizes(), frames, MAX_WRENCHES);
    rows.saturating_mul(columns)
}
