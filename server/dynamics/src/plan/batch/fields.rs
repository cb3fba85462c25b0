//! Rows whose fields lie apart, each in an array of its own.

use std::ops::Range;

use sarrus_proto::{Answer, Status, Warnings};

use super::{ALL, Batch, Tile};
use crate::plan::Plan;
use crate::scalar::{Abreast, LANES};

impl Batch {
    /// As [`Batch::run`], of rows whose fields lie apart: of each field in packing order its rows,
    /// one after the other, and how many numbers a row has. States that go abreast are read and
    /// written where they lie.
    pub fn run_fields(
        &mut self,
        given: &[(&[f64], usize)],
        want: &mut [(&mut [f64], usize)],
        answers: &mut [Answer],
    ) {
        let (n_in, n_out) = (self.plan.given().len(), self.plan.want().len());
        let rows = answers.len();
        let fits = |numbers: &[f64], width: usize| Some(numbers.len()) == rows.checked_mul(width);
        if given.iter().map(|(_, width)| width).sum::<usize>() != n_in
            || want.iter().map(|(_, width)| width).sum::<usize>() != n_out
            || !given.iter().all(|(numbers, width)| fits(numbers, *width))
            || !want.iter().all(|(numbers, width)| fits(numbers, *width))
        {
            want.iter_mut().for_each(|(numbers, _)| numbers.fill(f64::NAN));
            answers.fill(Answer { status: Status::WrongSize, warnings: Warnings::NONE });
            return;
        }
        let is_straight = self.plan.abreast > 1 && !self.plan.closes_apart();
        for first in (0..rows).step_by(LANES) {
            let here = first..rows.min(first + LANES);
            let tile = self.workspace.tile.as_mut();
            match tile.filter(|_| is_straight && here.len() == LANES) {
                Some(tile) => {
                    let of_rows = &mut answers[here.clone()];
                    let alone = tile.run_fields(&self.plan, given, want, first, of_rows);
                    for row in here.filter(|row| alone >> (row - first) & 1 != 0) {
                        self.run_packed(given, want, row..row + 1, answers);
                    }
                }
                None => self.run_packed(given, want, here, answers),
            }
        }
    }

    /// Answers up to [`LANES`] of the rows packed.
    fn run_packed(
        &mut self,
        given: &[(&[f64], usize)],
        want: &mut [(&mut [f64], usize)],
        rows: Range<usize>,
        answers: &mut [Answer],
    ) {
        let (input, output) = self.packed.pack(given, rows.clone());
        self.workspace.run(&self.plan, input, output, &mut answers[rows.clone()]);
        self.packed.unpack(want, rows);
    }
}

impl Tile {
    /// Answers [`LANES`] states from the first row on, but for those in the bits that it returns.
    fn run_fields(
        &mut self,
        plan: &Plan,
        given: &[(&[f64], usize)],
        want: &mut [(&mut [f64], usize)],
        first: usize,
        answers: &mut [Answer],
    ) -> u32 {
        let mut at = 0;
        for (numbers, width) in given {
            // slices of one length, so that no number is looked at alone
            let input = &mut self.input[at..][..*width];
            let row = |lane| &numbers[(first + lane) * width..][..*width];
            let rows: [&[f64]; LANES] = core::array::from_fn(row);
            for k in 0..*width {
                input[k] = Abreast::new(rows.map(|row| row[k]));
            }
            at += width;
        }
        let alone = self.answer(plan, answers);
        if alone == ALL {
            return ALL;
        }
        let mut at = 0;
        for (numbers, width) in want {
            let output = &self.output[at..][..*width];
            for lane in 0..LANES {
                let row = &mut numbers[(first + lane) * *width..][..*width];
                for (x, of_lanes) in row.iter_mut().zip(output) {
                    *x = of_lanes.states()[lane];
                }
            }
            at += *width;
        }
        alone
    }
}

/// Room for some rows whose fields lie apart, to pack them.
#[derive(Clone, Debug)]
pub struct PackedRows {
    widths: [usize; 2],
    input: Vec<f64>,
    output: Vec<f64>,
}

impl PackedRows {
    /// Room for so many rows of so many numbers in and out. Allocates; nothing after it does.
    pub fn new(rows: usize, n_in: usize, n_out: usize) -> PackedRows {
        let [input, output] = [n_in, n_out].map(|n| vec![0.0; rows * n]);
        PackedRows { widths: [n_in, n_out], input, output }
    }

    /// Packs these rows of the fields, each with its width; gives them, and where their answers go.
    pub fn pack(&mut self, given: &[(&[f64], usize)], rows: Range<usize>) -> (&[f64], &mut [f64]) {
        let [n_in, n_out] = self.widths;
        let input = &mut self.input[..rows.len() * n_in];
        let mut at = 0;
        for (numbers, width) in given {
            for (k, row) in rows.clone().enumerate() {
                let field = &numbers[row * width..][..*width];
                input[k * n_in + at..][..*width].copy_from_slice(field);
            }
            at += width;
        }
        (input, &mut self.output[..rows.len() * n_out])
    }

    /// Puts the answers where these rows of the fields are.
    pub fn unpack(&self, want: &mut [(&mut [f64], usize)], rows: Range<usize>) {
        let [_, n_out] = self.widths;
        let mut at = 0;
        for (numbers, width) in want {
            for (k, row) in rows.clone().enumerate() {
                let field = &self.output[k * n_out + at..][..*width];
                numbers[row * *width..][..*width].copy_from_slice(field);
            }
            at += *width;
        }
    }
}
