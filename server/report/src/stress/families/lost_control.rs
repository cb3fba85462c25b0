//! Poses where actuators lose control: forces that several share by least norm, where roundings of
//! G_u grow like in those of a single one, and the capability of limited actuators, sets of forces
//! and velocities, margins, clips, rotors and gains. Sets are compared by how far they reach, as
//! vertices that meet may be one or two.

use sarrus_dynamics::Field::{
    Clip, GainsU, GainsY, Lambda, Margin, ReflectedInertia, SpeedVertices, TauU, TauY,
    TorqueVertices, Y, Yd,
};
use sarrus_dynamics::description::{Description, Limits, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Request, Status};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{
    At, Cases, Question, Reference, Robot, State, Turn, Z, cut, finish, joint, mechanism, powers,
};
use crate::stress::mechanisms::approach::{known, platform};
use crate::stress::mechanisms::{BASE, LOOSE, angle_of_crank};

/// Largest force of each actuator, the usual size of a number, and the part of that which is as
/// good as nothing: differences count as parts of it.
const FORCE: f64 = 10.0;
const NOTHING: f64 = 1e-3;
/// Directions in which sets are compared.
const DIRECTIONS: usize = 16;

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

/// Robots at distances from the pose without control.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    let rockers = Robot::new("two rockers", two_rockers()?)?;
    let limited_rockers = limited(&rockers)?;
    for value in powers(effort, -15, 0, 5) {
        for side in [-1.0, 1.0] {
            let mut state = State::of(&rockers, 0.1)?;
            state.y = vec![in_line() + side * value.min(0.3)];
            let ask = Question::inverse(&state, &[TauU, Lambda]);
            cases.ask(&rockers, At::of(&rockers, value), "ID", &ask, &Reference::Same)?;
            of_motors(cases, &limited_rockers, value, state.y)?;
        }
    }
    for approach in known()?.into_iter().chain([platform()?]) {
        let robot = limited(&approach.robot)?;
        for value in powers(effort, -15, 0, 5) {
            of_motors(cases, &robot, value, approach.at(value))?;
        }
    }
    Ok(())
}

/// The robot with limits and rotors of its actuators.
fn limited(robot: &Robot) -> Outcome<Robot> {
    let mut of = robot.description.clone();
    let names = robot.compiled.model.active_names();
    for joint in of.joints.iter_mut().filter(|joint| names.contains(&joint.name)) {
        joint.limits = Some(Limits { velocity: 2.0, effort: FORCE, ..Limits::NONE });
        joint.terms.rotor_inertia = 0.01;
    }
    Robot::new(&robot.name, of)
}

/// The capability of the actuators at a pose.
fn of_motors(cases: &mut Cases, robot: &Robot, value: f64, y: Vec<f64>) -> Outcome {
    let n = y.len();
    let n_u = robot.compiled.model.sizes().n_u;
    let yd = State::of(robot, 0.1)?.yd;
    for field in [TorqueVertices, SpeedVertices, Margin, Clip, ReflectedInertia, GainsY] {
        let is_set = matches!(field, TorqueVertices | SpeedVertices);
        if is_set && (n > 4 || field == SpeedVertices && n_u > n) {
            continue;
        }
        let mut given = vec![(Y, y.clone()), (Yd, yd.clone())];
        given.push((TauY, (0..n).map(|k| 1.0 - 0.4 * k as f64).collect()));
        if field == GainsY {
            given.push((GainsU, (0..2 * n_u).map(|k| 20.0 + k as f64).collect()));
        }
        let ask = Question::new(Request::Map, given, &[field]);
        let answer = ask.run(&robot.compiled.model)?;
        let numbers = |of: &[f64]| if is_set { reaches(of, n) } else { of.to_vec() };
        let exact = ask.run(&robot.compiled.exact)?;
        let exact: Vec<f64> = exact.get(field).iter().map(|x| x.to_f64()).collect();
        let error = apart(&numbers(answer.get(field)), &numbers(&exact));
        let error = (answer.status() == Status::Ok).then_some(error);
        cases.all.push(cases.answered(robot, At::of(robot, value), field.name(), &answer, error));
    }
    Ok(())
}

/// How far vertices reach in each direction; rows of NaN are none.
fn reaches(vertices: &[f64], n: usize) -> Vec<f64> {
    let reach = |d: usize| {
        let of = |(k, x): (usize, &f64)| x * (1.7 * d as f64 + 2.3 * (k * d + k) as f64).cos();
        let along = |row: &[f64]| row.iter().enumerate().map(of).sum();
        vertices.chunks_exact(n).map(along).fold(f64::NEG_INFINITY, f64::max)
    };
    (0..DIRECTIONS).map(reach).collect()
}

/// The largest difference as part of each number, or of the largest one where it is far below it;
/// infinite where one is none and the other is.
fn apart(found: &[f64], exact: &[f64]) -> f64 {
    let size = exact.iter().fold(FORCE, |size: f64, x| size.max(x.abs()));
    let off = |(x, exact): (&f64, &f64)| match x == exact || x.is_nan() && exact.is_nan() {
        true => 0.0,
        false => (x - exact).abs() / exact.abs().max(NOTHING * size),
    };
    let of = found.iter().zip(exact).map(off);
    of.fold(0.0, |worst, x| if x.is_nan() { f64::INFINITY } else { x.max(worst) })
}

#[cfg(test)]
mod tests {
    use sarrus_dynamics::Field::GU;

    use super::*;
    use crate::page::Assessment;

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

    #[test]
    fn what_actuators_allow_is_never_silently_wrong() {
        let mut cases = Cases::default();
        run(&mut cases, &Effort { quick: true }).expect("cases");
        let silent = cases.all.iter().filter(|case| case.assessment == Assessment::FailedSilently);
        let silent: Vec<String> = silent
            .map(|case| {
                let of = (&case.robot, &case.method, &case.asked, case.value, &case.status);
                format!("{of:?} {:?} {:?}", case.error, case.warnings)
            })
            .collect();
        assert!(silent.is_empty(), "{} of {}: {silent:#?}", silent.len(), cases.all.len());
        let held = |asked: &str| {
            let of = cases.all.iter().filter(|case| case.asked == asked);
            of.filter(|case| case.assessment == Assessment::Held).count()
        };
        assert!(["torque_vertices", "margin", "gains_y"].iter().all(|asked| held(asked) > 20));
    }
}
