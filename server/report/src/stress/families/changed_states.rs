//! Families whose parameter changes the motion or the forces of a robot: its velocity, a wrench,
//! the turns of its crank, the length of its quaternion.

use std::f64::consts::TAU;

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::{Field, Method};

use crate::Outcome;
use crate::stress::harness::{At, Cases, Question, Reference, Robot, State, powers, with};
use crate::stress::mechanisms::approach::posed;
use crate::stress::mechanisms::{GRASHOF, RHOMBUS, bricard};
use crate::stress::sweep::{Design, Subject, Sweep};

use Design::{Bundled, FourBar, Made, Numerical, Rods};
use Field::{Lambda, TauU, TauY};

/// Velocities from creeping to absurd; one whose square overflows has no answer.
pub(crate) const VELOCITIES: Sweep = Sweep {
    values: |effort| with(&powers(effort, -6, 4, 5), &[1e-160, 1e8, 1e100, 1e160, 1e300]),
    robots: &[
        Subject::plain("lambda", Bundled("lambda")),
        Subject::plain("wrist", Bundled("wrist")),
        Subject::plain("stewart", Bundled("stewart")),
        Subject::plain("bricard", Made(|| bricard(false))),
        Subject::plain("rh5v2_upper_body", Bundled("rh5v2_upper_body")),
    ],
    ask: |cases, robot, value| {
        let mut state = State::of(robot, 0.2)?;
        state.yd.iter_mut().for_each(|x| *x *= value);
        state.forces(robot)?;
        cases.questions(robot, value, &state, true, &robot.own_method())
    },
};

/// A wrench on the last link, from a breath to the weight of a mountain.
pub(crate) const WRENCHES: Sweep = Sweep {
    values: |effort| with(&powers(effort, -6, 12, 6), &[1e30, 1e200, 1e308]),
    robots: &[
        Subject::plain("lambda", Bundled("lambda")),
        Subject::plain("stewart", Bundled("stewart")),
        Subject::plain("rh5v2_upper_body", Bundled("rh5v2_upper_body")),
    ],
    ask: wrench,
};

fn wrench(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    let link = [robot.description.links.len() as u16 - 1];
    let wrench = [0.3, -0.5, 0.7, 0.9, 0.4, -0.8].map(|x| x * value);
    let state = State::of(robot, 0.2)?;
    let question = Question::inverse(&state, &[TauY, TauU, Lambda]).pushed(&link, wrench.to_vec());
    cases.ask(robot, At::of(robot, value), "ID", &question, &Reference::Same)?;
    for method in [Method::Recursion, Method::Projection] {
        let question = Question::forward(&state, Some(method)).pushed(&link, wrench.to_vec());
        let at = At { value, method: method.name() };
        cases.ask(robot, at, "FD", &question, &Reference::Same)?;
    }
    Ok(())
}

/// Quaternions slightly, and then badly, off unit length.
pub(crate) const QUATERNIONS: Sweep = Sweep {
    values: |effort| powers(effort, -16, 2, 9),
    robots: &[Subject::plain("floating Stewart", Bundled("stewart_floating"))],
    ask: quaternion,
};

/// Within the tolerance the unit quaternion's answer is expected, beyond it none.
fn quaternion(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    let names = robot.compiled.model.independent_q_names();
    let first = names.iter().position(|name| name.ends_with("/qx")).ok_or("no quaternion")?;
    let exact = State::of(robot, 0.1)?;
    let of_unit = Question::inverse(&exact, &[TauY, TauU]);
    for (method, sign) in [("longer", 1.0), ("shorter", -1.0)] {
        let mut state = exact.clone();
        state.y[first..first + 4].iter_mut().for_each(|x| *x *= 1.0 + sign * value);
        let question = Question::inverse(&state, &[TauY, TauU]);
        let reference = if value > 1e-6 { Reference::None } else { Reference::Of(&of_unit) };
        cases.ask(robot, At { value, method }, "ID", &question, &reference)?;
    }
    Ok(())
}

/// Angles of many turns.
pub(crate) const MANY_TURNS: Sweep = Sweep {
    values: |effort| with(&powers(effort, 0, 6, 3), &[1e9, 1e13, 1e15, 1e18, 1e100]),
    robots: &[
        Subject::plain("lambda", Bundled("lambda")),
        Subject::plain("lambda", Numerical("lambda")),
        Subject::plain("four-bar of a full turn", FourBar(GRASHOF, Kind::FourBar, "xy")),
        Subject::plain("four-bar of a full turn", FourBar(GRASHOF, Kind::Numerical, "xy")),
        Subject::plain("parallelogram", FourBar(RHOMBUS, Kind::ParallelogramChain, "xy")),
        Subject::plain("squeezer", Bundled("squeezer")),
        Subject::plain("3 rods", Rods(3)),
    ],
    ask: turned,
};

fn turned(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    let mut state = State::of(robot, 0.2)?;
    state.y[0] += value;
    state.forces(robot)?;
    cases.questions(robot, value, &state, true, &robot.own_method())?;
    if robot.closures() == "no loops" || value > 1e9 {
        return Ok(());
    }
    // the preceding pose, with the same turns
    let Some(guess) = wound(robot, state.y[0])? else { return Ok(()) };
    state.guess = Some(guess);
    state.forces(robot)?;
    let method = format!("{} with guess", robot.closures());
    let at = At { value, method: &method };
    cases.ask(robot, at, "kinematics", &Question::kinematics(&state), &Reference::Same)?;
    cases.ask(robot, at, "FD", &Question::forward(&state, None), &Reference::Same)?;
    Ok(())
}

/// The pose shortly before y, with the full turns that each joint makes during those of the crank;
/// none if the crank has no full turn.
fn wound(robot: &Robot, y: f64) -> Outcome<Option<Vec<f64>>> {
    let turns = ((y - 0.01) / TAU).floor();
    let goal = y - 0.01 - turns * TAU;
    let mut first: Vec<f64> = Vec::new();
    let mut q = None;
    // to the goal, then one full turn, which gives the turns of each joint
    for k in 0..=160 {
        let at = if k <= 80 {
            goal * f64::from(k) / 80.0
        } else {
            goal + TAU * f64::from(k - 80) / 80.0
        };
        q = posed(&robot.compiled.model, vec![at], q)?;
        let Some(q) = &q else { break };
        if k == 80 {
            first.clone_from(q);
        }
    }
    let wound = |(first, last): (&f64, f64)| first + turns * (last - first);
    Ok(q.map(|last| first.iter().zip(last).map(wound).collect()))
}
