//! Idle freedoms, and mechanisms whose mobility differs from the declared one.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::SubmechanismKind as Kind;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{
    At, Cases, Question, Reference, Robot, State, Turn, X, Y, Z, cut, finish, joint, mechanism,
};
use crate::stress::mechanisms::{BASE, door};

use Field::{TauU, TauY};

/// A rod that can spin about its axis gives the answers of one that cannot; a mechanism whose
/// mobility differs from the declared one is refused.
pub(crate) fn run(cases: &mut Cases, _: &Effort) -> Outcome {
    let spinning = Robot::new("rod that may spin", door(true)?)?;
    let plain = Robot::new("rod", door(false)?)?;
    for value in [0.4, 0.2, -0.2, -0.4] {
        let state = State { y: vec![value], ..State::of(&plain, 0.2)? };
        let at = At { value, method: "numerical" };
        let inverse = Question::inverse(&state, &[TauY, TauU]);
        cases.ask(&spinning, at, "ID", &inverse, &Reference::Same)?;
        cases.ask(&spinning, at, "FD", &Question::forward(&state, None), &Reference::Same)?;
    }
    // a five-bar with one independent, a four-bar with two rows too many about skew axes, a loose
    // sleeve
    let five = {
        let mut of = mechanism(Kind::Numerical);
        let first = joint(&mut of, BASE, Turn, [0.0, 0.0, 0.0], Z);
        let second = joint(&mut of, first, Turn, [0.2, 0.9, 0.0], Z);
        let third = joint(&mut of, second, Turn, [0.8, 1.3, 0.0], Z);
        let other = joint(&mut of, BASE, Turn, [2.1, -0.1, 0.0], Z);
        cut(&mut of, third, other, [1.4, 1.0, 0.0], "xy");
        finish(of, &[first], &[first])?
    };
    let skew = {
        let mut of = mechanism(Kind::Numerical);
        let first = joint(&mut of, BASE, Turn, [0.0, 0.0, 0.0], X);
        let second = joint(&mut of, first, Turn, [0.2, 0.9, 0.3], Y);
        let third = joint(&mut of, second, Turn, [0.8, 1.3, -0.2], Z);
        let last = joint(&mut of, third, Turn, [1.0, 0.1, 0.4], [0.6, 0.0, 0.8]);
        cut(&mut of, BASE, last, [1.4, 1.0, 0.0], "xyzabc");
        finish(of, &[first], &[first])?
    };
    for (name, of, value) in
        [("five-bar of one independent", five, 2.0), ("closed chain without mobility", skew, -2.0)]
    {
        let at = At { value, method: "numerical" };
        if let Some(robot) = cases.load(name, at, of) {
            // loading should have refused it
            let state = State::of(&robot, 0.1)?;
            cases.ask(&robot, at, "ID", &Question::inverse(&state, &[TauY]), &Reference::None)?;
        }
    }
    Ok(())
}
