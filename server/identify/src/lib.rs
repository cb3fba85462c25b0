//! Masses, inertias and friction of a robot with closed loops from its motion and the forces of
//! its actuators.
//!
//! [`base_parameters`] finds the combinations of parameters that any motion can tell;
//! [`identify`] estimates them from a [`Log`], and the nearest physical links.
#![forbid(unsafe_code)]
// the symbols of the equations
#![allow(non_snake_case)]

mod dense;
mod estimate;
mod inertia;
mod log;
mod stack;

pub use estimate::{BaseEstimate, Estimate, LinkEstimate, Prediction, identify};
pub use log::{Log, Sample};

pub use sarrus_dynamics::{Base, base_parameters};
use sarrus_dynamics::{QueryError, Status};

/// Why nothing was estimated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The robot answers no query for forces by parameters.
    #[error("{0}")]
    Query(#[from] QueryError),
    /// A sample that cannot be.
    #[error("row {row} of the motion is {status}")]
    Sample {
        /// Number of the sample, from 0.
        row: usize,
        /// Its status.
        status: Status,
    },
    /// Fewer rows than parameters.
    #[error("{rows} rows of forces for {parameters} parameters; record a longer motion")]
    Short {
        /// Numbers that were measured.
        rows: usize,
        /// Parameters to be estimated.
        parameters: usize,
    },
    /// A log whose columns are not the robot's.
    #[error("{0}")]
    Log(String),
}
