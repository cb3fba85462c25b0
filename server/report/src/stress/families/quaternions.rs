//! Quaternions off unit length.

use sarrus_dynamics::Field;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::harness::sweep;

use Field::*;

/// Quaternions slightly, and then badly, off unit length.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("quaternion off unit length", "|length − 1|");
    let robot = Robot::new("floating Stewart", bundled("stewart_floating")?)?;
    let at = robot
        .compiled
        .model
        .independent_q_names()
        .iter()
        .position(|name| name.ends_with("/qx"))
        .ok_or("no quaternion")?;
    for value in sweep(effort, -16, 2, 9) {
        for (method, sign) in [("longer", 1.0), ("shorter", -1.0)] {
            let mut state = State::of(&robot, 0.1)?;
            let exact = state.clone();
            let length: f64 = 1.0 + sign * value;
            state.y[at..at + 4].iter_mut().for_each(|x| *x *= length);
            // beyond the tolerance there is no answer; within it the answer is that of the unit
            // quaternion
            let place = At { value, method };
            let reference = Question::inverse(&exact, &[TauY, TauU]);
            let reference = if value > 1e-6 { Reference::None } else { Reference::Of(&reference) };
            cases.ask(
                &robot,
                place,
                "ID",
                &Question::inverse(&state, &[TauY, TauU]),
                &reference,
            )?;
        }
    }
    Ok(())
}
