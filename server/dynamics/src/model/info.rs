//! What a person may ask about a compiled robot.

use crate::diagnostic::Diagnostic;
use crate::model::Model;
use crate::scalar::Dd;

/// How the loops of one submechanism are closed.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosureInfo {
    /// Contextual name.
    pub name: String,
    /// The type as it was written.
    pub type_name: String,
    /// How it is closed.
    pub kind: ClosureKind,
    /// Constraint rows.
    pub rows: usize,
    /// How many of them are independent.
    pub rank: usize,
    /// Idle joints, which turn a rod between its ball joints and nothing else; they keep the value
    /// that they start with.
    pub idle: Vec<String>,
    /// Characteristic length of its largest cluster, in which rows are scaled `[m]`; zero without
    /// loops.
    pub length: f64,
    /// How far the geometry is from the closed form's assumptions, relative to the cluster's size.
    pub misfit: f64,
}

/// How loops are closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ClosureKind {
    /// By a closed form.
    Analytic,
    /// By Newton's method.
    Numerical,
    /// There are none.
    Serial,
}

impl ClosureKind {
    /// The name that scripts see.
    pub const fn name(self) -> &'static str {
        match self {
            ClosureKind::Analytic => "analytic",
            ClosureKind::Numerical => "numerical",
            ClosureKind::Serial => "serial",
        }
    }
}

/// The result of [`Model::compile`]: the robot in both precisions.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// The model for work.
    pub model: Model<f64>,
    /// The same model with constants to 32 digits, for reference.
    pub exact: Model<Dd>,
    /// What is remarkable but no error.
    pub warnings: Vec<Diagnostic>,
}
