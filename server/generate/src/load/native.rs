//! A kernel in the code of this computer.

use std::path::Path;

use sarrus_dynamics::{Answer, Model, Plan, Status, Warnings, Workspace};

use super::LoadError;
use super::check::{self, STATES};
use super::file::ObjectFile;
use super::object::Object;
use crate::Manifest;
use crate::manifest::bare_query;

/// What generated functions return.
const OK: i32 = 0;
const LIMITS_EXCEEDED: i32 = 1;

/// A kernel that was loaded and found to have the bits of the generic ones.
#[derive(Debug)]
pub struct NativeKernel {
    object: Object,
    manifest: Manifest,
}

impl NativeKernel {
    /// Reads, checks and loads the shared object of a plan on the model that it was made for, and
    /// compares its answers with the plan's on thousands of states, in a thread that ends with it:
    /// what loading changes of how a thread computes is gone with the thread. Allocates.
    ///
    /// # Errors
    /// [`LoadError`] with the reason; nothing of it stays loaded.
    pub fn open(path: &Path, model: &Model<f64>, plan: &Plan) -> Result<NativeKernel, LoadError> {
        NativeKernel::load(&ObjectFile::read(path)?, model, plan)
    }

    /// The same for the plan that the file itself names. Allocates.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    pub fn of_file(path: &Path, model: &Model<f64>) -> Result<NativeKernel, LoadError> {
        let file = ObjectFile::read(path)?;
        let plan = file.plan(model)?;
        NativeKernel::load(&file, model, &plan)
    }

    /// The same of a file that was read.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    pub fn load(
        file: &ObjectFile,
        model: &Model<f64>,
        plan: &Plan,
    ) -> Result<NativeKernel, LoadError> {
        let (path, manifest) = (|| file.path().to_owned(), file.manifest());
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
        let kernel = NativeKernel { object: Object::load(file)?, manifest };
        match check::compare(&kernel, model, plan) {
            Ok(0) => Err(LoadError::Unserved { path: path(), states: STATES }),
            Ok(_) => Ok(kernel),
            Err((state, what)) => {
                Err(LoadError::Differs { path: path(), state, states: STATES, what })
            }
        }
    }

    /// The plan's answer, to the bit, or `None` where the plan has to be asked: `output` is then
    /// without meaning. `model` and `plan` are those that it was loaded with: of others it has the
    /// numbers of its own. What Newton's method closes is closed by the plan. Never allocates,
    /// locks, or calls the system.
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

    /// What it says of itself.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }
}
