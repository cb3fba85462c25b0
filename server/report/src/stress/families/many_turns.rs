//! Angles of many turns.

use std::f64::consts::TAU;

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::{Field, Status};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled, numerical};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::{GRASHOF, RHOMBUS, four_bar, rods};

pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("many turns", "y, rad");
    let robots = [
        Robot::new("lambda", bundled("lambda")?)?,
        Robot::new("lambda", numerical(bundled("lambda")?))?,
        Robot::new("four-bar of a full turn", four_bar(GRASHOF, Kind::FourBar, "xy")?)?,
        Robot::new("four-bar of a full turn", four_bar(GRASHOF, Kind::Numerical, "xy")?)?,
        Robot::new("parallelogram", four_bar(RHOMBUS, Kind::ParallelogramChain, "xy")?)?,
        Robot::new("squeezer", bundled("squeezer")?)?,
        Robot::new("3 rods", rods(3)?)?,
    ];
    let mut values = sweep(effort, 0, 6, 3);
    values.extend([1e9, 1e13, 1e15, 1e18, 1e100]);
    for robot in &robots {
        for &value in &values {
            let mut state = State::of(robot, 0.2)?;
            state.y[0] += value;
            state.forces(robot)?;
            cases.questions(
                robot,
                value,
                &state,
                true,
                &[robot.compiled.model.forward_method()],
            )?;
            if robot.closures() == "no loops" || value > 1e9 {
                continue;
            }
            // the pose a little before, as many turns on
            let Some(guess) = wound(robot, state.y[0])? else { continue };
            state.guess = Some(guess);
            state.forces(robot)?;
            let method = format!("{} with guess", robot.closures());
            let at = At { value, method: &method };
            cases.ask(robot, at, "kinematics", &Question::kinematics(&state), &Reference::Same)?;
            cases.ask(robot, at, "FD", &Question::forward(&state, None), &Reference::Same)?;
        }
    }
    Ok(())
}

/// The pose shortly before y, each joint as many turns on as it makes while the crank makes those
/// of y; none where the crank has no full turn.
fn wound(robot: &Robot, y: f64) -> Outcome<Option<Vec<f64>>> {
    let turns = ((y - 0.01) / TAU).floor();
    let mut guess: Option<Vec<f64>> = None;
    let mut first: Vec<f64> = Vec::new();
    let mut last = Vec::new();
    let goal = y - 0.01 - turns * TAU;
    // to the goal, then once round, which gives the turn of each joint
    for k in 0..=160 {
        let at = if k <= 80 {
            goal * f64::from(k) / 80.0
        } else {
            goal + TAU * f64::from(k - 80) / 80.0
        };
        let answer =
            Question::pose(&State { y: vec![at], guess: guess.take(), ..State::default() })
                .run(&robot.compiled.model)?;
        if answer.status() != Status::Ok {
            return Ok(None);
        }
        let q = answer.get(Field::Q).to_vec();
        if k == 80 {
            first.clone_from(&q);
        }
        last.clone_from(&q);
        guess = Some(q);
    }
    Ok(Some(first.iter().zip(&last).map(|(first, last)| first + turns * (last - first)).collect()))
}
