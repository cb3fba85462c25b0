//! A robot in both precisions.

use crate::diagnostic::Diagnostic;
use crate::model::Model;
use crate::scalar::Dd;

/// The result of [`Model::compile`]: the robot in both precisions.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// The model for computation.
    pub model: Model<f64>,
    /// The model with constants of 32 digits, for reference.
    pub exact: Model<Dd>,
    /// Warnings.
    pub warnings: Vec<Diagnostic>,
}
