//! Nearer and nearer to singular poses.

use sarrus_dynamics::{Field, Request};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::mechanisms::approach::{Approach, TYPE_II, followed, known, platform, searched};

/// Every robot at distances from 1 to 1e-15.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("distance to a singularity", "rad from the singular pose");
    let values: Vec<f64> =
        (0..=15).filter(|k| !effort.quick || k % 3 == 0).map(|k| 10f64.powi(-k)).collect();
    let mut approaches = known()?;
    approaches.extend(searched()?);
    approaches.push(platform()?);
    for approach in &approaches {
        for &value in &values {
            let mut state = State::of(&approach.robot, 0.1)?;
            state.y = approach.at(value);
            if approach.guessed {
                state.guess = followed(&approach.robot.compiled.model, &approach.at(value + 0.02))?;
            }
            state.forces(&approach.robot)?;
            cases.questions(
                &approach.robot,
                value,
                &state,
                true,
                &[approach.robot.compiled.model.forward_method()],
            )?;
            if approach.robot.name == TYPE_II {
                back_from_actuators(cases, approach, value, &state)?;
            }
        }
    }
    Ok(())
}

/// The pose from the actuators' positions, rounded to doubles as an encoder's are, and a guess near
/// by.
fn back_from_actuators(
    cases: &mut Cases,
    approach: &Approach,
    value: f64,
    state: &State,
) -> Outcome {
    let model = &approach.robot.compiled.model;
    let near = Question::pose(&State { y: approach.at(value + 1e-3), ..State::default() })
        .run(model)?
        .get(Field::Q)
        .to_vec();
    let u = Question::kinematics(state)
        .run(&approach.robot.compiled.exact)?
        .get(Field::U)
        .iter()
        .map(|u| u.hi())
        .collect();
    let ask =
        Question::new(Request::Kinematics, vec![(Field::U, u), (Field::QGuess, near)], &[Field::Q]);
    cases.ask(
        &approach.robot,
        At { value, method: approach.robot.closures() },
        "u to q",
        &ask,
        &Reference::Of(&Question::pose(state)),
    )?;
    Ok(())
}
