//! `check --assemble`: a closed pose of a robot, or of files whose loops are open at zero.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{AssembleError, closing_placements, rezeroed};

use crate::assembly_report::{AssemblyReport, NewPlacements};
use crate::check::CheckReport;
use crate::contents::Contents;
use crate::error::{LoadError, Outcome};
use crate::load::{Options, load_contents};
use crate::open::open_contents;
use crate::report::Diagnostics;
use crate::rewrite::NewZero;

/// Residual up to which a loop is closed at zero, as in the compiler.
const OPEN: f64 = 1e-6;
/// Scaled distance to singularity below which a zero pose is a dead point, as in the compiler.
const DEAD_POINT: f64 = 1e-9;

/// As [`crate::assemble`], of contents.
pub(crate) fn assemble_contents<E>(
    contents: &Contents,
    options: &Options,
    diagnostics: &Diagnostics,
    near: impl FnOnce(&[String], Vec<f64>) -> Result<Vec<f64>, E>,
    weights: impl FnOnce(&[String]) -> Result<Vec<f64>, E>,
) -> Outcome<Result<CheckReport, E>> {
    let given = |coordinates: &[String], zero: Vec<f64>, velocities: &[String]| {
        let near = near(coordinates, zero)?;
        Ok((near, weights(velocities)?))
    };
    let loaded = load_contents(Some(contents.clone()), options, diagnostics.clone());
    let mut report = CheckReport::new(&loaded)?;
    let Err(LoadError::Faults(_)) = loaded else {
        let Ok(loaded) = loaded else { return Ok(Ok(report)) };
        let model = &loaded.compiled.model;
        let given = given(model.tree_q_names(), model.tree_zero(), model.tree_names());
        let Ok((near, weights)) = given else { return Ok(given.map(|_| report)) };
        let found = model.assemble(&near, &weights);
        let pose = found.as_ref().ok().map(|found| found.q.clone());
        let mut assembled = AssemblyReport::new(model.tree_q_names(), &near, found);
        assembled.zero = pose.and_then(|q| new_zero(&loaded.description, &q));
        // a dead point needs another zero pose first
        let is_dead = model.closures_at_zero().iter().any(|closure| closure.sigma_min < DEAD_POINT);
        if let (true, Some(zero)) = (is_dead, &assembled.zero) {
            assembled.new_zero = changes(zero);
        }
        report.assembled = Some(assembled);
        return Ok(Ok(report));
    };

    // open loops at zero may be the only fault of the files
    let Ok(opened) = open_contents(Some(contents.clone()), options, diagnostics.clone()) else {
        return Ok(Ok(report));
    };
    let model = &opened.model;
    let given = given(model.tree_q_names(), model.tree_zero(), model.tree_names());
    let Ok((near, weights)) = given else { return Ok(given.map(|_| report)) };
    let residual_at = |pose: &[f64]| match model.assemble(pose, &vec![f64::INFINITY; weights.len()])
    {
        Ok(found) => found.residual,
        Err(AssembleError::Unreachable { residual, .. }) => residual,
        Err(_) => f64::NAN,
    };
    let is_open = residual_at(&model.tree_zero()) > OPEN;
    let found = model.assemble(&near, &weights);
    let zero = found.as_ref().ok().and_then(|found| new_zero(&opened.description, &found.q));
    let mut assembled = AssemblyReport::new(model.tree_q_names(), &near, found);
    if let Some(zero) = zero {
        let closed = CheckReport::new(&opened.compile(zero.new.clone()))?;
        // if the new zero pose is no better, its faults are not those of the files
        if is_open || closed.errors.is_empty() {
            let as_it_is = report;
            // a fingerprint would be that of other files
            report = CheckReport { fingerprint: None, ..closed };
            assembled.new_zero = changes(&zero);
            if report.errors.is_empty() {
                report.warnings = [as_it_is.errors, report.warnings].concat();
                assembled.zero = Some(zero);
            }
        }
        if is_open {
            let name = |(s, l, placement)| (loop_name(&opened.description, s, l), placement);
            assembled.at_zero.successors =
                closing_placements(&opened.description).into_iter().map(name).collect();
        }
    }
    report.assembled = Some(assembled);
    Ok(Ok(report))
}

/// The robot with a pose as its zero pose, if the pose differs.
fn new_zero(description: &Description, q: &[f64]) -> Option<Box<NewZero>> {
    let new = rezeroed(description, q)?;
    Some(Box::new(NewZero { old: description.clone(), new }))
}

/// The placements of the new zero pose that differ from those of the old one.
fn changes(zero: &NewZero) -> NewPlacements {
    let mut found = NewPlacements::default();
    for (old, new) in zero.old.joints.iter().zip(&zero.new.joints) {
        if old.origin != new.origin {
            found.origins.push((new.name.clone(), new.origin));
        }
    }
    for (s, l, predecessor, successor) in zero.cuts(0) {
        let name = loop_name(&zero.new, s, l);
        found.predecessors.push((name.clone(), predecessor));
        found.successors.push((name, successor));
    }
    found
}

fn loop_name(description: &Description, s: usize, l: usize) -> String {
    let of = description.submechanisms.get(s);
    let cut = of.and_then(|of| of.loops.get(l));
    format!("{}/{}", of.map_or("", |of| &of.name), cut.map_or("", |cut| &cut.name))
}
