//! Targets beyond the reach.

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::approach::known;

/// Targets beyond the reach: there is no answer, and none may be given.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("unreachable y", "rad beyond the reach");
    for approach in known()?.iter().take(5) {
        // nearer than the rounding of lengths and y there is no beyond; the lambda can be put
        // together again more than 0.59 beyond
        for value in sweep(effort, -13, 0, 5).into_iter().map(|value| 0.5 * value) {
            let mut state = State::of(&approach.robot, 0.1)?;
            state.y = approach.at(-value);
            let at = At { value, method: approach.robot.closures() };
            cases.ask(
                &approach.robot,
                at,
                "kinematics",
                &Question::kinematics(&state),
                &Reference::None,
            )?;
            cases.ask(
                &approach.robot,
                at,
                "FD",
                &Question::forward(&state, None),
                &Reference::None,
            )?;
        }
    }
    Ok(())
}
