//! Lengths and masses over many orders of magnitude.

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::State;
use crate::stress::harness::robot::{Robot, bundled, scaled};
use crate::stress::harness::sweep;

/// Robots that are made larger and heavier.
const ROBOTS: [&str; 6] =
    ["lambda", "wrist", "stewart", "four_bars_2", "torso", "rh5v2_upper_body"];

fn some(effort: &Effort) -> &'static [&'static str] {
    if effort.quick { &ROBOTS[..4] } else { &ROBOTS }
}

/// All lengths, then all masses, from a millionth to a million times.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    for (family, lengths) in [("length scale", true), ("mass scale", false)] {
        cases
            .family(family, if lengths { "factor of all lengths" } else { "factor of all masses" });
        for name in some(effort) {
            let plain = bundled(name)?;
            for value in sweep(effort, -6, 6, 4) {
                let of = if lengths {
                    scaled(plain.clone(), value, 1.0)
                } else {
                    scaled(plain.clone(), 1.0, value)
                };
                if let Some(robot) =
                    cases.load(name, At { value, method: "-" }, Robot::new(name, of))
                {
                    cases.questions(
                        &robot,
                        value,
                        &State::of(&robot, 0.2)?,
                        true,
                        &[robot.compiled.model.forward_method()],
                    )?;
                }
            }
        }
    }
    Ok(())
}
