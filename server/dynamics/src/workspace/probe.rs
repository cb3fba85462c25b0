//! Scratch for computing a doubtful answer again and counting its correct digits.

use sarrus_proto::{Field, MAX_DIRECTIONS, MAX_FRAMES, MAX_WRENCHES, Request};

use crate::model::Model;
use crate::scalar::{Dd, Real};
use crate::workspace::{Needs, Workspace};

/// Longest output whose digits are counted, in every workspace: 16 MiB.
const LONGEST: usize = 1 << 20;
/// Numbers of a question and of its answer, and frames of a task, that samples have room for.
const NUMBERS: usize = 1 << 12;
const FRAMES: usize = 4;
/// Most units of the last place by which a sample moves a number.
const MOVED: i64 = 4;

/// Scratch of a doubtful answer that is computed again.
#[derive(Clone, Debug)]
pub(crate) struct Probe {
    /// In doubles with other roundings, by which most doubtful answers are found good.
    pub(crate) samples: [Again<f64>; 2],
    /// In double-double.
    pub(crate) exact: Again<Dd>,
}

/// A model with moved constants, a workspace and the numbers of one request.
#[derive(Clone, Debug)]
pub(crate) struct Again<S: Real> {
    pub(crate) model: Model<S>,
    pub(crate) workspace: Workspace<S>,
    pub(crate) input: Vec<S>,
    pub(crate) output: Vec<S>,
    /// Tells samples apart; none in double-double, whose input stays.
    sample: Option<u64>,
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
            let few = Needs { frames: needs.frames.min(FRAMES), search: false, ..needs };
            let [sampled, output] =
                [NUMBERS, LONGEST].map(|most| [input.min(most), output.min(most)]);
            Box::new(Probe {
                samples: [1, 2].map(|k| Again::new(model, few, sampled, Some(k))),
                exact: Again::new(model, needs, output, None),
            })
        })
    }
}

impl<S: Real> Again<S> {
    fn new<T: Real>(
        model: &Model<T>,
        needs: Needs,
        sizes: [usize; 2],
        sample: Option<u64>,
    ) -> Again<S> {
        let model = model.map(|c| S::from_f64(constant(c.to_f64(), sample)));
        Again {
            workspace: Workspace::sized(&model, needs),
            model,
            input: vec![S::ZERO; sizes[0]],
            output: vec![S::ZERO; sizes[1]],
            sample,
        }
    }

    /// Takes the input of a request and its coordinates, from which closures start: a long path to
    /// them is not followed twice.
    pub(crate) fn resume<T: Real>(&mut self, input: &[T], q: &[T]) {
        self.workspace.resumes = true;
        for (to, x) in self.workspace.start.iter_mut().zip(q) {
            *to = S::from_f64(x.to_f64());
        }
        let given = |x: f64| self.sample.map_or(x, |k| moved(x, MOVED, k));
        for (to, x) in self.input.iter_mut().zip(input) {
            *to = S::from_f64(given(x.to_f64()));
        }
    }
}

/// A constant of the model, moved by one or two units of its last place, in a sample by up to
/// [`MOVED`]: it was rounded when the model was made, and an answer that depends on that rounding
/// has lost the same digits. Whole numbers were not rounded, but a robot may have no others, so
/// that samples move them.
fn constant(x: f64, sample: Option<u64>) -> f64 {
    match sample {
        Some(k) => moved(x, MOVED, k),
        None if x.fract() == 0.0 => x,
        None => moved(x, 2, 0),
    }
}

/// A number moved by up to 2 or 4 units of its last place, but never by none; zero stays. The
/// direction follows from the bits, and differs between samples.
fn moved(x: f64, most: i64, sample: u64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    let bits = x.to_bits();
    let hash = (bits ^ sample << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    // −4 to −1 and 1 to 4, or −2, −1, 1, 2
    let step = (hash >> 61) as i64 * most / 4 - most;
    f64::from_bits(bits.wrapping_add_signed(step + i64::from(step >= 0)))
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
