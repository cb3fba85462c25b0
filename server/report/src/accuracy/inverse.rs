//! Inverse kinematics: error over time of searches for the pose of one link.

use std::time::Instant;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Compiled, Field, Planned, Query, Status, TaskParts, Warnings};
use sarrus_models::{Loaded, Target, export};
use serde_json::json;

use super::title;
use crate::Outcome;
use crate::measure::timing::Samples;
use crate::page::{Axis, Figure, Point, Series};
use crate::peer::{Peer, searches};
use crate::robots::random::Random;
use crate::robots::{Question, Subject, links_by_bodies, within_limits};

/// Robots that can be asked for all six numbers of a pose.
const ROBOTS: [&str; 3] = ["stewart", "rh5v2_upper_body", "rh5v2_full"];
/// Error of a target that is found `[m, rad]`.
const FOUND: f64 = 1e-6;
/// The share of the room between limits for targets.
const SHARE: f64 = 0.8;
/// The place of y at the start: 0.5 is the middle between its limits.
const START: f64 = 0.55;
/// Drawn states of which one must be a target.
const TRIES: usize = 100;

/// The figure of a robot with `n` targets, at which the peers stop at these errors; none for a
/// robot that is not asked.
pub(super) fn figure(subject: Subject, n: usize, stops: &[f64]) -> Outcome<Option<Figure>> {
    let Some(loaded) = asked(subject)? else { return Ok(None) };
    let Compiled { model, exact, .. } = &loaded.compiled;
    let Some((_, link, look)) = links_by_bodies(model)?.pop() else { return Ok(None) };
    let hand = &model.link_names()[link];

    let mut looking = Planned::new(model, &look)?;
    let mut random = Random(36);
    let mut targets: Vec<Vec<f64>> = Vec::new();
    for _ in 0..TRIES * n {
        looking.input = within_limits(model, || 0.5 + 0.5 * SHARE * random.next());
        let answer = looking.run(model);
        if answer.status == Status::Ok && !answer.warnings.contains(Warnings::LIMITS_EXCEEDED) {
            targets.push(looking.get(Field::FramePose).to_vec());
        }
        if targets.len() == n {
            break;
        }
    }
    let mut start = Planned::new(model, &Query { want: Field::Q.into(), ..look })?;
    start.input = within_limits(model, || START);
    if targets.len() < n || start.run(model).status != Status::Ok {
        return Ok(None);
    }

    let parts = TaskParts::POSITION.with(TaskParts::ORIENTATION);
    let search = Question::InverseKinematics.query().with_tasks(&[(link as u16, parts)]);
    let mut search = Planned::new(model, &search)?;
    search.give(Field::YGuess, &start.input);
    let mut looking_exactly = Planned::new(exact, &look)?;
    let mut ns = Vec::new();
    let mut errors = Vec::new();
    for target in &targets {
        search.give(Field::TaskTarget, &[target, &[0.0, 0.0, 1.0, 1.0][..]].concat());
        // the second search has its numbers in the caches
        let _ = search.run(model);
        let begin = Instant::now();
        let answer = search.run(model);
        ns.push(begin.elapsed().as_nanos() as f64);
        looking_exactly.input = search.output.iter().map(|y| Dd::from(*y)).collect();
        let is_found =
            answer.status == Status::Ok && looking_exactly.run(exact).status == Status::Ok;
        let error = is_found.then(|| away(looking_exactly.get(Field::FramePose), target));
        errors.push(error.unwrap_or(f64::NAN));
    }
    let mut series = Vec::new();
    let mut add = |name: String, stop: String, ns: f64, errors: Vec<f64>| {
        let found = errors.iter().filter(|error| **error <= FOUND).count();
        let label = format!("{stop}, {found} of {n} found");
        let point = Point { x: ns, y: Samples::new(errors).median(), label };
        let of = Series::add(&mut series, name, point);
        of.competes = true;
        of.line = of.points.len() > 1;
    };
    add("sarrus".into(), "stops at 1e-9".into(), Samples::new(ns).median(), errors);
    let mut caption = format!(
        "Joint positions that bring {hand} to a target: {n} poses of random states within its \
        limits, each searched from their middle. Medians over all searches; a target is found \
        within {FOUND:.0e}. The error is the distance from the target or the widest gap of a \
        loop, whichever is larger [m, rad]. Peers take at most 100 steps, stop at the given error, \
        and are called from Python."
    );
    match of_peers(loaded, hand, start.get(Field::Q), &targets, stops)? {
        Peer::Missing(why) => caption += &format!(" {why}"),
        Peer::Measured { runs, .. } => {
            for run in runs {
                add(run.name, run.setting, run.ns, run.answers.concat());
            }
        }
    }
    Ok(Some(Figure {
        id: format!("accuracy-{}-ik", subject.name()),
        title: format!("{}: inverse kinematics", title(subject)),
        caption,
        x: Axis::log("time of a search in ns"),
        y: Axis::log("error in m, rad"),
        series,
    }))
}

/// A robot that is asked, loaded.
fn asked(subject: Subject) -> Outcome<Option<&'static Loaded>> {
    let is_asked = matches!(subject, Subject::Own(_)) || ROBOTS.contains(&subject.name());
    if is_asked { subject.loaded() } else { Ok(None) }
}

/// Searches of the peers from q to the targets.
fn of_peers(
    loaded: &Loaded,
    hand: &str,
    q: &[f64],
    targets: &[Vec<f64>],
    stops: &[f64],
) -> Outcome<Peer> {
    let names = loaded.compiled.model.tree_names();
    if names.len() != q.len() {
        return Ok(Peer::Missing("Peers: not run, a joint has several freedoms.".into()));
    }
    let mut files = serde_json::Map::new();
    for target in [Target::Mjcf, Target::Pinocchio] {
        let exported = match export(loaded, target, "robot", true) {
            Ok(exported) => exported,
            Err(error) => return Ok(Peer::Missing(format!("Peers: not run, {error}."))),
        };
        let named = exported.files.into_iter();
        files.extend(named.map(|(ending, text)| (format!("robot{ending}"), text.into())));
    }
    let start: serde_json::Map<_, _> =
        names.iter().zip(q).map(|(name, q)| (name.clone(), json!(q))).collect();
    let asked = json!({
        "files": files, "hands": [hand], "start": start, "stops": stops,
        "targets": targets.iter().map(|pose| [pose]).collect::<Vec<_>>(),
    });
    searches(&asked.to_string(), targets.len())
}

/// The larger of the distance and the angle between two poses, as x y z and quaternion x y z w.
fn away(pose: &[Dd], target: &[f64]) -> f64 {
    let place = |p: &[f64]| Vector3::new(p[0], p[1], p[2]);
    let turn = |p: &[f64]| UnitQuaternion::from_quaternion(Quaternion::new(p[6], p[3], p[4], p[5]));
    let pose: Vec<f64> = pose.iter().map(|x| x.to_f64()).collect();
    let angle = turn(&pose).angle_to(&turn(target));
    (place(&pose) - place(target)).norm().max(angle)
}
