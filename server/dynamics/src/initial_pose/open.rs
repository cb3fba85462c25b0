//! A model whose loops need not be closed at zero, for assembly only.

use crate::description::Description;
use crate::diagnostic::CompileError;
use crate::initial_pose::{AssembleError, Assembled, assemble, units, zero};
use crate::model::Model;

/// A robot whose loops may be open at its zero pose: rank, mobility and masses are not judged, so
/// nothing can be asked of it but a closed pose.
#[derive(Clone, Debug)]
pub struct OpenModel {
    model: Model<f64>,
}

impl OpenModel {
    /// Orders bodies, clusters and rows of a description. Allocates.
    ///
    /// # Errors
    /// Faults of the structure: joints, owners, loops that nothing defines.
    pub fn compile(description: &Description) -> Result<OpenModel, CompileError> {
        let mut errors = Vec::new();
        match Model::open(description, &mut errors) {
            Some(model) if errors.is_empty() => Ok(OpenModel { model }),
            _ => Err(CompileError { errors, warnings: Vec::new() }),
        }
    }

    /// As [`Model::assemble`], over all rows: where they contradict each other by the rounding of a
    /// file, the sum of their squares is least.
    ///
    /// # Errors
    /// As there.
    pub fn assemble(&self, near: &[f64], weights: &[f64]) -> Result<Assembled, AssembleError> {
        assemble(&self.model, near, weights)
    }

    /// As [`Model::tree_zero`].
    pub fn tree_zero(&self) -> Vec<f64> {
        zero(&self.model)
    }

    /// As [`Model::tree_units`].
    pub fn tree_units(&self) -> Vec<f64> {
        units(&self.model)
    }

    /// Names in the order of q̇ (n_v).
    pub fn tree_names(&self) -> &[String] {
        self.model.tree_names()
    }

    /// Names in the order of q (n_q).
    pub fn tree_q_names(&self) -> &[String] {
        self.model.tree_q_names()
    }
}
