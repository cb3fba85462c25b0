//! Why a robot cannot be loaded.

use crate::report::Report;

/// Result of reading a robot.
pub(crate) type Outcome<T = ()> = Result<T, LoadError>;

/// Why a robot cannot be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A file cannot be opened or read: its name, the system's reason.
    #[error("cannot open {0}: {1}; give the path of a readable file")]
    Open(String, String),
    /// No robot of this name is bundled.
    #[error(
        "there is no bundled robot `{name}`; expected one of {known}{}",
        near.as_ref().map(|near| format!("; did you mean `{near}`?")).unwrap_or_default()
    )]
    UnknownRobot {
        /// The requested name.
        name: String,
        /// Every known name.
        known: String,
        /// The nearest one, if one is close.
        near: Option<String>,
    },
    /// The content of the files is faulty: every fault, and the warnings.
    #[error("{0}")]
    Faults(Report),
}
