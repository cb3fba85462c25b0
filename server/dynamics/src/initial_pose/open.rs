//! A model whose loops need not be closed at zero, for assembly only.

use std::sync::Arc;

use crate::compile::Assembly;
use crate::description::Description;
use crate::diagnostic::CompileError;
use crate::initial_pose::{AssembleError, Assembled};
use crate::model::Model;
use crate::scalar::{Dd, Real};

/// A robot whose loops may be open at its zero pose. Rank, mobility and masses are unchecked; it
/// serves to find a closed pose.
#[derive(Clone, Debug)]
pub struct OpenModel {
    model: Model<f64>,
}

impl OpenModel {
    /// Orders bodies, clusters and rows of a description. Allocates.
    ///
    /// # Errors
    /// Faults of the structure: joints, owners, undefined loops.
    pub fn compile(description: &Description) -> Result<OpenModel, CompileError> {
        let mut errors = Vec::new();
        let Some(assembly) = Assembly::new(description, &mut errors) else {
            return Err(CompileError::of(errors));
        };
        let mut model = assembly.model.map(Dd::to_f64);
        model.clusters.iter_mut().for_each(|cluster| cluster.used.clear());
        model.meta = Arc::new(assembly.meta);
        Ok(OpenModel { model })
    }

    /// As [`Model::assemble`], over all rows; if they contradict each other by the rounding of a
    /// file, minimises the sum of their squares.
    ///
    /// # Errors
    /// As of [`Model::assemble`].
    pub fn assemble(&self, near: &[f64], weights: &[f64]) -> Result<Assembled, AssembleError> {
        self.model.assemble(near, weights)
    }

    /// As [`Model::tree_zero`].
    pub fn tree_zero(&self) -> Vec<f64> {
        self.model.tree_zero()
    }

    /// As [`Model::tree_units`].
    pub fn tree_units(&self) -> Vec<f64> {
        self.model.tree_units()
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
