//! Rows with each field in a separate array.

use std::ops::Range;

use sarrus_proto::{Answer, Status, Warnings};

use super::Batch;
use crate::scalar::LANES;

impl Batch {
    /// As [`Batch::run`], for rows with each field in a separate array: each field, in packing
    /// order, gives its rows and the number of values per row. The states of a packet are read and
    /// written in place.
    pub fn run_fields(
        &mut self,
        given: &[(&[f64], usize)],
        want: &mut [(&mut [f64], usize)],
        answers: &mut [Answer],
    ) {
        let n_in = self.plan.given().len();
        let n_out = self.plan.want().len();
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
        let is_straight = self.plan.batch_width > 1 && !self.plan.closes_apart();
        for first in (0..rows).step_by(LANES) {
            let here = first..rows.min(first + LANES);
            let tile = self.workspace.tile.as_mut();
            match tile.filter(|_| is_straight && here.len() == LANES) {
                Some(tile) => {
                    let of_rows = |width: usize| first * width..(first + LANES) * width;
                    let from = given.iter().map(|(rows, n)| (&rows[of_rows(*n)], *n));
                    let into = want.iter_mut().map(|(rows, n)| (&mut rows[of_rows(*n)], *n));
                    let alone = tile.run(&self.plan, from, into, &mut answers[here.clone()]);
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
