//! The server as its users meet it: as a process, among clients that crash, crowd, lie and vanish.
//! One test at a time.
// lint: helpers of tests panic, as tests do
#![allow(clippy::unwrap_used, clippy::panic)]

mod batches;
mod border;
mod direct;
mod doctor;
mod ends;
mod heads;
#[cfg(feature = "generate")]
mod kernels;
mod lies;
mod load;
mod log;
mod memory;
mod placement;
mod plans;
mod record;
mod roots;
mod supervise;
mod support;

use std::time::{Duration, Instant};

use sarrus_client::{
    ConnectError, ConnectOptions, Field, FieldSet, Options, Query, Request, Robot, Source, Status,
    Transport,
};

use sarrus_torture::patience::LIMIT;

use support::{Asker, ROBOT, STATE, Sandbox, options};

/// Counts the blocks that an adopted thread takes from an allocator.
#[global_allocator]
static POOL: sarrus_serve::pool::Pool = sarrus_serve::pool::Pool;

/// Not a test of its own: the body of the clients that tests start as other processes.
#[test]
fn the_other_process() {
    let (Ok(name), Ok(transport)) =
        (std::env::var("SARRUS_TEST_SERVER"), std::env::var("SARRUS_TEST_TRANSPORT"))
    else {
        return;
    };
    let transport = if transport == "Lane" { Transport::Lane } else { Transport::Service };
    let robot =
        sarrus_client::Robot::connect_with(&name, ConnectOptions { transport, ..options() })
            .unwrap();
    let mut asker = Asker::new(robot);
    // a plan of its own, where the test asks for one
    if let Ok(number) = std::env::var("SARRUS_TEST_QUERY") {
        let _plan = asker.robot.prepare(&plans::distinct(number.parse().unwrap())).unwrap();
    }
    let _ = asker.ask().unwrap();
    if std::env::var("SARRUS_TEST_BATCHES").is_ok() {
        let mut batch = batches::Rows::new(&asker, 20_000);
        batch.ask(&mut asker).unwrap();
        println!("answered");
        while batch.ask(&mut asker).is_ok() {}
        return;
    }
    println!("answered");
    loop {
        let _ = asker.ask().unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn ready_is_one_line_with_name_and_fingerprint() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("here", &[]);
    let robot = sandbox.connect("here", Transport::Lane).unwrap();
    assert_eq!(server.ready, format!("ready here {:016x}\n", robot.model().fingerprint));
}

#[test]
fn both_transports_give_the_same_bits_as_in_process() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("same", &[]);
    let [mut lane, mut requests] = [Transport::Lane, Transport::Service]
        .map(|transport| Asker::new(sandbox.connect("same", transport).unwrap()));
    let mut local =
        Asker::new(Robot::load(&Source::Bundled(ROBOT.into()), &Options::default()).unwrap());
    assert_eq!(lane.robot.model(), local.robot.model());
    for k in 0..200 {
        for asker in [&mut lane, &mut requests, &mut local] {
            asker
                .input
                .iter_mut()
                .enumerate()
                .for_each(|(i, number)| *number = 1e-3 * ((k * 31 + i * 17) % 101) as f64);
            assert_eq!(asker.ask().unwrap().status, Status::Ok);
        }
        assert_eq!(lane.bits(), local.bits());
        assert_eq!(requests.bits(), local.bits());
    }
}

#[test]
fn a_larger_plan_gets_a_larger_lane() {
    let sandbox = Sandbox::new();
    // one lane only: the small one must be given up for the large one
    let _server = sandbox.serve("grow", &["--lanes", "1"]);
    let mut robot = sandbox.connect("grow", Transport::Lane).unwrap();
    let small = robot
        .prepare(&Query::new(
            Request::Kinematics,
            FieldSet::of(&[Field::Y]),
            FieldSet::of(&[Field::U]),
        ))
        .unwrap();
    let large = robot
        .prepare(&Query::new(
            Request::Kinematics,
            FieldSet::of(&[Field::Y]),
            FieldSet::of(&[Field::G, Field::K, Field::Q]),
        ))
        .unwrap();
    for plan in [small, large, small] {
        let (n_in, n_out) =
            robot.plan(plan).map(|plan| (plan.given().len(), plan.want().len())).unwrap();
        let mut output = vec![f64::NAN; n_out];
        assert_eq!(robot.ask(plan, &vec![0.0; n_in], &mut output).unwrap().status, Status::Ok);
        assert!(output.iter().all(|number| number.is_finite()));
    }
    assert_eq!(robot.ask(small, &[], &mut []).unwrap().status, Status::WrongSize);
}

#[test]
fn no_server_is_reported_before_the_time_out() {
    let sandbox = Sandbox::new();
    let start = Instant::now();
    let error = sandbox.connect("nobody", Transport::Lane).err().unwrap();
    assert!(matches!(error, ConnectError::NoServer(..)), "{error}");
    let root = sandbox.domain().root().display();
    assert_eq!(
        error.to_string(),
        format!(
            "no server named `nobody` runs below {root}; start one with `sarrus serve --name \
             nobody`, or name its folder in SARRUS_ROOT"
        )
    );
    assert!(start.elapsed() < LIMIT);
    assert!(matches!(sandbox.connect("no/body", Transport::Lane), Err(ConnectError::Domain(_))));
    assert_eq!(sandbox.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn a_second_server_of_the_name_is_refused() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("twice", &[]);
    let second = sandbox.command(ROBOT, "twice", &[]).output().unwrap();
    assert_eq!((second.status.code(), second.stdout.len()), (Some(2), 0));
    let words = String::from_utf8(second.stderr).unwrap();
    assert_eq!(
        words,
        "sarrus serve: a server named `twice` is running already; stop it or choose another name \
         with --name\n"
    );
    // the first one goes on, and others have their own names
    let _other = sandbox.serve("thrice", &[]);
    assert_eq!(
        Asker::new(sandbox.connect("twice", Transport::Lane).unwrap()).ask().unwrap().status,
        Status::Ok
    );
    assert!(server.stop().success());
}

#[test]
fn another_model_than_expected_is_refused() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("other", &[]);
    let error = sandbox
        .connect_with("other", ConnectOptions { fingerprint: Some(42), ..options() })
        .err()
        .unwrap();
    assert!(matches!(error, ConnectError::WrongModel { expected: 42, .. }), "{error}");
}

#[test]
fn no_free_slot_is_reported_and_the_service_stays_open() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("full", &["--lanes", "2"]);
    let first = Asker::new(sandbox.connect("full", Transport::Lane).unwrap());
    let _second = Asker::new(sandbox.connect("full", Transport::Lane).unwrap());
    let error = sandbox.connect("full", Transport::Lane).err().unwrap();
    assert!(matches!(error, ConnectError::NoFreeSlot { limit: 2, .. }), "{error}");
    let mut third = Asker::new(sandbox.connect("full", Transport::Service).unwrap());
    assert_eq!(third.ask().unwrap().status, Status::Ok);
    // who leaves makes room
    drop(first);
    let mut fourth = Asker::new(sandbox.connect("full", Transport::Lane).unwrap());
    assert_eq!(fourth.ask().unwrap().status, Status::Ok);
    assert_eq!(fourth.robot.prepare(&STATE).unwrap(), fourth.plan);
}
