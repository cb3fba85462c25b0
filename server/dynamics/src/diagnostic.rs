use core::fmt;

/// Where in a [`crate::description::Description`] something stands; whoever read the files knows
/// the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Site {
    /// The robot as a whole.
    Robot,
    /// A link.
    Link(usize),
    /// A joint.
    Joint(usize),
    /// A submechanism.
    Submechanism(usize),
    /// A loop of a submechanism.
    Loop(usize, usize),
    /// A row of a loop of a submechanism.
    Row(usize, usize, usize),
}

/// Something wrong with, or remarkable about, a description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Where it stands.
    pub site: Site,
    /// What was found.
    pub found: String,
    /// What was expected.
    pub expected: String,
    /// What to do.
    pub help: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, expected {}, {}", self.found, self.expected, self.help)
    }
}

/// Why a description cannot be compiled: every fault, and the warnings beside them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} fault(s) in the description; the first: {}", errors.len(), errors.first().map(ToString::to_string).unwrap_or_default())]
pub struct CompileError {
    /// What must be corrected.
    pub errors: Vec<Diagnostic>,
    /// What may stay.
    pub warnings: Vec<Diagnostic>,
}
