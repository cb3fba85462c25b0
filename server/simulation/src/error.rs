//! Why a simulation cannot start.

use sarrus_dynamics::{QueryError, Status};

/// Result of a step of a simulation; the error names the input at fault.
pub(crate) type Outcome<T = ()> = Result<T, SimulationError>;

/// An error of every status but that of an answer.
pub(crate) fn answered(status: Status) -> Result<(), Status> {
    if status == Status::Ok { Ok(()) } else { Err(status) }
}

/// Why a simulation cannot start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// A list does not have one number for each joint.
    #[error("{what}: found {found} number(s), expected {expected} ({names})")]
    WrongCount {
        /// Which list.
        what: String,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
        /// The quantity that they stand for.
        names: String,
    },
    /// A number is NaN or infinite: the list, its place there from 0.
    #[error("{0}: number {at} is not finite, expected finite numbers", at = .1 + 1)]
    NotFinite(String, usize),
    /// A quaternion is not of unit length: the list, the difference of its length from 1.
    #[error("{0}: a quaternion is {1:e} off unit length, expected one within 1e-6 of it")]
    NotUnit(String, f64),
    /// A time, step or tolerance that is none.
    #[error("{what} is {found}, expected {expected}")]
    Setting {
        /// Which.
        what: &'static str,
        /// The given value.
        found: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// The table of an input is none.
    #[error("table of forces, row {at}: {found}, expected increasing times with a force for each \
        joint", at = .row + 1)]
    Table {
        /// Which row, from 0.
        row: usize,
        /// The fault.
        found: &'static str,
    },
    /// A gain on this joint of several freedoms.
    #[error(
        "kp is not zero at {0}, expected gains on joints of one freedom; the joint has several"
    )]
    GainOnFreeJoint(String),
    /// A spring ends on a link that is none, or has a constant that is none.
    #[error("spring {at}: {found}, expected {expected}", at = .spring + 1)]
    Spring {
        /// Which, from 0.
        spring: usize,
        /// The fault.
        found: String,
        /// The expected value.
        expected: &'static str,
    },
    /// The start has no answer.
    #[error("the start cannot be simulated: {status}{}", open_by(*.detail))]
    Start {
        /// Why.
        status: Status,
        /// The loops' residual where it is known, else zero.
        detail: f64,
    },
    /// Nothing can move.
    #[error("the robot has no degree of freedom, expected a joint that moves")]
    Rigid,
    /// The model does not support the question.
    #[error("{0}")]
    Plan(#[from] QueryError),
}

/// How far the loops of a start are open, where it is known.
fn open_by(residual: f64) -> String {
    if residual == 0.0 { String::new() } else { format!(" (loops open by {residual:e})") }
}

impl SimulationError {
    /// One finite number for each name.
    pub(crate) fn check_numbers(what: &str, numbers: &[f64], names: &[String]) -> Outcome {
        if numbers.len() != names.len() {
            return Err(SimulationError::WrongCount {
                what: what.to_owned(),
                found: numbers.len(),
                expected: names.len(),
                names: names.join(", "),
            });
        }
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(SimulationError::NotFinite(what.to_owned(), index)),
            None => Ok(()),
        }
    }

    /// A number within bounds.
    pub(crate) fn check_setting(
        what: &'static str,
        found: f64,
        good: bool,
        expected: &'static str,
    ) -> Outcome {
        if good && found.is_finite() {
            Ok(())
        } else {
            Err(SimulationError::Setting { what, found, expected })
        }
    }
}
