//! Refused simulations and their errors.

use sarrus_dynamics::Status;
use sarrus_simulation::{End, EventKind, Run, SimulationError, Source, Space};

use super::*;

fn refused(robot: &Robot, start: &Start, settings: &Settings) -> SimulationError {
    simulate(&robot.setup(), start, settings, &mut |_| ()).unwrap_err()
}

#[test]
fn every_fault_of_start_settings_inputs_and_springs_is_named() {
    let robot = Robot::bundled("lambda");
    let good = fixed(Method::RungeKutta, 1e-3, 0.1);
    let start = from(&[0.1], &[0.0]);
    let says = |error: SimulationError, words: &[&str]| {
        let text = error.to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text:?} does not say {words:?}");
    };
    says(
        refused(&robot, &from(&[0.1, 0.2], &[0.0]), &good),
        &["y:", "found 2", "expected 1", "Elbow"],
    );
    says(refused(&robot, &from(&[0.1], &[]), &good), &["yd:", "found 0", "expected 1"]);
    says(refused(&robot, &from(&[f64::NAN], &[0.0]), &good), &["y:", "number 1 is not finite"]);
    says(
        refused(&robot, &from(&[0.1], &[f64::INFINITY]), &good),
        &["yd:", "number 1 is not finite"],
    );
    says(
        refused(&robot, &Start::Tree { q: vec![0.0; 2], qd: vec![0.0; 3] }, &good),
        &["q:", "found 2", "expected 3"],
    );
    for (settings, words) in [
        (Settings { step: Some(-1e-3), ..good }, ["the step is -0.001", "positive"]),
        (Settings { step: Some(0.0), ..good }, ["the step is 0", "positive"]),
        (Settings { step: Some(f64::NAN), ..good }, ["the step is NaN", "positive"]),
        (Settings { step: Some(1e-12), ..good }, ["the step", "thousand-millionth"]),
        (Settings { step: None, ..good }, ["the step", "does not find its own"]),
        (Settings { duration: -1.0, ..good }, ["the duration is -1", "positive"]),
        (Settings { duration: f64::INFINITY, ..good }, ["the duration is inf", "positive"]),
        (Settings { every: Some(0.0), ..good }, ["between samples is 0", "positive"]),
        (
            Settings { rtol: 0.0, ..adaptive(Method::Dop853, 1e-6, 0.1) },
            ["relative tolerance is 0", "1e-14"],
        ),
        (
            Settings { atol: -1.0, ..adaptive(Method::Radau5, 1e-6, 0.1) },
            ["absolute tolerance is -1", "positive"],
        ),
    ] {
        says(refused(&robot, &start, &settings), &words);
    }
    // inputs
    for (space, source, words) in [
        (Space::Actuator, Source::Constant(vec![]), ["found 0", "ElbowAct"]),
        (Space::Independent, Source::Constant(vec![f64::NAN]), ["in y", "not finite"]),
        (
            Space::Actuator,
            Source::Table { times: vec![0.0, 0.0], forces: vec![vec![1.0]; 2] },
            ["row 2", "not after the one before"],
        ),
        (
            Space::Actuator,
            Source::Table { times: vec![0.0], forces: vec![] },
            ["row 1", "without a force"],
        ),
        (
            Space::Actuator,
            Source::Gains { stiffness: vec![1.0], damping: vec![], target: vec![0.0] },
            ["kd in u", "found 0"],
        ),
    ] {
        let mut robot = Robot::bundled("lambda");
        robot.inputs.push(Input { space, source });
        says(refused(&robot, &start, &good), &words);
    }
    // springs
    for (constants, word) in [
        ([-1.0, 0.0, 0.0], "stiffness of -1"),
        ([1.0, f64::NAN, 0.0], "damping of NaN"),
        ([1.0, 0.0, -2.0], "rest length of -2"),
    ] {
        let mut robot = Robot::bundled("lambda");
        robot.spring(("base_link", [0.0; 3]), ("Elbow_Link", [0.0; 3]), constants);
        says(refused(&robot, &start, &good), &["spring 1", word]);
    }
    let mut robot = Robot::bundled("lambda");
    robot.spring(("base_link", [0.0; 3]), ("Elbow_Link", [0.0; 3]), [1.0, 0.0, 0.0]);
    robot.springs[0].to.link = 77;
    says(refused(&robot, &start, &good), &["spring 1", "link number 77"]);
}

#[test]
fn a_start_that_no_pose_has_is_refused_with_its_status() {
    let robot = super::switching::slider_crank("NUMERICAL", "slide");
    // a metre beyond the slider's reach
    let error = refused(&robot, &from(&[1.0], &[0.0]), &fixed(Method::RungeKutta, 1e-3, 0.1));
    assert!(matches!(error, SimulationError::Start { status: Status::Unreachable, .. }), "{error}");
}

#[test]
fn an_open_start_is_closed_and_told_and_a_closed_one_left_alone() {
    let robot = Robot::bundled("five_bar");
    let settings = fixed(Method::RungeKutta, 1e-3, 0.01);
    let closed = robot.run(&from(&[0.1, -0.1], &[0.3, 0.2]), &settings);
    let first = &closed.samples[0];
    let again = robot.run(&Start::Tree { q: first.q.clone(), qd: first.qd.clone() }, &settings);
    assert!(again.correction[0] < 1e-14 && again.correction[1] < 1e-13, "{:?}", again.correction);
    assert_eq!(again.samples[0].y, first.y);
    // one dependent is off by a hundredth, one rate by a tenth
    let mut q = first.q.clone();
    let mut qd = first.qd.clone();
    q[1] += 0.01;
    qd[3] -= 0.1;
    let projected = robot.run(&Start::Tree { q, qd }, &settings);
    assert!(
        (projected.correction[0] - 0.01).abs() < 1e-9
            && (projected.correction[1] - 0.1).abs() < 1e-3,
        "{:?}",
        projected.correction
    );
    assert!(projected.residual() < 1e-14);
}

/// A simulation of the five-bar pushed out of its reach.
fn pushed(settings: &Settings) -> Run {
    let mut robot = Robot::bundled("five_bar");
    robot
        .inputs
        .push(Input { space: Space::Actuator, source: Source::Constant(vec![40.0, -40.0]) });
    robot.run(
        &from(&[0.0, 0.0], &[0.0, 0.0]),
        &Settings { switching: false, every: None, ..*settings },
    )
}

#[test]
fn no_step_is_swallowed_where_the_right_hand_side_has_no_answer() {
    for settings in [
        fixed(Method::Euler, 1e-3, 5.0),
        fixed(Method::RungeKutta, 1e-3, 5.0),
        adaptive(Method::Dop853, 1e-8, 5.0),
        adaptive(Method::Radau5, 1e-8, 5.0),
    ] {
        let run = pushed(&settings);
        println!(
            "{} {:?} at {} {:?} {:?}",
            settings.method.name(),
            run.end,
            run.time,
            run.counts,
            run.events
        );
        assert!(!run.end.is_finished(), "{} gets through", settings.method.name());
        if let End::Failed(status) = run.end {
            assert!(status != Status::Ok && run.counts.failed > 0);
        }
        // the samples before the failure are kept and valid
        assert!(run.samples.len() > 3 && run.time > 0.0 && run.last().unwrap().time == run.time);
        for sample in &run.samples {
            assert!(
                sample.y.iter().chain(&sample.yd).chain(&sample.q).all(|x| x.is_finite()),
                "{sample:?}"
            );
            assert!(sample.energy.residual < 1e-9, "{sample:?}");
        }
        assert!(run.samples.windows(2).all(|pair| pair[0].time < pair[1].time));
    }
}

#[test]
fn a_state_that_overflows_ends_the_simulation() {
    // a step far too long for this spring
    let mut robot = Robot::bundled("lambda");
    robot.spring(("base_link", [0.0, 0.0, 0.5]), ("Elbow_Link", [0.0, 0.3, 0.0]), [1e9, 0.0, 0.1]);
    let run = robot.run(&from(&[0.1], &[0.0]), &fixed(Method::RungeKutta, 1e-2, 100.0));
    assert!(!run.end.is_finished(), "{:?}", run.last());
    assert!(run.samples.iter().all(|sample| sample.y[0].is_finite()));
}

#[test]
fn an_explicit_method_says_that_a_problem_is_stiff() {
    let mut robot = Robot::bundled("lambda");
    robot.spring(("base_link", [0.0, 0.0, 0.5]), ("Elbow_Link", [0.0, 0.3, 0.0]), [1e5, 1e6, 0.4]);
    let start = from(&[0.1], &[0.0]);
    let explicit = robot.run(&start, &adaptive(Method::Dop853, 1e-6, 1.0));
    let implicit = robot.run(&start, &adaptive(Method::Radau5, 1e-6, 1.0));
    println!("{:?} {:?} {:?}", explicit.counts, explicit.events, implicit.counts);
    assert!(explicit.events.iter().any(|event| event.kind == EventKind::Stiff));
    assert!(implicit.counts.steps * 20 < explicit.counts.steps);
    assert!((arrived(&explicit).y[0] - arrived(&implicit).y[0]).abs() < 1e-5);
}
