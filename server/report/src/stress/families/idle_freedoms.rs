//! Idle freedoms, and mechanisms of other mobility than declared.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::SubmechanismKind as Kind;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Draft, Robot, Turn, X, Y, Z};
use crate::stress::mechanisms::door;

use Field::{TauU, TauY};

/// A rod that may spin about itself answers as the one that may not; a mechanism of other mobility
/// than declared is refused.
pub(crate) fn run(cases: &mut Cases, _: &Effort) -> Outcome {
    cases.family("idle freedoms", "y, rad");
    let (spinning, plain) =
        (Robot::new("rod that may spin", door(true))?, Robot::new("rod", door(false))?);
    for value in [0.4, 0.2, -0.2, -0.4] {
        let state = State { y: vec![value], ..State::of(&plain, 0.2)? };
        let ask = Question::inverse(&state, &[TauY, TauU]);
        cases.ask(&spinning, At { value, method: "numerical" }, "ID", &ask, &Reference::Same)?;
        let forward = Question::forward(&state, None);
        cases.ask(
            &spinning,
            At { value, method: "numerical" },
            "FD",
            &forward,
            &Reference::Same,
        )?;
    }
    // a five-bar with one independent, a four-bar with two rows too many about skew axes, a loose
    // sleeve
    let five = {
        let mut of = Draft::new(Kind::Numerical);
        let mut link = 0;
        for at in [[0.0, 0.0, 0.0], [0.2, 0.9, 0.0], [0.8, 1.3, 0.0]] {
            link = of.joint(link, Turn, at, Z);
        }
        let other = of.joint(0, Turn, [2.1, -0.1, 0.0], Z);
        of.cut(link, other, [1.4, 1.0, 0.0], "xy");
        of.finish(&[0], &[0])
    };
    let skew = {
        let mut of = Draft::new(Kind::Numerical);
        let mut link = 0;
        for (at, axis) in [
            ([0.0, 0.0, 0.0], X),
            ([0.2, 0.9, 0.3], Y),
            ([0.8, 1.3, -0.2], Z),
            ([1.0, 0.1, 0.4], [0.6, 0.0, 0.8]),
        ] {
            link = of.joint(link, Turn, at, axis);
        }
        of.cut(0, link, [1.4, 1.0, 0.0], "xyzabc");
        of.finish(&[0], &[0])
    };
    for (name, of, value) in
        [("five-bar of one independent", five, 2.0), ("closed chain without mobility", skew, -2.0)]
    {
        let at = At { value, method: "numerical" };
        if let Some(robot) = cases.load(name, at, Robot::new(name, of)) {
            // it should not have been taken
            let state = State::of(&robot, 0.1)?;
            cases.ask(&robot, at, "ID", &Question::inverse(&state, &[TauY]), &Reference::None)?;
        }
    }
    Ok(())
}
