//! Wrenches over many orders of magnitude.

use sarrus_dynamics::{Field, Method};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::harness::sweep;

/// A wrench on the last link, from a breath to the weight of a mountain.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("wrench", "N and N m on the last link");
    let mut values = sweep(effort, -6, 12, 6);
    values.extend([1e30, 1e200, 1e308]);
    for name in ["lambda", "stewart", "rh5v2_upper_body"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let link = robot.description.links.len() as u16 - 1;
        for &value in &values {
            let state = State::of(&robot, 0.2)?;
            let wrench = [0.3, -0.5, 0.7, 0.9, 0.4, -0.8].map(|x| x * value).to_vec();
            let at = At { value, method: robot.closures() };
            let want = [Field::TauY, Field::TauU, Field::Lambda];
            cases.ask(
                &robot,
                at,
                "ID",
                &Question::inverse(&state, &want).pushed(&[link], wrench.clone()),
                &Reference::Same,
            )?;
            for method in [Method::Recursion, Method::Projection] {
                let at = At { value, method: method.name() };
                cases.ask(
                    &robot,
                    at,
                    "FD",
                    &Question::forward(&state, Some(method)).pushed(&[link], wrench.clone()),
                    &Reference::Same,
                )?;
            }
        }
    }
    Ok(())
}
