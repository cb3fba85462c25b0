//! A looser tolerance of Newton's method: errors within it, and never more steps.

use sarrus_dynamics::{Field, Model, Request, Status};
use sarrus_tests::cases::Case;
use sarrus_tests::compare::error_by_size;
use sarrus_tests::run::Robot;

use Field::*;

/// Robots whose loops are closed by Newton's method alone.
const NUMERICAL: [&str; 6] =
    ["wrist", "squeezer", "delta", "active_ankle", "four_bars_2", "bricard"];
/// Robots that the first attempt closes at every tolerance; the others need more for redundant rows
/// or for the path to the pose.
const DIRECT: [&str; 4] = ["wrist", "squeezer", "delta", "active_ankle"];
/// States of each robot.
const STATES: u64 = 12;
const TOLERANCES: [f64; 15] = [
    1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15,
];

/// Worst error of q against double-double and the sum of Newton steps over some states, started at
/// the zero pose, since tabulated starts would leave little to do.
fn measured(case: &Case, model: &Model) -> (f64, f64) {
    let mut robot = Robot::new(model.clone());
    let mut exact = Robot::new(case.compiled.exact.clone());
    let mut worst = 0.0_f64;
    let mut steps = 0.0;
    let zero = vec![0.0; model.sizes().n_q];
    for k in 0..STATES {
        let y = case.state::<f64>(k).y;
        let given = [(Y, y.as_slice()), (QGuess, &zero)];
        let x = robot.ask(Request::Kinematics, &given, &[Q, Iterations]);
        assert_eq!(x.answer.status, Status::Ok, "{} state {k}", case.name);
        let reference =
            exact.ask(Request::Kinematics, &[(Y, &case.state(k).y)], &[Q]).ok().map(|x| x.hi());
        worst = worst.max(error_by_size(x.get(Q), reference.get(Q), 1.0));
        steps += x.get(Iterations)[0];
    }
    (worst, steps)
}

#[test]
fn an_answer_is_as_exact_as_its_tolerance() {
    for name in NUMERICAL {
        let case = Case::bundled(name);
        let model = &case.compiled.model;
        let usual = measured(&case, model);
        let mut before = f64::INFINITY;
        for tolerance in TOLERANCES {
            let (error, steps) = measured(&case, &model.with_tolerance(tolerance, 10));
            println!(
                "{name} {tolerance:.0e}: {error:.1e} in {steps} steps; usually {:.1e} in {}",
                usual.0, usual.1
            );
            // the last correction is below the tolerance, and the error mostly its square
            assert!(error <= 0.5 * tolerance + 4.0 * usual.0, "{name} {tolerance}: {error}");
            assert!(
                error <= 2.0 * before + 4.0 * usual.0,
                "{name} {tolerance}: {error} after {before}"
            );
            assert!(
                tolerance < 2e-9 || steps <= usual.1 || !DIRECT.contains(&name),
                "{name} {tolerance}: {steps} steps"
            );
            before = error;
        }
        let loose = measured(&case, &model.with_tolerance(1e-1, 10));
        assert!(
            (loose.1 < usual.1 || !DIRECT.contains(&name)) && loose.0 > usual.0,
            "{name}: {loose:?} {usual:?}"
        );
    }
}

#[test]
fn a_bounded_number_of_steps_is_kept_and_more_steps_are_more_exact() {
    for name in DIRECT {
        let case = Case::bundled(name);
        let model = &case.compiled.model;
        let usual = measured(&case, model);
        let once = measured(&case, &model.with_tolerance(0.0, 1));
        let mut before = once.0;
        for steps in 2..6 {
            let (error, taken) = measured(&case, &model.with_tolerance(0.0, steps));
            println!("{name}, {steps} steps: {error:.1e} in {taken}, in one {once:?}");
            assert!(taken <= f64::from(steps) * once.1, "{name}: {taken} for {steps} each");
            assert!(error <= 0.5 * before + 4.0 * usual.0, "{name}: {error} after {before}");
            before = error;
        }
        assert!(before <= 4.0 * usual.0, "{name}: {before}, usually {usual:?}");
        assert!(once.0 > 1e-9, "{name}: one step cannot be exact");
    }
}

#[test]
fn closed_forms_have_no_tolerance() {
    for name in ["lambda", "torso", "parallelogram"] {
        let case = Case::bundled(name);
        let model = &case.compiled.model;
        let loose = model.with_tolerance(0.1, 1);
        assert_eq!(loose.fingerprint(), model.fingerprint());
        let state = case.state::<f64>(0);
        let q = |model: &Model| {
            Robot::new(model.clone())
                .ask(Request::Kinematics, &[(Y, &state.y)], &[Q])
                .ok()
                .get(Q)
                .to_vec()
        };
        assert_eq!(q(&loose), q(model), "{name}");
    }
}
