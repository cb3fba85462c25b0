//! The simple questions: one method each, the same in process and connected.

use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::num::NonZero;
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

use sarrus_client::{
    Answer, Error, Field, FieldSet, Model, Options, Query, QueryOptions, Request, Robot, Source,
    Status, TaskParts, Transport, Warnings,
};
use sarrus_serve::pool;

use sarrus_torture::patience::LIMIT;

use crate::support::{ROBOT, Sandbox};

/// The answers to every simple question at one state, one after the other.
fn ask_all(robot: &mut Robot, size: f64) -> Result<Vec<f64>, Error> {
    let sizes = robot.model().sizes;
    let zeros = |n: usize| vec![0.0; n];
    let y: Vec<f64> = (0..sizes.n_qy).map(|i| size * (1.0 + 0.1 * i as f64)).collect();
    let yd = vec![0.3; sizes.n_vy];
    let ydd = vec![-0.2; sizes.n_vy];
    let mut tau_u = zeros(sizes.n_u);
    let mut again = zeros(sizes.n_vy);
    let [mut u, mut ud, mut udd] = [sizes.n_u; 3].map(zeros);
    let [mut q, mut qd, mut qdd] = [sizes.n_q, sizes.n_v, sizes.n_v].map(zeros);
    let [mut y_u, mut yd_u, mut ydd_u] = [sizes.n_qy, sizes.n_vy, sizes.n_vy].map(zeros);
    robot.inverse_dynamics(&y, &yd, &ydd, &mut tau_u)?;
    robot.forward_dynamics(&y, &yd, &tau_u, &mut again)?;
    robot.state(&y, &yd, &ydd, &mut q, &mut qd, &mut qdd)?;
    robot.to_actuators(&y, &yd, &ydd, &mut u, &mut ud, &mut udd)?;
    robot.to_independent(&u, &ud, &udd, &mut y_u, &mut yd_u, &mut ydd_u)?;

    // forward dynamics invert inverse dynamics, and the independents those of the actuators
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-8);
    assert!(near(&again, &ydd), "{again:?}");
    assert!(near(&y_u, &y) && near(&yd_u, &yd) && near(&ydd_u, &ydd), "{y_u:?} {yd_u:?} {ydd_u:?}");
    Ok([tau_u, again, q, qd, qdd, u, ud, udd, y_u, yd_u, ydd_u].concat())
}

fn local() -> Robot {
    Robot::load(&Source::Bundled(ROBOT.into()), &Options::default()).unwrap()
}

#[test]
fn simple_questions_give_the_same_bits_in_process_and_connected() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("simple", &[]);
    let mut robots = [Transport::Lane, Transport::Service]
        .map(|transport| sandbox.connect("simple", transport).unwrap());
    let mut local = local();
    for size in [0.0, 0.05, 0.1] {
        let expected = ask_all(&mut local, size).unwrap();
        for robot in &mut robots {
            assert_eq!(ask_all(robot, size).unwrap(), expected);
        }
    }
}

/// Searches that end in a turn, that need more than one, that reach nothing and that are malformed:
/// answers and bits of single requests, and the same of a batch.
fn search_all(robot: &mut Robot) -> [(Vec<Answer>, Vec<u64>); 2] {
    let link = robot.model().link("ALWristRoll_Link").unwrap();
    let want = [Field::Y, Field::Q, Field::TaskResidual, Field::Iterations, Field::Binding];
    let query = Query::new(Request::InverseKinematics, FieldSet::EMPTY, FieldSet::of(&want));
    let parts = TaskParts::POSITION.with(TaskParts::ORIENTATION);
    let plan = robot.prepare(&query.with_tasks(&[(link, parts)])).unwrap();
    let poses = Query::new(Request::Kinematics, Field::Y.into(), Field::FramePose.into());
    let poses = robot.prepare(&poses.with_frames(&[link])).unwrap();
    let mut targets = Vec::new();
    for size in [0.0, 0.1, -0.2, 0.3] {
        let mut pose = [0.0; 7];
        let y = vec![size; robot.model().sizes.n_qy];
        assert_eq!(robot.ask(poses, &y, &mut pose).unwrap().status, Status::Ok);
        targets.extend([&pose[..], &[0.0, 0.0, 1.0, 1.0]].concat());
    }
    targets.extend([9.0, 9.0, 9.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
    targets.extend([0.0; 11]);

    let n = robot.plan(plan).unwrap().want().len();
    let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect();
    let mut answers = Vec::new();
    let mut output = vec![0.0; 6 * n];
    for (target, output) in targets.chunks(11).zip(output.chunks_mut(n)) {
        answers.push(robot.ask(plan, target, output).unwrap());
    }
    let single = (answers.clone(), bits(&output));
    robot.batch(plan, NonZero::<usize>::MIN, &targets, &mut output, &mut answers).unwrap();
    [single, (answers, bits(&output))]
}

#[test]
fn searches_give_the_same_bits_in_process_and_connected() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("search", &[]);
    let expected = search_all(&mut local());
    let statuses: Vec<Status> = expected[0].0.iter().map(|answer| answer.status).collect();
    assert_eq!(statuses[..4], [Status::Ok; 4]);
    assert_eq!(statuses[4..], [Status::NotReached, Status::BadRequest]);
    assert!(expected[0] == expected[1]);
    for transport in [Transport::Lane, Transport::Service] {
        let mut robot = sandbox.connect("search", transport).unwrap();
        assert!(search_all(&mut robot) == expected, "{transport:?}");
    }
}

#[test]
fn simple_questions_allocate_nothing_after_the_first() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("lean", &[]);
    for mut robot in [local(), sandbox.connect("lean", Transport::Lane).unwrap()] {
        let n = robot.model().independent.len();
        let y = vec![0.01; n];
        let mut tau_u = vec![0.0; robot.model().active.len()];
        let mut ydd = vec![0.0; n];
        // the first question by asking it, the second ahead of time
        robot.inverse_dynamics(&y, &y, &y, &mut tau_u).unwrap();
        robot.prepare_forward_dynamics().unwrap();
        let before = pool::counts();
        let adopted = pool::adopt_thread();
        let good = (0..1000).filter(|_| {
            robot.inverse_dynamics(&y, &y, &y, &mut tau_u).is_ok()
                && robot.forward_dynamics(&y, &y, &tau_u, &mut ydd).is_ok()
        });
        let good = good.count();
        drop(adopted);
        let after = pool::counts();
        assert_eq!((good, after.pool - before.pool, after.system - before.system), (1000, 0, 0));
    }
}

#[test]
fn an_array_that_does_not_fit_is_named() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("fits", &[]);
    for mut robot in [local(), sandbox.connect("fits", Transport::Lane).unwrap()] {
        let n = robot.model().independent.len();
        let y = vec![0.0; n];
        let mut tau_u = vec![1.0; robot.model().active.len()];
        let error = robot.inverse_dynamics(&y, &y, &y[1..], &mut tau_u).unwrap_err();
        let Error::WrongSize { field: Field::Ydd, found, expected } = error else {
            panic!("{error}")
        };
        assert_eq!((found, expected), (n - 1, n));
        assert!(tau_u.iter().all(|number| number.is_nan()));
        let error = robot.inverse_dynamics(&y, &y, &y, &mut [0.0]).unwrap_err();
        assert!(matches!(error, Error::WrongSize { field: Field::TauU, found: 1, .. }), "{error}");
    }
}

#[test]
fn a_state_without_an_answer_is_an_error_with_its_status() {
    let mut robot = Robot::load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    let mut tau_u = [0.0];
    let error = robot.inverse_dynamics(&[f64::NAN], &[0.0], &[0.0], &mut tau_u).unwrap_err();
    let Error::Failed(failed) = error else { panic!("{error}") };
    assert_eq!(failed.status, Status::NonFiniteInput);
    assert!(tau_u[0].is_nan());
    // warnings are no error
    let limits = robot.model().limits.iter().flatten().find_map(|limits| limits.velocity);
    let warnings =
        robot.inverse_dynamics(&[0.2], &[2.0 * limits.unwrap()], &[0.0], &mut tau_u).unwrap();
    assert!(warnings.contains(Warnings::LIMITS_EXCEEDED));
    assert!(tau_u[0].is_finite());
}

/// Overwrites every occurrence of a number in lanes until it is stopped.
fn scribble(sandbox: &Sandbox, number: f64, stop: &AtomicBool) {
    let files: Vec<fs::File> = sandbox
        .leftovers()
        .iter()
        .filter(|path| path.extension().is_some_and(|ending| ending == "blackboard_data"))
        .map(|path| fs::OpenOptions::new().read(true).write(true).open(path).unwrap())
        .collect();
    let mut bytes = Vec::new();
    let start = Instant::now();
    while !stop.load(Relaxed) && start.elapsed() < LIMIT {
        for mut file in &files {
            bytes.clear();
            file.seek(SeekFrom::Start(0)).unwrap();
            file.read_to_end(&mut bytes).unwrap();
            let words = bytes.chunks_exact(8).enumerate();
            for (k, _) in words.filter(|(_, word)| **word == number.to_ne_bytes()) {
                file.write_all_at(&(number + 1.0).to_ne_bytes(), 8 * k as u64).unwrap();
            }
        }
    }
}

#[test]
fn a_simple_question_with_a_checksum_takes_no_changed_number() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve_robot("lambda", "sealed", &[]);
    let mut tau_u = [0.0];
    let mut local = Robot::load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    local.inverse_dynamics(&[0.2], &[1.0], &[0.0], &mut tau_u).unwrap();
    let expected = tau_u;

    let mut robot = sandbox.connect("sealed", Transport::Lane).unwrap();
    robot.set_options(QueryOptions::CHECKSUM);
    let mut ask = || {
        let outcome = robot.inverse_dynamics(&[0.2], &[1.0], &[0.0], &mut tau_u);
        (outcome, tau_u)
    };
    assert_eq!((ask().0.unwrap(), ask().1), (Warnings::NONE, expected));
    let stop = AtomicBool::new(false);
    let start = Instant::now();
    let corrupt = std::thread::scope(|scope| {
        scope.spawn(|| scribble(&sandbox, expected[0], &stop));
        let mut corrupt = 0;
        while corrupt < 20 && start.elapsed() < LIMIT {
            match ask() {
                (Ok(_), tau_u) => assert_eq!(tau_u, expected),
                (Err(Error::Failed(failed)), tau_u) => {
                    assert_eq!(failed.status, Status::CorruptAnswer);
                    assert!(tau_u[0].is_nan());
                    corrupt += 1;
                }
                (Err(error), _) => panic!("{error}"),
            }
        }
        stop.store(true, Relaxed);
        corrupt
    });
    assert_eq!(corrupt, 20);
}

#[test]
fn options_of_simple_questions_change_no_bit_and_can_be_changed() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("optional", &[]);
    for mut robot in [local(), sandbox.connect("optional", Transport::Lane).unwrap()] {
        let plain = ask_all(&mut robot, 0.1).unwrap();
        assert_eq!(robot.times(), None);
        let plan = robot.prepare_inverse_dynamics().unwrap();
        for options in [QueryOptions::TIMES, QueryOptions::CHECKSUM, QueryOptions::NONE] {
            robot.set_options(options);
            assert_eq!(ask_all(&mut robot, 0.1).unwrap(), plain);
            assert_eq!(robot.times().is_some(), options == QueryOptions::TIMES);
        }
        // a plan that was given out stays, and is the one without options
        assert_eq!(robot.prepare_inverse_dynamics().unwrap(), plan);
        assert!(robot.plan(plan).is_some());
    }
}

#[test]
fn a_robot_from_a_model_is_the_robot_from_its_files() {
    let source = Source::Bundled(ROBOT.into());
    let loaded = sarrus_models::load(&source, &Options::default()).unwrap();
    let mut made = Robot::from_model(Model::compile(&loaded.description).unwrap());
    let mut read = local();
    assert_eq!(made.model().fingerprint, read.model().fingerprint);
    assert_eq!(ask_all(&mut made, 0.1).unwrap(), ask_all(&mut read, 0.1).unwrap());
}
