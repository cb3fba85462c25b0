//! The source of a robot, and the functions that read one.

use std::path::{Path, PathBuf};

use crate::assembly::assemble_contents;
use crate::check::CheckReport;
use crate::contents::Contents;
use crate::error::{LoadError, Outcome};
use crate::load::{Loaded, Options, load_contents};
use crate::names::nearest;
use crate::report::Diagnostics;
use crate::rewrite::{NewZero, Rewritten};
use crate::suggest::{Suggestion, suggest_for};
use crate::{bundled, import, smurf, text};

/// The source of a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// One of [`crate::bundled`], by name.
    Bundled(String),
    /// Files: a URDF, or a SMURF file that names one, and the submechanisms. Without these every
    /// moving joint is independent and active. A file of MJCF or SDF has both, as
    /// YAML of Gepetto's tools with the URDF beside it; they are converted.
    Files {
        /// URDF, SMURF, MJCF, SDF or YAML of Gepetto's tools.
        urdf: PathBuf,
        /// Submechanism YAML.
        submechanisms: Option<PathBuf>,
    },
    /// The contents of files.
    Text {
        /// URDF, MJCF or SDF.
        urdf: Vec<u8>,
        /// Submechanism YAML.
        submechanisms: Option<Vec<u8>>,
    },
}

/// The contents of a bundled robot.
fn bundled_contents(name: &str) -> Outcome<Contents> {
    let Some((urdf, submechanisms)) = bundled::bundled_text(name) else {
        let names = || bundled::bundled().map(|(name, _)| name);
        let near = nearest(name, names()).map(str::to_owned);
        let known = names().collect::<Vec<_>>().join(", ");
        return Err(LoadError::UnknownRobot { name: name.to_owned(), known, near });
    };
    let label = |extension: &str| format!("models/robots/{name}/{name}.{extension}");
    Ok(Contents {
        urdf: (label("urdf"), urdf.into()),
        submechanisms: Some((label("yml"), submechanisms.into())),
        folder: None,
    })
}

/// Reads and compiles a robot.
///
/// # Errors
/// [`LoadError::Faults`] holds every fault of the files' content, not only the first; the other
/// variants are for sources that cannot be read at all.
pub fn load(source: &Source, options: &Options) -> Outcome<Loaded> {
    let mut diagnostics = Diagnostics::new(options.lenient);
    let contents = contents(source, &mut diagnostics)?;
    load_contents(contents, options, diagnostics)
}

/// Proposes a submechanism file for a robot.
///
/// # Errors
/// Sources that cannot be read; faults of the URDF or the loops that prevent a proposal.
pub fn suggest(source: &Source, options: &Options) -> Outcome<Suggestion> {
    suggest_for(whole(source, options.lenient)?, options, false)
}

/// Reads a robot and closes it near a pose.
///
/// `near` and `weights` make the lists from the names of the coordinates and of the velocities, and
/// the zero pose; their error is returned. The report describes the robot; for files that are open
/// at zero it describes the robot with the found pose as its zero pose, and the faults of the files
/// become warnings.
///
/// # Errors
/// Sources that cannot be read at all. The inner error is that of `near` or `weights`.
pub fn assemble<E>(
    source: &Source,
    options: &Options,
    near: impl FnOnce(&[String], Vec<f64>) -> Result<Vec<f64>, E>,
    weights: impl FnOnce(&[String]) -> Result<Vec<f64>, E>,
) -> Outcome<Result<CheckReport, E>> {
    let mut diagnostics = Diagnostics::new(options.lenient);
    match contents(source, &mut diagnostics)? {
        Some(contents) => assemble_contents(&contents, options, &diagnostics, near, weights),
        None => CheckReport::new(&Err(LoadError::Faults(diagnostics.into_report()))).map(Ok),
    }
}

impl NewZero {
    /// Writes the new zero pose into the texts of a source: origins, limits, calibration and soft
    /// limits, rests of springs, offsets of couplings, and placements of cuts. Every other byte
    /// stays. The new texts are read again and compared.
    ///
    /// # Errors
    /// Sources that cannot be read. The inner error names the part that cannot be written by
    /// position.
    pub fn write(&self, source: &Source, options: &Options) -> Outcome<Result<Rewritten, String>> {
        // a conversion that drops parts is refused where the robot is loaded
        Ok(self.write_contents(&whole(source, true)?, options))
    }
}

/// The texts of a source: URDF and submechanisms, as [`Source::Text`] takes them. Files that the
/// submechanisms name are not among them.
///
/// # Errors
/// As [`load`], for sources and SMURF files that cannot be read; the texts are not checked.
pub fn texts(source: &Source) -> Outcome<(Vec<u8>, Option<Vec<u8>>)> {
    // a conversion that drops parts is refused where the robot is loaded
    let Contents { urdf: (_, urdf), submechanisms, .. } = whole(source, true)?;
    Ok((urdf, submechanisms.map(|(_, bytes)| bytes)))
}

/// The contents of a source that is converted without an error.
fn whole(source: &Source, lenient: bool) -> Outcome<Contents> {
    let mut diagnostics = Diagnostics::new(lenient);
    let contents = contents(source, &mut diagnostics)?;
    contents.ok_or_else(|| LoadError::Faults(diagnostics.into_report()))
}

pub(crate) fn contents(
    source: &Source,
    diagnostics: &mut Diagnostics,
) -> Outcome<Option<Contents>> {
    let (path, urdf, submechanisms) = match source {
        Source::Bundled(name) => return bundled_contents(name).map(Some),
        Source::Files { urdf, submechanisms } if smurf::is_smurf(urdf) => {
            return smurf::contents(urdf, submechanisms.as_deref(), diagnostics);
        }
        Source::Files { urdf, submechanisms } => {
            let submechanisms = submechanisms.as_deref().map(text::read).transpose()?;
            (Some(urdf.as_path()), text::read(urdf)?, submechanisms)
        }
        Source::Text { urdf, submechanisms } => {
            let named = |bytes: &Vec<u8>| ("submechanisms.yml".to_owned(), bytes.clone());
            let urdf = ("robot.urdf".to_owned(), urdf.clone());
            (None, urdf, submechanisms.as_ref().map(named))
        }
    };
    if import::converter(&urdf.1).is_some() {
        return Ok(import::contents(path, urdf, submechanisms, diagnostics));
    }
    let folder = match source {
        Source::Files { submechanisms: Some(path), .. } => path.parent().map(Path::to_owned),
        _ => None,
    };
    Ok(Some(Contents { urdf, submechanisms, folder }))
}
