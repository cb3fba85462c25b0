//! Positions for tasks at the edge: targets just beyond the reach, at a singular pose, of one frame
//! twice, and bounds that leave nothing. An answer is judged by the way to its targets in
//! double-double, at its y: it is within 1e-9 where the status is ok, and as told otherwise.

use sarrus_dynamics::Field::{BoundsY, FramePose, TaskResidual, TaskTarget, Y};
use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{FieldSet, Planned, Query, Request, Status, TaskParts};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{
    At, Cases, HELD, Question, Robot, State, Turn, Z, bundled, finish, joint, mechanism, powers,
};
use crate::stress::mechanisms::BASE;

/// Places that one frame is asked to, bounds of y, and how near it comes at best.
struct Target {
    places: Vec<[f64; 3]>,
    bounds: Option<Vec<f64>>,
    least: f64,
    /// No pose keeps the bounds.
    is_empty: bool,
}

fn at(place: [f64; 3]) -> Target {
    Target { places: vec![place], bounds: None, least: 0.0, is_empty: false }
}

pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    let mut of = mechanism(Kind::Numerical);
    let first = joint(&mut of, BASE, Turn, [0.0; 3], Z);
    let second = joint(&mut of, first, Turn, [1.0, 0.0, 0.0], Z);
    let tip = joint(&mut of, second, Turn, [2.0, 0.0, 0.0], Z);
    let joints = [first, second, tip];
    let arm = Robot::new("two links", finish(of, &joints, &joints)?)?;
    for value in powers(effort, -13, 0, 3) {
        let beyond = [(2.0 + value) * 0.6, (2.0 + value) * 0.8, 0.0];
        one(cases, &arm, value, "beyond the reach", &Target { least: value, ..at(beyond) })?;
        let twice = vec![[1.2, 0.3, 0.0], [1.2, 0.3 + value, 0.0]];
        let twice = Target { places: twice, least: 0.5 * value, ..at([0.0; 3]) };
        one(cases, &arm, value, "a frame twice", &twice)?;
        let bounds = vec![0.1 + value, 0.1, -2.0, 2.0, -2.0, 2.0];
        let empty = Target { bounds: Some(bounds), is_empty: true, ..at([1.5, 0.0, 0.0]) };
        one(cases, &arm, value, "bounds without room", &empty)?;
        let near = |bend: f64| [1.0 + bend.cos(), bend.sin(), 0.0];
        one(cases, &arm, value, "a singular target", &at(near(value)))?;
    }
    for name in ["lambda", "wrist", "rh5v2_upper_body"] {
        let robot = Robot::new(name, bundled(name)?)?;
        for value in powers(effort, -9, 0, 2) {
            let state = State::of(&robot, 0.3 * value)?;
            let ask = posed(&robot, &state.y);
            let answer = ask.run(&robot.compiled.model)?;
            let [x, y, z, ..] = *answer.get(FramePose) else { continue };
            if answer.status() == Status::Ok {
                one(cases, &robot, value, "a pose near zero", &at([x, y, z]))?;
            }
        }
    }
    Ok(())
}

/// The last link's pose.
fn posed(robot: &Robot, y: &[f64]) -> Question {
    let ask = Question::new(Request::Kinematics, vec![(Y, y.to_vec())], &[FramePose]);
    Question { frames: vec![robot.compiled.model.link_names().len() as u16 - 1], ..ask }
}

fn one(cases: &mut Cases, robot: &Robot, value: f64, asked: &str, target: &Target) -> Outcome {
    let model = &robot.compiled.model;
    let link = model.link_names().len() as u16 - 1;
    let given = target.bounds.as_ref().map_or(FieldSet::EMPTY, |_| FieldSet::of(&[BoundsY]));
    let query = Query::new(Request::InverseKinematics, given, FieldSet::of(&[Y, TaskResidual]));
    let tasks = vec![(link, TaskParts::POSITION); target.places.len()];
    let mut planned = Planned::new(model, &query.with_tasks(&tasks))?;
    if let Some(bounds) = &target.bounds {
        planned.give(BoundsY, bounds);
    }
    let places = target.places.iter();
    let targets = places.flat_map(|place| [&place[..], &[0.0; 7], &[1.0]].concat());
    planned.give(TaskTarget, &targets.collect::<Vec<f64>>());
    let answer = planned.run(model);
    let has_numbers = matches!(answer.status, Status::Ok | Status::NotReached);
    let (error, is_honest) = if has_numbers {
        let pose = posed(robot, planned.get(Y)).run(&robot.compiled.exact)?;
        let pose: Vec<f64> = pose.get(FramePose).iter().map(|x| x.to_f64()).collect();
        let away = |place: &[f64; 3]| {
            let square = |k: usize| (pose[k] - place[k]).powi(2);
            (0..3).map(square).sum::<f64>().sqrt()
        };
        let ways: Vec<f64> = target.places.iter().map(away).collect();
        let residuals = planned.get(TaskResidual);
        let apart = ways.iter().zip(residuals).map(|(way, residual)| (way - residual).abs());
        let worst = ways.iter().copied().fold(0.0, f64::max);
        let is_told = apart.fold(0.0, f64::max) <= HELD;
        let error = if answer.status == Status::Ok { worst } else { worst - target.least };
        (error, is_told && !target.is_empty)
    } else {
        (0.0, planned.output.iter().all(|x| x.is_nan()))
    };
    // the nearest pose is no worse than the best there is: at a minimum of the squares a way is
    // exact to the root of the last gain
    let most = 1e-6 + 1e-5 * target.least;
    let is_sound = is_honest && (answer.status != Status::NotReached || error < most);
    // else it is one that fails silently
    let status = if is_sound { answer.status } else { Status::Ok };
    let error = (is_sound && has_numbers).then_some(error);
    let case = cases.ended(&robot.name, At::of(robot, value), asked, (status, error, is_sound));
    cases.all.push(case);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::Assessment;

    #[test]
    fn nothing_at_the_edge_is_silent() {
        let mut cases = Cases::default();
        run(&mut cases, &Effort { quick: true }).expect("cases");
        let silent = cases.all.iter().filter(|case| case.assessment == Assessment::FailedSilently);
        let silent: Vec<String> =
            silent.map(|case| format!("{} {} {}", case.robot, case.asked, case.value)).collect();
        assert!(silent.is_empty(), "{silent:?}");
        let of = |asked: &str, status: &str| {
            cases.all.iter().filter(|case| case.asked == asked && case.status == status).count()
        };
        assert!(of("beyond the reach", "not_reached") > 1 && of("beyond the reach", "ok") > 0);
        assert!(of("a frame twice", "not_reached") > 1 && of("a singular target", "ok") > 2);
        assert!(of("bounds without room", "infeasible") > 2);
    }
}
