//! Section `integration`: time integration.

use crate::Outcome;
use crate::progress::Progress;
use crate::report::{Effort, Section};

/// Fills the section.
pub(crate) fn run(_effort: &Effort, _progress: &Progress) -> Outcome<Section> {
    Ok(Section::new("integration", "Time integration"))
}
