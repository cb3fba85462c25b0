//! Guesses off their loops.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::{Field, Request};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled, numerical};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::{LOOSE, bricard, four_bar};

use Field::*;

/// Guesses off their loops: the answer is that of the guess on its loops.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("inconsistent start", "q_guess off its loops, rad or tenths of the length");
    let robots = [
        Robot::new("wrist", bundled("wrist")?)?,
        Robot::new("lambda", numerical(bundled("lambda")?))?,
        Robot::new("delta", bundled("delta")?)?,
        Robot::new("Bricard", bricard(false)?)?,
        Robot::new("welded four-bar", four_bar(LOOSE, Kind::Numerical, "xyzabc")?)?,
        Robot::new("upper body", bundled("rh5v2_upper_body")?)?,
    ];
    for robot in &robots {
        for value in sweep(effort, -15, -1, 4) {
            let mut state = State::of(robot, 0.2)?;
            let near = State { y: state.y.iter().map(|y| 0.95 * y).collect(), ..State::default() };
            let pose = Question::pose(&near).run(&robot.compiled.model)?.get(Q).to_vec();
            let units = robot.units(Q).unwrap_or_default();
            let off = |k: usize| {
                value * ((k as f64 * 2.4).sin()) / units[k]
                    * if units[k] == 1.0 { 1.0 } else { 0.1 }
            };
            let bad: Vec<f64> = pose.iter().enumerate().map(|(k, q)| q + off(k)).collect();
            let exact = Question::kinematics(&State { guess: Some(pose), ..state.clone() });
            state.guess = Some(bad.clone());
            let at = At { value, method: robot.closures() };
            cases.ask(
                robot,
                at,
                "kinematics",
                &Question::kinematics(&state),
                &Reference::Of(&exact),
            )?;
            // q itself off its loops: its independents are y, the rest the guess
            let names = robot.compiled.model.tree_q_names();
            let y = robot
                .compiled
                .model
                .independent_q_names()
                .iter()
                .filter_map(|name| names.iter().position(|x| x == name));
            let on =
                Question::pose(&State { y: y.map(|at| bad[at]).collect(), ..State::default() });
            cases.ask(
                robot,
                at,
                "q to q",
                &Question::new(Request::Kinematics, vec![(Field::Q, bad)], &[Q]),
                &Reference::Of(&on),
            )?;
        }
    }
    Ok(())
}
