//! Why a robot cannot be loaded.

use crate::report::Report;

/// Why a robot cannot be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A file cannot be opened or read.
    #[error("cannot open {file}: {reason}; give the path of a readable file")]
    Open {
        /// The file as the user named it.
        file: String,
        /// The message of the operating system.
        reason: String,
    },
    /// No robot of this name is bundled.
    #[error(
        "there is no bundled robot `{name}`; expected one of {known}{}",
        near.as_ref().map(|near| format!("; did you mean `{near}`?")).unwrap_or_default()
    )]
    UnknownRobot {
        /// The name that was asked for.
        name: String,
        /// Every name there is.
        known: String,
        /// The nearest of them, if one is near.
        near: Option<String>,
    },
    /// The content of the files is faulty: every fault, and the warnings beside them.
    #[error("{0}")]
    Faults(Report),
}
