//! Files whose loops may be open at zero: read for assembly, and compiled with another zero pose.

use sarrus_dynamics::OpenModel;
use sarrus_dynamics::description::Description;

use crate::build::Spans;
use crate::contents::Contents;
use crate::error::{LoadError, Outcome};
use crate::load::{Loaded, Options, compile, describe};
use crate::report::{Diagnostics, Report};

/// A robot that was read but not assessed.
pub(crate) struct Opened {
    /// The robot as the files describe it.
    pub(crate) description: Description,
    /// The model, for assembly only.
    pub(crate) model: OpenModel,
    robot: Option<String>,
    spans: Spans,
    diagnostics: Diagnostics,
}

/// As [`crate::load`], of contents that may be missing after an error, without the faults of rank,
/// mobility and mass, which need closed loops.
pub(crate) fn open_contents(
    contents: Option<Contents>,
    options: &Options,
    mut diagnostics: Diagnostics,
) -> Outcome<Opened> {
    let mut robot = None;
    let described =
        contents.and_then(|contents| describe(contents, options, &mut diagnostics, &mut robot));
    if let Some((description, spans)) = described
        && !diagnostics.has_errors()
    {
        match OpenModel::compile(&description) {
            Ok(model) => return Ok(Opened { description, model, robot, spans, diagnostics }),
            Err(error) => spans.report(error.errors, Vec::new(), &mut diagnostics),
        }
    }
    Err(LoadError::Faults(Report { robot, ..diagnostics.into_report() }))
}

impl Opened {
    /// Compiles the robot with another zero pose, that of [`sarrus_dynamics::rezeroed`]; faults
    /// have the positions of their parts in the files.
    ///
    /// # Errors
    /// [`LoadError::Faults`].
    pub(crate) fn compile(&self, description: Description) -> Outcome<Loaded> {
        let mut diagnostics = self.diagnostics.clone();
        let compiled = compile(&description, &self.spans, &mut diagnostics);
        let loaded = compiled.map(|compiled| (description, self.spans.clone(), compiled));
        Loaded::new(loaded, self.robot.clone(), diagnostics)
    }
}
