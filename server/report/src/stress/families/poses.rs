//! Families whose parameter is the distance of a pose or a guess from a closed one.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::{Field, Request};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{At, Cases, Question, Reference, Robot, State, offsets, powers};
use crate::stress::mechanisms::approach::{Approach, TYPE_II, followed, known, platform, searched};
use crate::stress::mechanisms::{GRASHOF, LOOSE, bricard};
use crate::stress::sweep::{Design, Subject, Sweep};

use Design::{Bundled, FourBar, Made, Numerical};
use Field::{Q, QGuess, U};

/// Every robot at distances from 1 to 1e-15 of its singular pose.
pub(crate) fn singular_poses(cases: &mut Cases, effort: &Effort) -> Outcome {
    let step = if effort.quick { 3 } else { 1 };
    let values: Vec<f64> = (0..=15).step_by(step).map(|k| 10f64.powi(-k)).collect();
    let mut approaches = known()?;
    approaches.extend(searched()?);
    approaches.push(platform()?);
    for approach in &approaches {
        let robot = &approach.robot;
        for &value in &values {
            let mut state = State::of(robot, 0.1)?;
            state.y = approach.at(value);
            if approach.guessed {
                state.guess = followed(&robot.compiled.model, &approach.at(value + 0.02))?;
            }
            state.forces(robot)?;
            cases.questions(robot, value, &state, true, &robot.own_method())?;
            if robot.name == TYPE_II {
                back_from_actuators(cases, approach, value, &state)?;
            }
        }
    }
    Ok(())
}

/// The pose from the actuators' positions, rounded to doubles as an encoder's are, and a nearby
/// guess.
fn back_from_actuators(
    cases: &mut Cases,
    approach: &Approach,
    value: f64,
    state: &State,
) -> Outcome {
    let Approach { robot, .. } = approach;
    let near = State { y: approach.at(value + 1e-3), ..State::default() };
    let near = Question::pose(&near).run(&robot.compiled.model)?;
    let exact = Question::kinematics(state).run(&robot.compiled.exact)?;
    let u = exact.get(U).iter().map(|u| u.hi()).collect();
    let given = vec![(U, u), (QGuess, near.get(Q).to_vec())];
    let question = Question::new(Request::Kinematics, given, &[Q]);
    let reference = Question::pose(state);
    cases.ask(robot, At::of(robot, value), "u to q", &question, &Reference::Of(&reference))?;
    Ok(())
}

/// Targets beyond the reach, which must have no answer.
pub(crate) fn unreachable_targets(cases: &mut Cases, effort: &Effort) -> Outcome {
    for approach in known()?.iter().take(5) {
        let robot = &approach.robot;
        // closer than the rounding of lengths and y no target is beyond; the lambda can be put
        // together again more than 0.59 beyond
        for value in powers(effort, -13, 0, 5).into_iter().map(|value| 0.5 * value) {
            let state = State { y: approach.at(-value), ..State::of(robot, 0.1)? };
            let at = At::of(robot, value);
            cases.ask(robot, at, "kinematics", &Question::kinematics(&state), &Reference::None)?;
            cases.ask(robot, at, "FD", &Question::forward(&state, None), &Reference::None)?;
        }
    }
    Ok(())
}

/// Far targets in one jump from zero; the reference is the pose at the end of the same way in small
/// steps.
pub(crate) const BIG_JUMPS: Sweep = Sweep {
    values: |effort| {
        if effort.quick {
            vec![0.1, 0.5, 1.0, 2.0, 3.0]
        } else {
            vec![0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.4, 2.7, 3.0]
        }
    },
    robots: &[
        Subject::plain("wrist", Bundled("wrist")),
        Subject::plain("delta", Bundled("delta")),
        Subject::plain("squeezer", Bundled("squeezer")),
        Subject::plain("four-bar of a full turn", FourBar(GRASHOF, Kind::Numerical, "xy")),
        Subject::plain("lambda numerical", Numerical("lambda")),
        Subject::plain("Stewart numerical", Numerical("stewart")),
        Subject::plain("Bricard", Made(|| bricard(false))),
    ],
    ask: |cases, robot, value| {
        let direction = State::of(robot, 1.0)?.y;
        let size = direction.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let y: Vec<f64> = direction.iter().map(|x| value * x / size).collect();
        let reference = match followed(&robot.compiled.exact, &y)? {
            Some(q) => Reference::Known(vec![(Q, q)]),
            None => Reference::None,
        };
        let question = Question::pose(&State { y, ..State::default() });
        cases.ask(robot, At::of(robot, value), "pose", &question, &reference)?;
        Ok(())
    },
};

/// Guesses off their loops: the answer is that of the guess on its loops.
pub(crate) const INCONSISTENT_STARTS: Sweep = Sweep {
    values: |effort| powers(effort, -15, -1, 4),
    robots: &[
        Subject::plain("wrist", Bundled("wrist")),
        Subject::plain("lambda", Numerical("lambda")),
        Subject::plain("delta", Bundled("delta")),
        Subject::plain("Bricard", Made(|| bricard(false))),
        Subject::plain("welded four-bar", FourBar(LOOSE, Kind::Numerical, "xyzabc")),
        Subject::plain("upper body", Bundled("rh5v2_upper_body")),
    ],
    ask: from_inconsistent,
};

fn from_inconsistent(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    let mut state = State::of(robot, 0.2)?;
    let near = State { y: state.y.iter().map(|y| 0.95 * y).collect(), ..State::default() };
    let pose = Question::pose(&near).run(&robot.compiled.model)?.get(Q).to_vec();
    let bad: Vec<f64> = pose.iter().zip(offsets(robot, value, 0)).map(|(q, off)| q + off).collect();
    let exact = Question::kinematics(&State { guess: Some(pose), ..state.clone() });
    state.guess = Some(bad.clone());
    let at = At::of(robot, value);
    let question = Question::kinematics(&state);
    cases.ask(robot, at, "kinematics", &question, &Reference::Of(&exact))?;
    // q itself off its loops: its independents are y, the rest the guess
    let on = Question::pose(&State { y: robot.independents(&bad), ..State::default() });
    let question = Question::new(Request::Kinematics, vec![(Q, bad)], &[Q]);
    cases.ask(robot, at, "q to q", &question, &Reference::Of(&on))?;
    Ok(())
}
