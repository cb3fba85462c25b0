//! A server without generated kernels.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use sarrus_dynamics::{BatchWorkspace, Model, Plan, Workspace};
use sarrus_proto::{Answer, Query};

use crate::error::ServeError;

/// The kernels for the clients' plans: none in this build.
#[derive(Clone, Debug, Default)]
pub struct Kernels(());

impl Kernels {
    /// Refused.
    ///
    /// # Errors
    /// [`ServeError::Kernel`].
    pub fn auto(_trial: fn(&Path) -> Command) -> Result<Kernels, ServeError> {
        Kernels::refused()
    }

    fn refused() -> Result<Kernels, ServeError> {
        Err(ServeError::Kernel("built without the feature `generate`".to_owned()))
    }

    /// Refused.
    ///
    /// # Errors
    /// [`ServeError::Kernel`].
    pub fn of_file(_path: &Path, _model: &Model<f64>) -> Result<Kernels, ServeError> {
        Kernels::refused()
    }
}

/// Always `None`.
#[derive(Debug)]
pub(crate) enum NativeKernel {}

impl NativeKernel {
    pub(crate) fn answer(
        &self,
        _of: (&Model<f64>, &Plan),
        _workspace: &mut Workspace<f64>,
        _input: &[f64],
        _output: &mut [f64],
    ) -> Option<Answer> {
        match *self {}
    }

    pub(crate) fn rows(&self) -> usize {
        match *self {}
    }

    pub(crate) fn answer_rows(
        &self,
        _plan: &Plan,
        _scratch: &mut BatchWorkspace,
        _input: &[f64],
        _output: &mut [f64],
        _answers: &mut [Answer],
    ) -> (usize, usize) {
        match *self {}
    }
}

/// Does nothing.
pub(crate) struct Maker;

impl Maker {
    pub(crate) fn start(
        _kernels: &Kernels,
        _model: &Arc<Model<f64>>,
        _place: impl FnOnce() + Send + 'static,
    ) -> Result<Maker, ServeError> {
        Ok(Maker)
    }

    pub(crate) fn kernel_of(&mut self, _plan: &Plan) -> Option<Arc<NativeKernel>> {
        None
    }

    pub(crate) fn made(&mut self) -> Option<(fn(&Query) -> bool, Arc<NativeKernel>)> {
        None
    }

    pub(crate) fn stop(&mut self) {}
}
