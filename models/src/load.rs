//! Compiles the contents of files into a model, or reports all of their faults.

use std::collections::BTreeSet;
use std::path::Path;

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{Compiled, Model};

use crate::actuators;
use crate::base::{self, Base};
use crate::build::{self, Spans};
use crate::contents::Contents;
use crate::error::{LoadError, Outcome};
use crate::report::{Diagnostics, Report};
use crate::scene::{self, Lock};
use crate::submechanisms::{self, Entry, Submechanisms};
use crate::text::{self, Text};
use crate::urdf::Urdf;
use crate::{units, unlisted, yaml};

/// Options for reading a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Gravity in root axes `[m/s²]`.
    pub gravity: [f64; 3],
    /// Faults of mass and inertia, and effects that are not modelled, are warnings.
    pub lenient: bool,
    /// The connection of the root link to the world.
    pub base: Base,
    /// Joints to hold still; a later lock of the same joint wins.
    pub lock: Vec<Lock>,
    /// Links to which the robot is reduced, with all joints that move them: names or patterns with
    /// `*`, `?` and `[…]`. Empty: all links. Other branches are removed with their mass.
    pub only: Vec<String>,
}

impl Default for Options {
    /// Standard gravity downwards, strict checks, a fixed base, the whole robot.
    fn default() -> Options {
        Options {
            gravity: [0.0, 0.0, -9.81],
            lenient: false,
            base: Base::Fixed,
            lock: Vec::new(),
            only: Vec::new(),
        }
    }
}

/// A robot, read and compiled.
#[derive(Debug)]
#[non_exhaustive]
pub struct Loaded {
    /// The robot as the files describe it.
    pub description: Description,
    /// The model that the kernels run on.
    pub compiled: Compiled,
    /// Warnings.
    pub report: Report,
    /// Positions of the description's parts, and the names of the files.
    pub(crate) spans: Spans,
    pub(crate) files: Vec<String>,
}

/// As [`crate::load`], of contents that may be missing after an error.
pub(crate) fn load_contents(
    contents: Option<Contents>,
    options: &Options,
    mut diagnostics: Diagnostics,
) -> Outcome<Loaded> {
    let mut robot = None;
    let loaded =
        contents.and_then(|contents| read(contents, options, &mut diagnostics, &mut robot));
    Loaded::new(loaded, robot, diagnostics)
}

/// A URDF and its joints, without its loops and without submechanisms.
pub(crate) fn urdf_alone(
    (name, bytes): (String, Vec<u8>),
    options: &Options,
) -> Outcome<(Urdf, Description)> {
    let mut diagnostics = Diagnostics::new(options.lenient);
    let mut text = Text::new(&name, bytes, &mut diagnostics);
    let urdf = text.as_mut().and_then(|text| read_urdf(text, &mut diagnostics));
    let urdf = urdf.map(|mut urdf| {
        urdf.check_couplings(&mut diagnostics);
        urdf
    });
    let described = urdf.filter(|_| !diagnostics.has_errors()).and_then(|urdf| {
        let description = build::description(&urdf, None, options.gravity)?;
        Some((urdf, description))
    });
    described.ok_or_else(|| LoadError::Faults(diagnostics.into_report()))
}

fn read_urdf(text: &mut Text, diagnostics: &mut Diagnostics) -> Option<Urdf> {
    text.join_stray_prefix("drake", diagnostics);
    Urdf::read(text, diagnostics)
}

impl Loaded {
    /// A robot without a fault.
    pub(crate) fn new(
        loaded: Option<(Description, Spans, Compiled)>,
        robot: Option<String>,
        diagnostics: Diagnostics,
    ) -> Outcome<Loaded> {
        let files = diagnostics.files.clone();
        let report = Report { robot, ..diagnostics.into_report() };
        match loaded {
            Some((description, spans, compiled)) if report.errors.is_empty() => {
                Ok(Loaded { description, compiled, report, spans, files })
            }
            _ => Err(LoadError::Faults(report)),
        }
    }
}

/// Reads and compiles; `None` or errors in `diagnostics` after a fault.
fn read(
    contents: Contents,
    options: &Options,
    diagnostics: &mut Diagnostics,
    robot: &mut Option<String>,
) -> Option<(Description, Spans, Compiled)> {
    let (description, spans) = describe(contents, options, diagnostics, robot)?;
    let (description, spans) =
        scene::reduce((&options.lock, &options.only), description, spans, diagnostics)?;
    let compiled = compile(&description, &spans, diagnostics)?;
    Some((description, spans, compiled))
}

/// Reads; `None` after a fault.
pub(crate) fn describe(
    contents: Contents,
    options: &Options,
    diagnostics: &mut Diagnostics,
    robot: &mut Option<String>,
) -> Option<(Description, Spans)> {
    // every fault of each file, even if the other one is faulty
    let (urdf_name, bytes) = contents.urdf;
    let mut urdf_text = Text::new(&urdf_name, bytes, diagnostics);
    let mut urdf = urdf_text.as_mut().and_then(|text| read_urdf(text, diagnostics));
    *robot = urdf.as_ref().map(|urdf| urdf.name.clone());
    let with_submechanisms = contents.submechanisms.is_some();
    let submechanism_text =
        contents.submechanisms.and_then(|(name, bytes)| Text::new(&name, bytes, diagnostics));
    let root = submechanism_text
        .as_ref()
        .and_then(|text| yaml::parse(text, yaml::SUBMECHANISMS, diagnostics));
    let entries = root.as_ref().map(|root| submechanisms::walk(root, diagnostics));
    if let (Some(urdf), Some(root)) = (&mut urdf, &root) {
        actuators::read(root, urdf, diagnostics);
    }
    if let (Some(urdf), Some(entries), Some(folder)) = (&mut urdf, &entries, &contents.folder) {
        transmissions(urdf, entries, folder, diagnostics);
    }
    if let Some(urdf) = &mut urdf {
        urdf.check_couplings(diagnostics);
    }
    let submechanisms: Option<Submechanisms> = root.zip(entries).map(|(root, entries)| {
        submechanisms::check(root.span, entries, urdf.as_ref(), diagnostics)
    });
    if diagnostics.has_errors() || with_submechanisms != submechanisms.is_some() {
        return None;
    }

    // the values
    let urdf = urdf?;
    let entries = match &submechanism_text {
        Some(text) => Some(submechanisms::values(text, diagnostics)?),
        None => None,
    };
    let has_file = entries.is_some();
    let Some(mut description) = build::description(&urdf, entries, options.gravity) else {
        let found = "two readers of these files see different names";
        let help = "use letters, digits, _ and / in names";
        return diagnostics.refused(urdf.span, found, "plain names", help);
    };

    let mut spans = Spans::new(&urdf, submechanisms.as_ref());
    unlisted::complete(&urdf, has_file, &mut description, &mut spans, diagnostics);
    base::put(&options.base, &mut description, &mut spans, diagnostics);
    if diagnostics.has_errors() {
        return None;
    }
    units::check(&description, &spans, diagnostics);
    Some((description, spans))
}

/// The model; its faults get their positions in the files.
pub(crate) fn compile(
    description: &Description,
    spans: &Spans,
    diagnostics: &mut Diagnostics,
) -> Option<Compiled> {
    match Model::compile(description) {
        Ok(compiled) => {
            spans.report(Vec::new(), compiled.warnings.clone(), diagnostics);
            Some(compiled)
        }
        Err(error) => {
            spans.report(error.errors, error.warnings, diagnostics);
            None
        }
    }
}

/// Takes the couplings of TRANSMISSION submechanisms from the files that they name, as HyRoDyn
/// does, where the URDF has none.
fn transmissions(urdf: &mut Urdf, entries: &[Entry], folder: &Path, diagnostics: &mut Diagnostics) {
    for entry in entries
        .iter()
        .filter(|entry| entry.type_name.as_ref().is_some_and(|(name, _)| name == "TRANSMISSION"))
    {
        let joints: BTreeSet<&str> =
            entry.tree.iter().flatten().map(|(name, _)| name.as_str()).collect();
        let is_coupled = joints
            .iter()
            .any(|name| urdf.joint(name).is_some_and(|joint| !joint.masters.is_empty()));
        let Some(path) =
            entry.file_path.as_ref().filter(|_| !is_coupled).map(|(path, _)| folder.join(path))
        else {
            continue;
        };
        // a missing file leaves the couplings missing, which is reported
        let Ok((name, bytes)) = text::read_named(&path) else { continue };
        if let Some(text) = Text::new(&name, bytes, diagnostics) {
            urdf.couple_from(&text, &joints, diagnostics);
        }
    }
}
