use core::fmt;

/// Position in a [`crate::description::Description`]; the reader of the files maps it to a line.
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

/// A fault or a warning about a description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Position of the fault.
    pub site: Site,
    /// The fault.
    pub found: String,
    /// The valid values.
    pub expected: String,
    /// The correction.
    pub help: String,
}

impl Diagnostic {
    pub(crate) fn new(
        site: Site,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Diagnostic {
        Diagnostic { site, found: found.into(), expected: expected.into(), help: help.into() }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, expected {}, {}", self.found, self.expected, self.help)
    }
}

/// The faults that prevent a compilation, and the warnings beside them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} fault(s) in the description; the first: {}",
    errors.len(),
    errors.first().map(ToString::to_string).unwrap_or_default()
)]
pub struct CompileError {
    /// Faults to correct.
    pub errors: Vec<Diagnostic>,
    /// Warnings, which do not prevent a compilation.
    pub warnings: Vec<Diagnostic>,
}

impl CompileError {
    /// Faults without warnings.
    pub(crate) fn of(errors: Vec<Diagnostic>) -> CompileError {
        CompileError { errors, warnings: Vec::new() }
    }
}
