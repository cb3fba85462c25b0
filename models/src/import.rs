//! Robots of other formats as a URDF and a submechanism file that `check` accepts.

use std::path::{Path, PathBuf};

use sarrus_dynamics::description::{Description, Joint, JointKind, Limits, Link};

use crate::assembly::assemble_contents;
use crate::assembly_report::AssemblyReport;
use crate::contents::Contents;
use crate::error::{LoadError, Outcome};
use crate::load::{Loaded, Options, load_contents, urdf_alone};
use crate::mjcf::{self, Converted};
use crate::report::{Diagnostics, Report, Span, quoted};
use crate::suggest::suggest_for;
use crate::{build, export, gepetto, sdf, text};

/// Converts a file, of the given path and contents; `None` after an error.
type Converter =
    fn(Option<&Path>, (&str, Vec<u8>), &[PathBuf], &mut Diagnostics) -> Option<Converted>;

/// The converter of a text by its outermost element or its keys; `None` of URDF and others.
pub(crate) fn converter(bytes: &[u8]) -> Option<Converter> {
    let text = String::from_utf8_lossy(bytes);
    let mut rest = text.trim_start_matches('\u{feff}').trim_start();
    while let Some((end, skipped)) = [("<!--", "-->"), ("<?", "?>")]
        .iter()
        .find_map(|(start, end)| Some((end, rest.strip_prefix(start)?)))
    {
        rest = skipped.split_once(end)?.1.trim_start();
    }
    let Some(rest) = rest.strip_prefix('<') else {
        let is_gepetto = text.lines().any(|line| line.starts_with("closed_loop:"));
        return is_gepetto.then_some(gepetto::convert);
    };
    match rest.split(|c: char| c.is_whitespace() || ">/".contains(c)).next()? {
        "mujoco" => Some(mjcf::convert),
        "sdf" => Some(sdf::convert),
        _ => None,
    }
}

/// A robot of another format.
#[derive(Debug)]
#[non_exhaustive]
pub struct Imported {
    /// Name of the robot, and of its files without their endings.
    pub name: String,
    /// URDF.
    pub urdf: Vec<u8>,
    /// Submechanisms.
    pub submechanisms: Vec<u8>,
    /// The report of `check` on both, with the notes of the conversion.
    pub report: Report,
    /// Largest scaled residual of the loops at the file's pose; `None` where it is not known.
    pub residual: Option<f64>,
    /// The independent joints; empty after an error.
    pub independent: Vec<String>,
    /// Loops that are closed near the first keyframe: its name, and the closed pose.
    pub keyframe: Option<(String, AssemblyReport)>,
}

/// Converts a robot of MJCF, SDF or Gepetto's tools, or a URDF with the loops of some dialect;
/// `expanded` stands for the file's text, as `xacro` and converters of other formats give it. Files
/// that it names are read below its folder or a folder of `include`.
///
/// # Errors
/// Files that cannot be read, and parts that cannot be expressed; the report then has the notes
/// too. Faults of the converted files are no error of this function: they are in the report.
pub fn import(
    path: &Path,
    expanded: Option<Vec<u8>>,
    include: &[PathBuf],
    options: &Options,
) -> Outcome<Imported> {
    let (file, bytes) = match expanded {
        Some(bytes) => (format!("{}, expanded", path.display()), bytes),
        None => text::read(path)?,
    };
    let mut diagnostics = Diagnostics::new(options.lenient);
    if converter(&bytes).is_none() {
        urdf_alone((file.clone(), bytes.clone()), options)?;
    }
    let made = converted(Some(path), (&file, bytes), include, options, &mut diagnostics);
    let Some(Made { name, contents, residual, keyframe }) = made else {
        return Err(LoadError::Faults(diagnostics.into_report()));
    };
    let (_, urdf) = contents.urdf.clone();
    let submechanisms = contents.submechanisms.clone().map(|(_, bytes)| bytes).unwrap_or_default();
    let loaded = load_contents(Some(contents), options, diagnostics);
    let (independent, report) = match loaded {
        Ok(Loaded { compiled, report, .. }) => (compiled.model.info().independent.clone(), report),
        Err(LoadError::Faults(report)) => (Vec::new(), report),
        Err(other) => return Err(other),
    };
    let name = report.robot.clone().unwrap_or(name);
    Ok(Imported { name, urdf, submechanisms, report, residual, independent, keyframe })
}

/// The contents of a format that is converted, of a file or a text, with the given submechanisms
/// in place of its own; `None` after an error.
pub(crate) fn contents(
    path: Option<&Path>,
    (file, bytes): (String, Vec<u8>),
    given: Option<(String, Vec<u8>)>,
    diagnostics: &mut Diagnostics,
) -> Option<Contents> {
    let options = Options { lenient: diagnostics.lenient, ..Options::default() };
    let Made { mut contents, .. } = converted(path, (&file, bytes), &[], &options, diagnostics)?;
    contents.submechanisms = given.or(contents.submechanisms);
    Some(contents)
}

/// Converted files, complete.
struct Made {
    name: String,
    contents: Contents,
    residual: Option<f64>,
    keyframe: Option<(String, AssemblyReport)>,
}

/// A URDF, with the loops of some dialect, as it is.
fn of_urdf(bytes: &[u8]) -> Converted {
    let urdf = String::from_utf8_lossy(bytes).into_owned();
    Converted {
        name: "robot".to_owned(),
        submechanisms: "submechanisms: []\n".to_owned(),
        pose: None,
        is_driven: ["<actuator", "<command_interface"].iter().any(|of| urdf.contains(of)),
        urdf,
    }
}

/// The files of a model: independent joints by the rule of [`crate::suggest`], and the nearest
/// closed pose as the zero pose where the file's is open.
fn converted(
    path: Option<&Path>,
    named: (&str, Vec<u8>),
    include: &[PathBuf],
    options: &Options,
    diagnostics: &mut Diagnostics,
) -> Option<Made> {
    let (file, found) = match converter(&named.1) {
        Some(convert) => {
            let found = convert(path, named, include, diagnostics)?;
            (format!("{}.urdf", found.name), found)
        }
        None => (named.0.to_owned(), of_urdf(&named.1)),
    };
    let Converted { name, urdf, submechanisms, pose, is_driven } = found;
    let mut contents = Contents {
        urdf: (file, urdf.into_bytes()),
        submechanisms: Some((format!("{name}.yml"), submechanisms.into_bytes())),
        folder: None,
    };
    // a fault of the converted files is reported when they are read
    let yaml = |text: String| Some((format!("{name}.yml"), text.into_bytes()));
    let suggested = |contents: &mut Contents, diagnostics: &mut Diagnostics| {
        let mut found = suggest_for(contents.clone(), options, !is_driven).ok()?;
        if let Some((robot, split)) = found.split.take() {
            let names: Vec<_> = split.iter().map(|j| quoted(&robot.joints[*j].name)).collect();
            let text = format!("a loop holds a free joint in part: {}", names.join(", "));
            let help = "it becomes three slides, named with /x, /y and /z, and a ball";
            diagnostics.note(Span::start(0), text, help);
            let robot = split.into_iter().fold(robot, with_slides);
            contents.urdf.1 = export::urdf::text(&robot).into_bytes();
            contents.submechanisms = yaml(export::yaml::text(&robot));
            found = suggest_for(contents.clone(), options, !is_driven).ok()?;
        }
        contents.submechanisms = yaml(found.yaml);
        Some(found.report.errors.is_empty())
    };
    let is_good = suggested(&mut contents, diagnostics) == Some(true);
    let at_zero = closed(&contents, options, None);
    let residual = at_zero.as_ref().map(|found| found.residual_before);
    // loops that are open in the file's pose
    if let Some(AssemblyReport { zero: Some(zero), q, .. }) = at_zero.filter(|_| !is_good)
        && let Ok(written) = zero.write_contents(&contents, options)
    {
        let moved = q.iter().filter(|of| of.found != 0.0);
        let moved: Vec<_> = moved.map(|of| format!("{} {:.6}", of.name, of.found)).collect();
        let found = "the loops are open in the file's pose";
        let from = "q counts from the nearest closed pose, which is, from that of the file";
        diagnostics.note(Span::start(0), found, format!("{from}: {}", moved.join(", ")));
        contents.urdf.1 = written.urdf;
        if let (Some(to), Some(from)) = (&mut contents.submechanisms, written.submechanisms) {
            to.1 = from;
        }
        suggested(&mut contents, diagnostics);
    }
    let keyframe =
        pose.and_then(|(key, pose)| Some((key, closed(&contents, options, Some(&pose))?)));
    Some(Made { name, contents, residual, keyframe })
}

/// A robot with three slides, along the axes of a free joint, and a ball in its place.
fn with_slides(mut robot: Description, joint: usize) -> Description {
    let Joint { name, mut parent, mut origin, .. } = robot.joints[joint].clone();
    let mut slides = Vec::new();
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let name = format!("{name}/{axis}");
        robot.links.push(Link { name: name.clone(), inertial: None });
        let child = robot.links.len() - 1;
        let kind = JointKind::Prismatic;
        let mut slide = build::joint(name, kind, std::mem::take(&mut origin), [parent, child]);
        slide.axis = std::array::from_fn(|i| f64::from(u8::from(i == k)));
        let [lower, upper] = [f64::NEG_INFINITY, f64::INFINITY];
        slide.limits = Some(Limits { lower, upper, velocity: upper, effort: upper });
        slides.push(robot.joints.len());
        robot.joints.push(slide);
        parent = child;
    }
    let ball = &mut robot.joints[joint];
    (ball.kind, ball.parent, ball.origin) = (JointKind::Spherical, parent, origin);
    let owners = robot.submechanisms.iter_mut().map(|of| &mut of.spanning_tree);
    for tree in owners.filter(|tree| tree.contains(&joint)) {
        let at = tree.iter().position(|of| *of == joint).unwrap_or(0);
        tree.splice(at..at, slides.clone());
    }
    robot
}

/// The closed pose near one that is given by name, or near the zero pose; `None` of faulty files.
fn closed(
    contents: &Contents,
    options: &Options,
    near: Option<&[(String, f64)]>,
) -> Option<AssemblyReport> {
    let given = |names: &[String], mut zero: Vec<f64>| {
        for (name, value) in near.unwrap_or_default() {
            if let Some(k) = names.iter().position(|of| of == name) {
                zero[k] = *value;
            }
        }
        Ok::<_, ()>(zero)
    };
    let ones = |names: &[String]| Ok(vec![1.0; names.len()]);
    let diagnostics = Diagnostics::new(options.lenient);
    assemble_contents(contents, options, &diagnostics, given, ones).ok()?.ok()?.assembled
}
