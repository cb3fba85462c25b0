//! Parameters of a robot with closed loops from measurements: masses, inertias and friction from
//! its motion and the forces of its actuators, geometry from redundant encoders.
//!
//! [`base_parameters`] finds the combinations of parameters that any motion can tell;
//! [`identify`] estimates them from a [`Log`], and the nearest physical links. [`calibrate`]
//! estimates offsets of encoders and the geometry that they tell.
#![forbid(unsafe_code)]
// the symbols of the equations
#![allow(non_snake_case)]

mod calibrate;
mod dense;
mod estimate;
mod inertia;
mod log;
mod stack;

pub use calibrate::{Calibrated, Calibration, calibrate};
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
    #[error("{rows} measured numbers for {parameters} parameters; record a longer motion")]
    Short {
        /// Numbers that were measured.
        rows: usize,
        /// Parameters to be estimated.
        parameters: usize,
    },
    /// A log whose columns are not the robot's.
    #[error("{0}")]
    Log(String),
    /// Rows that no parameters explain.
    #[error("no parameters explain the log; check its units and times, and the robot")]
    Unexplained,
    /// No robot has the geometry that fits.
    #[error("the geometry that fits is that of no robot: {0}")]
    Geometry(String),
}

/// Result of a step of an estimation.
type Outcome<T = ()> = Result<T, IdentifyError>;

impl IdentifyError {
    fn geometry(why: impl ToString) -> IdentifyError {
        IdentifyError::Geometry(why.to_string())
    }
}
