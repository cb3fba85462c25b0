//! Why there is no page.

use std::io;

use sarrus_generate::GenerateError;

/// Why there is no page of a robot.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShowError {
    /// Its loops are not closed by straight-line code.
    #[error(
        "Newton's method closes the loops of {closures}, and a page has none; `sarrus simulate` \
         draws the robot"
    )]
    Newton {
        /// The submechanisms.
        closures: String,
    },
    /// A query has no code.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// No thread could be started.
    #[error("no thread could be started: {0}")]
    Thread(#[source] io::Error),
}
