//! Why there is no page.

use std::io;

use sarrus_generate::GenerateError;

/// Why there is no page of a robot.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShowError {
    /// Its loops are closed in a way that pages do not have: by a choice among redundant rows,
    /// along tangents where assemblies meet, after a closed form, or by joints of several freedoms.
    #[error(
        "pages do not close the loops of {0}, which need more than Newton's method on one \
         set of rows; `sarrus simulate` draws the robot"
    )]
    Newton(String),
    /// A mechanism with lengths at which it cannot be assembled.
    #[error("{mechanism} is not closed with these lengths at y = 0: {error}")]
    Lengths {
        /// Its name.
        mechanism: &'static str,
        /// Why.
        error: String,
    },
    /// A query has no code.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// No thread could be started.
    #[error("no thread could be started: {0}")]
    Thread(#[source] io::Error),
}
