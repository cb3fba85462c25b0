//! A kernel in the code of this computer.

use sarrus_dynamics::{
    Answer, BatchWorkspace, CUT_SHORT, Model, Plan, Status, Warnings, Workspace,
};

use super::object::Object;
use crate::Manifest;

/// Return values of generated functions.
const OK: i32 = 0;
const LIMITS_EXCEEDED: i32 = 1;

/// Return values for rows, one bit for each.
pub(super) struct RowBits {
    /// Rows without an answer, and rows out of limits.
    left: u32,
    beyond: u32,
}

impl RowBits {
    #[inline]
    pub(super) fn answer(&self, row: usize) -> Option<Answer> {
        let is_beyond = self.beyond >> row & 1 != 0;
        let warnings = if is_beyond { Warnings::LIMITS_EXCEEDED } else { Warnings::NONE };
        (self.left >> row & 1 == 0).then_some(Answer { status: Status::Ok, warnings })
    }
}

/// A kernel that was loaded and found to have the bits of the generic ones.
#[derive(Debug)]
pub struct NativeKernel {
    pub(super) object: Object,
    pub(super) manifest: Manifest,
}

impl NativeKernel {
    /// The plan's answer, to the bit, or `None` where the plan has to be run: `output` is then
    /// undefined. `model` and `plan` must be those that the kernel was loaded with, whose numbers
    /// it holds. The plan closes loops by Newton's method. Never allocates, locks, or calls the
    /// system.
    #[inline]
    pub fn answer(
        &self,
        (model, plan): (&Model<f64>, &Plan),
        workspace: &mut Workspace<f64>,
        input: &[f64],
        output: &mut [f64],
    ) -> Option<Answer> {
        let input = if plan.closes_apart() { plan.close(model, workspace, input)? } else { input };
        let warnings = match self.object.call(input, output) {
            Some(OK) => Warnings::NONE,
            Some(LIMITS_EXCEEDED) => Warnings::LIMITS_EXCEEDED,
            _ => return None,
        };
        Some(Answer { status: Status::Ok, warnings })
    }

    /// How many rows [`NativeKernel::answer_rows`] answers at once; it takes any number.
    #[inline]
    pub fn rows(&self) -> usize {
        self.object.rows().max(1)
    }

    /// Answers rows of the plan that it was loaded with, as
    /// [`Batch::run`](sarrus_dynamics::Batch::run) does: several at once, those that it leaves to
    /// the plan alone, every row to the bit. How many rows are answered, which are all but in turns
    /// ([`BatchWorkspace::answer_in_turns`]), and how many it answered itself. Rows of other sizes
    /// than there are answers are [`Status::WrongSize`]. Never allocates, locks, or calls the
    /// system.
    #[inline]
    pub fn answer_rows(
        &self,
        plan: &Plan,
        scratch: &mut BatchWorkspace,
        input: &[f64],
        output: &mut [f64],
        answers: &mut [Answer],
    ) -> (usize, usize) {
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let rows = answers.len();
        if Some(input.len()) != rows.checked_mul(n_in)
            || Some(output.len()) != rows.checked_mul(n_out)
        {
            return (scratch.run(plan, input, output, answers), 0);
        }
        let mut by_kernel = 0;
        let mut first = 0;
        while first < rows {
            let count = (rows - first).min(self.rows());
            let input = &input[first * n_in..][..count * n_in];
            let output = &mut output[first * n_out..][..count * n_out];
            let answers = &mut answers[first..][..count];
            let bits = if count < self.object.rows().max(2) {
                None
            } else if plan.closes_apart() {
                let closed = scratch.close_rows(plan, input);
                closed.and_then(|(closed, open)| self.bits(closed, output, open))
            } else {
                self.bits(input, output, 0)
            };
            for (row, answer) in answers.iter_mut().enumerate() {
                let input = &input[row * n_in..][..n_in];
                let output = &mut output[row * n_out..][..n_out];
                let was_cut = scratch.is_cut(row);
                let (model, workspace) = scratch.one();
                let by_code = match &bits {
                    Some(bits) => bits.answer(row),
                    None if was_cut => None,
                    None => self.answer((model, plan), workspace, input, output),
                };
                by_kernel += usize::from(by_code.is_some());
                let is_alone = by_code.is_none();
                // the plan would take another turn to end there
                let is_cut = was_cut || bits.is_none() && plan.spent_turn(workspace);
                *answer = by_code.unwrap_or_else(|| match is_cut {
                    true => CUT_SHORT,
                    false => plan.run(model, workspace, input, output),
                });
                if is_alone && scratch.answers_in_turns() {
                    return (first + row + 1, by_kernel);
                }
            }
            first += count;
        }
        (rows, by_kernel)
    }

    /// The result of the function for rows on a full set of closed rows; those in `open` are not
    /// closed.
    #[inline]
    pub(super) fn bits(&self, closed: &[f64], output: &mut [f64], open: u32) -> Option<RowBits> {
        let bits = self.object.call_rows(closed, output)? as u32;
        Some(RowBits { left: bits | open, beyond: bits >> self.object.rows() })
    }

    /// Its manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }
}
