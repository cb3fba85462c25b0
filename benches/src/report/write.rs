//! Runs sections and writes their files.

use std::path::PathBuf;

use super::{Effort, SECTIONS, Section};
use crate::Outcome;
use crate::progress::Progress;

/// What to report and where it goes.
#[derive(Clone, Debug)]
pub struct Wish {
    /// How much is measured.
    pub effort: Effort,
    /// Names of sections; all of them where there is none.
    pub sections: Vec<String>,
    /// The folder.
    pub out: PathBuf,
}

/// Runs the wanted sections in their order.
///
/// # Errors
///
/// A section that fails.
pub fn run(wish: &Wish) -> Outcome<Vec<Section>> {
    let progress = Progress::with_lines();
    let wanted = |name: &str| wish.sections.is_empty() || wish.sections.iter().any(|wanted| wanted == name);
    let chosen: Vec<_> = SECTIONS.iter().filter(|(name, ..)| wanted(name)).collect();
    let whole: f64 = chosen.iter().map(|(_, _, share)| share).sum();
    let (mut sections, mut done) = (Vec::new(), 0.0);
    for (_, fill, share) in chosen {
        progress.part(done / whole, (done + share) / whole);
        sections.push(fill(&wish.effort, &progress)?);
        done += share;
    }
    progress.clear();
    Ok(sections)
}
