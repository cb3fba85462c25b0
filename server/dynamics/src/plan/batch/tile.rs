//! Scratch and answers of a packet of states.

use std::sync::Arc;

use sarrus_proto::{Answer, Status, Warnings};

use super::ALL;
use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::{Divergence, LANES, Packet, Real};
use crate::workspace::Workspace;

/// Scratch of a packet of states, with room for plans of up to this many numbers.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    model: Arc<Model<Packet>>,
    workspace: Workspace<Packet>,
    input: Vec<Packet>,
    output: Vec<Packet>,
}

impl Tile {
    pub(super) fn new(
        model: Model<Packet>,
        workspace: Workspace<Packet>,
        n_in: usize,
        n_out: usize,
    ) -> Tile {
        let [input, output] = [n_in, n_out].map(|n| vec![Packet::ZERO; n]);
        Tile { model: Arc::new(model), workspace, input, output }
    }

    /// True if a plan's numbers fit.
    pub(super) fn holds(&self, plan: &Plan) -> bool {
        let n_in = plan.given().len() + plan.closed_len();
        n_in <= self.input.len() && plan.want().len() <= self.output.len()
    }

    /// Answers [`LANES`] states, closed ones where closures run separately, except those in the
    /// returned bits: rows of fields that lie one after the other, with the width of a row.
    #[inline]
    pub(super) fn run<'a>(
        &mut self,
        plan: &Plan,
        given: impl Iterator<Item = (&'a [f64], usize)>,
        want: impl Iterator<Item = (&'a mut [f64], usize)>,
        answers: &mut [Answer],
    ) -> u32 {
        let n_in = plan.given().len() + plan.closed_len();
        let n_out = plan.want().len();
        let input = &mut self.input[..n_in];
        let output = &mut self.output[..n_out];
        let mut at = 0;
        for (rows, width) in given {
            read(rows, &mut input[at..][..width]);
            at += width;
        }
        Divergence::take();
        // without separate closures this is the whole run
        let answer = plan.run_closed(&self.model, &mut self.workspace, input, output);
        let marks = Divergence::take();
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
fn read(rows: &[f64], numbers: &mut [Packet]) {
    let n = numbers.len();
    let rows: [&[f64]; LANES] = core::array::from_fn(|lane| &rows[lane * n..][..n]);
    let Some(last) = n.checked_sub(LANES) else {
        for (k, x) in numbers.iter_mut().enumerate() {
            *x = Packet::new(rows.map(|row| row[k]));
        }
        return;
    };
    for at in (0..n).step_by(LANES).map(|at| at.min(last)) {
        let block = rows.map(|row| core::array::from_fn(|k| row[at + k]));
        numbers[at..][..LANES].copy_from_slice(&Packet::of_rows(block));
    }
}

/// The reverse.
fn write(numbers: &[Packet], rows: &mut [f64]) {
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
        let block = Packet::rows(core::array::from_fn(|k| numbers[at + k]));
        for (lane, block) in block.iter().enumerate() {
            rows[lane * n + at..][..LANES].copy_from_slice(block);
        }
    }
}
