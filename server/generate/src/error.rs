//! Why there is no straight-line code for a query, and why it was not compiled.

use std::io;
use std::path::PathBuf;

use sarrus_dynamics::{Field, QueryError, Status};

/// Why there is no straight-line code for a query; the generic kernels answer it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// The query does not fit the robot.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// A field that is not traced.
    #[error(
        "`{}` is not generated; give y, yd, ydd, guesses, forces or wrenches, and want {WANTED}",
        .0.name()
    )]
    Field(Field),
    /// More operations than this, the most that a compiler takes in reasonable time.
    #[error(
        "more than {0} operations: compilers take minutes for them; pick joints or frames, or \
         ask the generic kernels"
    )]
    TooLarge(usize),
    /// No state was found that has an answer without warnings.
    #[error(
        "none of {tried} random states has an answer without warnings (the last: {})",
        last.name()
    )]
    NoState {
        /// How many were tried.
        tried: usize,
        /// How the last one ended.
        last: Status,
    },
    /// The code would leave every one of so many states to the generic kernels.
    #[error(
        "the code would answer none of {0} states: some quotient or angle is of a zero whose \
         sign it cannot know; want other fields"
    )]
    Unserved(usize),
    /// The kernels did something that is not a straight line.
    #[error("the kernels take a decision by a number that cannot be traced")]
    NotStraight,
    /// Lengths that are to be inputs.
    #[error("these lengths do not move the points of the robot along straight lines")]
    Lengths,
    /// The traced code is not the kernel at this input.
    #[error("traced and generic numbers differ at input {0:?}")]
    Differs(Vec<f64>),
}

/// For the message above.
const WANTED: &str = "states, forces, G, M_y, C_y, frames or Jacobians";

/// Why generated code was not built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A file could not be written, or a program not be started.
    #[error("{path}: {error}")]
    Io {
        /// Which one.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A program ended with a fault: the compiler, or the test of its output.
    #[error("{program} failed: {words}")]
    Failed {
        /// Which one.
        program: String,
        /// The program's output.
        words: String,
    },
    /// A program took too long.
    #[error("{program} was ended after {seconds} s")]
    TooSlow {
        /// Which one.
        program: String,
        /// The bound `[s]`.
        seconds: u64,
    },
    /// `CC` has this flag, and it adds code of its own.
    #[error("CC has {0}, whose code no other program can load; remove it")]
    Flag(String),
    /// The caller cancelled it.
    #[error("cancelled")]
    Cancelled,
}
