//! Gravity from none to that of a neutron star.

use sarrus_dynamics::Field;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled, numerical};
use crate::stress::harness::sweep;

/// Gravity from none to that of a neutron star; at rest without it no force at all is needed.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("gravity", "m/s²");
    let mut values = vec![0.0];
    values.extend(sweep(effort, -9, 12, 7));
    for name in ["lambda", "wrist", "rh5v2_upper_body"] {
        for (kind, make) in [("", (|of| of) as fn(_) -> _), (" numerical", numerical as fn(_) -> _)]
        {
            let mut plain = make(bundled(name)?);
            if name == "wrist" && !kind.is_empty() {
                continue;
            }
            for &value in &values {
                plain.gravity = [0.0, 0.0, -value];
                let robot = Robot::new(&format!("{name}{kind}"), plain.clone())?;
                let mut state = State::of(&robot, 0.2)?;
                cases.questions(
                    &robot,
                    value,
                    &state,
                    false,
                    &[robot.compiled.model.forward_method()],
                )?;
                // at rest
                state.yd.fill(0.0);
                state.ydd.fill(0.0);
                let at = At { value, method: robot.closures() };
                cases.ask(
                    &robot,
                    at,
                    "ID at rest",
                    &Question::inverse(&state, &[Field::TauY, Field::TauQ]),
                    &Reference::Same,
                )?;
            }
        }
    }
    Ok(())
}
