//! Scratch for computing a doubtful answer again and counting its correct digits.

use sarrus_proto::{Field, MAX_DIRECTIONS, MAX_FRAMES, MAX_WRENCHES, Request};

use crate::model::Model;
use crate::scalar::{Dd, Real};
use crate::workspace::{Needs, Workspace};

/// Longest output whose digits are counted, in every workspace: 16 MiB.
const LONGEST: usize = 1 << 20;

/// A model, a workspace and the numbers of one request over [`Dd`].
#[derive(Clone, Debug)]
pub(crate) struct Probe {
    pub(crate) model: Model<Dd>,
    pub(crate) workspace: Workspace<Dd>,
    pub(crate) input: Vec<Dd>,
    pub(crate) output: Vec<Dd>,
}

impl Probe {
    /// For every plan on this model, `None` for scalars without one. Allocates.
    pub(crate) fn for_any_plan<T: Real>(model: &Model<T>, needs: Needs) -> Option<Box<Probe>> {
        let output =
            Field::ALL.iter().fold(0_usize, |sum, field| sum.saturating_add(most(model, *field)));
        Probe::new(model, needs, longest_input(model), output)
    }

    /// For plans of up to these counts of numbers. Allocates.
    pub(crate) fn new<T: Real>(
        model: &Model<T>,
        needs: Needs,
        input: usize,
        output: usize,
    ) -> Option<Box<Probe>> {
        T::PROBED.then(|| {
            let model = model.map(|c| moved(c.to_f64()));
            Box::new(Probe {
                workspace: Workspace::sized(&model, needs),
                model,
                input: vec![Dd::ZERO; input],
                output: vec![Dd::ZERO; output.min(LONGEST)],
            })
        })
    }
}

/// A constant of the model, moved by one or two units of its last place: it was rounded when the
/// model was made, and an answer that depends on that rounding has lost the same digits. Whole
/// numbers were not rounded. The direction follows from the bits.
fn moved(x: f64) -> Dd {
    if x.fract() == 0.0 || !x.is_finite() {
        return Dd::from(x);
    }
    let bits = x.to_bits();
    let hash = bits.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 62;
    // −2, −1, 1, 2
    let step = hash as i64 - 2 + (hash as i64 >> 1);
    Dd::from(f64::from_bits(bits.wrapping_add_signed(step)))
}

/// More numbers than any plan is given.
pub(crate) fn longest_input<C>(model: &Model<C>) -> usize {
    let is_input = |field: &&Field| Request::ALL.iter().any(|r| r.inputs().has(**field));
    Field::ALL.iter().filter(is_input).map(|field| most(model, *field)).sum()
}

/// The most numbers of a field.
fn most<C>(model: &Model<C>, field: Field) -> usize {
    let (rows, columns) = field.shape(&model.sizes(), MAX_FRAMES, MAX_WRENCHES);
    let each = if field.has_direction_rows() { MAX_DIRECTIONS } else { 1 };
    rows.saturating_mul(columns).saturating_mul(each)
}
