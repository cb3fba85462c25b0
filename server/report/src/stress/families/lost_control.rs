//! Poses where more actuators than independents lose control together: their forces are shared by
//! least norm, and roundings of G_u grow in them like in those of a single actuator.

use sarrus_dynamics::Field::{Lambda, TauU};
use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{
    At, Cases, Question, Reference, Robot, State, Turn, Z, cut, finish, joint, mechanism, powers,
};
use crate::stress::mechanisms::{BASE, LOOSE, angle_of_crank};

/// A crank that moves two rockers in a row, both actuated.
fn two_rockers() -> Outcome<Description> {
    let at = |[x, y]: [f64; 2]| [x, y, 0.0];
    let [a, b, c, d] = LOOSE.map(at);
    let mut of = mechanism(Kind::Numerical);
    let crank = joint(&mut of, BASE, Turn, a, Z);
    let coupler = joint(&mut of, crank, Turn, b, Z);
    let rocker = joint(&mut of, BASE, Turn, d, Z);
    cut(&mut of, coupler, rocker, c, "xy");
    let second = joint(&mut of, rocker, Turn, at([2.2, 0.7]), Z);
    let last = joint(&mut of, BASE, Turn, at([3.9, -0.1]), Z);
    cut(&mut of, second, last, at([3.3, 1.0]), "xy");
    finish(of, &[crank], &[rocker, last])
}

/// Angle of the crank at which it is in line with its coupler, so that the rockers turn back.
fn in_line() -> f64 {
    angle_of_crank(|crank, coupler, rocker| [crank + coupler, rocker])
}

/// Forces of the actuators at distances from the pose without control.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    let robot = Robot::new("two rockers", two_rockers()?)?;
    for value in powers(effort, -15, 0, 5) {
        for side in [-1.0, 1.0] {
            let mut state = State::of(&robot, 0.1)?;
            state.y = vec![in_line() + side * value.min(0.3)];
            let ask = Question::inverse(&state, &[TauU, Lambda]);
            cases.ask(&robot, At::of(&robot, value), "ID", &ask, &Reference::Same)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use sarrus_dynamics::Field::GU;
    use sarrus_dynamics::Status;

    use super::*;

    #[test]
    fn both_rockers_stand_still_where_the_crank_is_in_line() {
        let robot = Robot::new("two rockers", two_rockers().expect("bars")).expect("a model");
        let mut state = State::of(&robot, 0.1).expect("a state");
        state.y = vec![in_line()];
        let ask = Question::inverse(&state, &[GU]);
        let answer = ask.run(&robot.compiled.model).expect("a plan");
        assert_eq!(answer.status(), Status::Ok);
        assert!(answer.get(GU).iter().all(|x| x.abs() < 1e-12), "{:?}", answer.get(GU));
    }
}
