//! Velocities from creeping to absurd.

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::Cases;
use crate::stress::harness::question::State;
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::bricard;

/// Velocities from creeping to absurd; none whose square overflows has an answer.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("velocity", "ẏ, rad/s");
    let mut values = sweep(effort, -6, 4, 5);
    values.extend([1e-160, 1e8, 1e100, 1e160, 1e300]);
    for name in ["lambda", "wrist", "stewart", "bricard", "rh5v2_upper_body"] {
        let robot = if name == "bricard" {
            Robot::new(name, bricard(false)?)?
        } else {
            Robot::new(name, bundled(name)?)?
        };
        for &value in &values {
            let mut state = State::of(&robot, 0.2)?;
            state.yd.iter_mut().for_each(|x| *x *= value);
            state.forces(&robot)?;
            cases.questions(
                &robot,
                value,
                &state,
                true,
                &[robot.compiled.model.forward_method()],
            )?;
        }
    }
    Ok(())
}
