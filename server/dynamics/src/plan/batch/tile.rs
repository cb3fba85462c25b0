//! What states that go abreast are answered with.

use std::sync::Arc;

use sarrus_proto::{Answer, Status, Warnings};

use super::ALL;
use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::{Abreast, LANES, Marks, Real};
use crate::workspace::Workspace;

/// What states that go abreast need: room for plans of up to so many numbers.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    model: Arc<Model<Abreast>>,
    workspace: Workspace<Abreast>,
    input: Vec<Abreast>,
    output: Vec<Abreast>,
}

impl Tile {
    pub(super) fn new(
        model: Model<Abreast>,
        workspace: Workspace<Abreast>,
        n_in: usize,
        n_out: usize,
    ) -> Tile {
        let [input, output] = [n_in, n_out].map(|n| vec![Abreast::ZERO; n]);
        Tile { model: Arc::new(model), workspace, input, output }
    }

    /// True where there is room for the numbers of a plan.
    pub(super) fn holds(&self, plan: &Plan) -> bool {
        let n_in = plan.given().len() + plan.closed_len();
        n_in <= self.input.len() && plan.want().len() <= self.output.len()
    }

    /// Answers [`LANES`] states, of what closes apart closed ones, but for those in the bits that
    /// it returns: rows of fields that lie one after the other, with the width of a row.
    #[inline]
    pub(super) fn run<'a>(
        &mut self,
        plan: &Plan,
        given: impl Iterator<Item = (&'a [f64], usize)>,
        want: impl Iterator<Item = (&'a mut [f64], usize)>,
        answers: &mut [Answer],
    ) -> u32 {
        let (n_in, n_out) = (plan.given().len() + plan.closed_len(), plan.want().len());
        let (input, output) = (&mut self.input[..n_in], &mut self.output[..n_out]);
        let mut at = 0;
        for (rows, width) in given {
            read(rows, &mut input[at..][..width]);
            at += width;
        }
        Marks::take();
        // of what does not close apart the two are one
        let answer = plan.run_closed(&self.model, &mut self.workspace, input, output);
        let marks = Marks::take();
        if answer.status != Status::Ok || answer.warnings != Warnings::NONE {
            return ALL;
        }
        let mut at = 0;
        for (rows, width) in want {
            write(&output[at..][..width], rows);
            at += width;
        }
        for (lane, answer) in answers.iter_mut().enumerate() {
            let is_beyond = marks.beyond >> lane & 1 != 0;
            let warnings = if is_beyond { Warnings::LIMITS_EXCEEDED } else { Warnings::NONE };
            *answer = Answer { status: Status::Ok, warnings };
        }
        marks.left
    }
}

/// The numbers of [`LANES`] rows, each of one state, in blocks of as many numbers as rows; the last
/// block may overlap the one before.
fn read(rows: &[f64], numbers: &mut [Abreast]) {
    let n = numbers.len();
    let rows: [&[f64]; LANES] = core::array::from_fn(|lane| &rows[lane * n..][..n]);
    let Some(last) = n.checked_sub(LANES) else {
        for (k, x) in numbers.iter_mut().enumerate() {
            *x = Abreast::new(rows.map(|row| row[k]));
        }
        return;
    };
    for at in (0..n).step_by(LANES).map(|at| at.min(last)) {
        let block = rows.map(|row| core::array::from_fn(|k| row[at + k]));
        numbers[at..][..LANES].copy_from_slice(&Abreast::of_rows(block));
    }
}

/// The reverse.
fn write(numbers: &[Abreast], rows: &mut [f64]) {
    let n = numbers.len();
    let Some(last) = n.checked_sub(LANES) else {
        for (k, x) in numbers.iter().enumerate() {
            for (lane, x) in x.states().into_iter().enumerate() {
                rows[lane * n + k] = x;
            }
        }
        return;
    };
    for at in (0..n).step_by(LANES).map(|at| at.min(last)) {
        let block = Abreast::rows(core::array::from_fn(|k| numbers[at + k]));
        for (lane, block) in block.iter().enumerate() {
            rows[lane * n + at..][..LANES].copy_from_slice(block);
        }
    }
}
