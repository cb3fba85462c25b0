//! A kernel in the code of this computer.

use std::path::Path;

use sarrus_dynamics::{Answer, BatchWorkspace, Model, Plan, Status, Warnings, Workspace};

use super::LoadError;
use super::check::{self, STATES};
use super::file::ObjectFile;
use super::object::Object;
use crate::Manifest;
use crate::manifest::bare_query;

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
    object: Object,
    manifest: Manifest,
}

impl NativeKernel {
    /// How many states a kernel is compared with its plan on before it is used.
    pub const STATES: u64 = STATES;

    /// Reads, checks and loads the shared object of a plan on the model that it was made for, and
    /// compares its answers with the plan's on thousands of states, in a thread of its own: changes
    /// of the floating-point environment at loading end with that thread. Allocates.
    ///
    /// # Errors
    /// [`LoadError`] with the reason; nothing of it stays loaded.
    pub fn open(path: &Path, model: &Model<f64>, plan: &Plan) -> Result<NativeKernel, LoadError> {
        NativeKernel::load(&ObjectFile::read(path)?, model, plan)
    }

    /// As [`NativeKernel::open`], for the plan that the file itself names. Allocates.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    pub fn of_file(path: &Path, model: &Model<f64>) -> Result<NativeKernel, LoadError> {
        let file = ObjectFile::read(path)?;
        let plan = file.plan(model)?;
        NativeKernel::load(&file, model, &plan)
    }

    /// As [`NativeKernel::open`], of a file that was read.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    pub fn load(
        file: &ObjectFile,
        model: &Model<f64>,
        plan: &Plan,
    ) -> Result<NativeKernel, LoadError> {
        let path = || file.path().to_owned();
        let manifest = file.manifest();
        file.plan(model)?;
        let sizes = [plan.given().len() + plan.closed_len(), plan.want().len()];
        if manifest.query != bare_query(plan.query())
            || [manifest.inputs, manifest.outputs] != sizes
        {
            return Err(LoadError::WrongQuery(path()));
        }
        let missing = manifest.missing_instructions();
        if !missing.is_empty() {
            return Err(LoadError::Processor { path: path(), missing: missing.join(" and ") });
        }
        let load = || NativeKernel::loaded(file, model, plan);
        std::thread::scope(|scope| {
            // functions of many numbers have large frames
            let builder = std::thread::Builder::new().stack_size(16 << 20);
            let loader = builder.spawn_scoped(scope, load);
            let loader = loader.map_err(|error| LoadError::Io { path: path(), error })?;
            loader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }

    /// Loads and compares, on a thread whose floating-point mode may be lost.
    fn loaded(
        file: &ObjectFile,
        model: &Model<f64>,
        plan: &Plan,
    ) -> Result<NativeKernel, LoadError> {
        let path = || file.path().to_owned();
        let manifest = file.manifest().clone();
        let mut kernel = NativeKernel { object: Object::load(file)?, manifest };
        match check::compare(&kernel, model, plan) {
            Ok(compared) if compared.answered == 0 => {
                Err(LoadError::Unserved { path: path(), states: STATES })
            }
            Ok(compared) => {
                if !compared.has_rows() {
                    kernel.object.leave_rows();
                }
                Ok(kernel)
            }
            Err((state, what)) => {
                Err(LoadError::Differs { path: path(), state, states: STATES, what })
            }
        }
    }

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
    /// the plan alone, every row to the bit; how many it answered itself. Rows of other sizes than
    /// there are answers are [`Status::WrongSize`]. Never allocates, locks, or calls the system.
    pub fn answer_rows(
        &self,
        plan: &Plan,
        scratch: &mut BatchWorkspace,
        input: &[f64],
        output: &mut [f64],
        answers: &mut [Answer],
    ) -> usize {
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let rows = answers.len();
        if Some(input.len()) != rows.checked_mul(n_in)
            || Some(output.len()) != rows.checked_mul(n_out)
        {
            scratch.run(plan, input, output, answers);
            return 0;
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
                let (model, workspace) = scratch.one();
                let by_code = match &bits {
                    Some(bits) => bits.answer(row),
                    None => self.answer((model, plan), workspace, input, output),
                };
                by_kernel += usize::from(by_code.is_some());
                *answer = by_code.unwrap_or_else(|| plan.run(model, workspace, input, output));
            }
            first += count;
        }
        by_kernel
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
