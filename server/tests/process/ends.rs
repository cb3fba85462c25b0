//! Clients and servers that end, in order or not.

use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

use rustix::process::Signal;
use sarrus_client::{ConnectError, Error, Status, Transport};

use sarrus_torture::patience::LIMIT;

use crate::support::{Asker, ROBOT, Sandbox, wait_until};

const NOTHING: Vec<PathBuf> = Vec::new();

#[test]
fn a_clean_stop_leaves_nothing() {
    for signal in [Signal::TERM, Signal::INT] {
        let sandbox = Sandbox::new();
        let server = sandbox.serve("tidy", &[]);
        let mut askers = [Transport::Lane, Transport::Service]
            .map(|transport| Asker::new(sandbox.connect("tidy", transport).unwrap()));
        askers.iter_mut().for_each(|asker| assert_eq!(asker.ask().unwrap().status, Status::Ok));
        drop(askers);
        assert_eq!(server.stop_by(signal).code(), Some(0));
        assert_eq!(sandbox.leftovers(), NOTHING);
    }
}

#[test]
fn a_clean_stop_under_clients_leaves_nothing_once_they_are_gone() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("under", &[]);
    let mut askers = [Transport::Lane, Transport::Service]
        .map(|transport| sandbox.attach_briefly("under", transport));
    askers.iter_mut().for_each(|asker| assert_eq!(asker.ask().unwrap().status, Status::Ok));
    assert!(server.stop().success());
    for asker in &mut askers {
        let start = Instant::now();
        let error = asker.ask().unwrap_err();
        assert!(matches!(error, Error::ServerGone(..)), "{error}");
        assert!(start.elapsed() < LIMIT);
        assert!(asker.output.iter().all(|number| number.is_nan()));
    }
    drop(askers);
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn a_stack_that_is_too_small_is_refused_and_a_larger_one_serves() {
    let sandbox = Sandbox::new();
    let limited = |kib: u32| {
        let inner = sandbox.command(ROBOT, "small", &[]);
        let mut outer = Command::new("sh");
        outer.args(["-c", &format!("ulimit -s {kib} && exec \"$@\""), "sh"]);
        outer.arg(inner.get_program()).args(inner.get_args());
        outer.envs(inner.get_envs().filter_map(|(name, value)| Some((name, value?))));
        outer
    };
    for kib in [96, 256, 511] {
        let output = limited(kib).output().unwrap();
        let words = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{:?}: {words}", output.status);
        assert!(words.contains(&format!("limited to {} bytes", kib << 10)), "{words}");
    }
    let server = sandbox.start(&mut limited(512));
    let mut asker = Asker::new(sandbox.connect("small", Transport::Lane).unwrap());
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    drop(asker);
    assert!(server.stop().success());
}

#[test]
fn requests_during_a_stop_are_refused_not_lost() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("closing", &[]);
    let [mut lane, mut requests] = [Transport::Lane, Transport::Service]
        .map(|transport| sandbox.attach_briefly("closing", transport));
    let stop = std::thread::spawn(move || server.stop());
    let mut last = [Status::Ok; 2];
    let start = Instant::now();
    while last.contains(&Status::Ok) && start.elapsed() < LIMIT {
        for (asker, last) in [&mut lane, &mut requests].into_iter().zip(&mut last) {
            match *last {
                Status::Ok => {
                    *last = match asker.ask() {
                        Ok(answer) => answer.status,
                        // a thread that did not run while the server drained finds it gone
                        Err(Error::ServerGone(..)) => Status::ShuttingDown,
                        Err(error) => panic!("{error}"),
                    }
                }
                _ => continue,
            }
        }
    }
    assert_eq!(last, [Status::ShuttingDown; 2]);
    assert!(lane.output.iter().chain(&requests.output).all(|number| number.is_nan()));
    assert!(stop.join().unwrap().success());
}

#[test]
fn a_killed_clients_lane_serves_the_next_one() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("widow", &["--lanes", "1"]);
    for _ in 0..3 {
        let client = sandbox.client("widow", Transport::Lane);
        assert!(matches!(
            sandbox.connect("widow", Transport::Lane),
            Err(ConnectError::NoFreeSlot { .. })
        ));
        client.kill();
        let start = Instant::now();
        let robot = loop {
            match sandbox.connect("widow", Transport::Lane) {
                Ok(robot) => break robot,
                Err(ConnectError::NoFreeSlot { .. }) if start.elapsed() < LIMIT => {}
                Err(error) => panic!("after {:?}: {error}", start.elapsed()),
            }
        };
        let mut asker = Asker::new(robot);
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        assert!(start.elapsed() < LIMIT, "{:?}", start.elapsed());
    }
    // and through the other transport
    sandbox.client("widow", Transport::Service).kill();
    assert_eq!(
        Asker::new(sandbox.connect("widow", Transport::Service).unwrap()).ask().unwrap().status,
        Status::Ok
    );
    assert!(server.stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}

#[test]
fn a_killed_server_is_reported_and_a_new_one_is_found() {
    for transport in [Transport::Lane, Transport::Service] {
        let sandbox = Sandbox::new();
        let server = sandbox.serve("phoenix", &[]);
        let mut asker = sandbox.attach_briefly("phoenix", transport);
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        let bits = asker.bits();
        server.kill();

        // without a server: reported in the stated time
        let start = Instant::now();
        let error = asker.ask().unwrap_err();
        assert!(matches!(error, Error::ServerGone(..)), "{transport:?}: {error}");
        assert!(start.elapsed() < LIMIT, "{transport:?}: {:?}", start.elapsed());

        // a new one: the next request finds it
        let server = sandbox.serve("phoenix", &[]);
        wait_until("the new server answers", || asker.ask().is_ok());
        assert_eq!(asker.bits(), bits);
        drop(asker);

        // a new one while the request is under way
        let mut asker = Asker::new(sandbox.connect("phoenix", transport).unwrap());
        server.kill();
        let server = std::thread::scope(|scope| {
            let restart = scope.spawn(|| sandbox.serve("phoenix", &[]));
            assert_eq!(asker.ask().unwrap().status, Status::Ok, "{transport:?}");
            restart.join().unwrap()
        });
        assert_eq!(asker.bits(), bits);
        drop(asker);
        assert!(server.stop().success());
        assert_eq!(sandbox.leftovers(), NOTHING, "{transport:?}");
    }
}

#[test]
fn a_server_that_comes_back_with_another_model_is_refused() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("changeling", &[]);
    let mut asker = Asker::new(sandbox.connect("changeling", Transport::Lane).unwrap());
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    server.kill();
    let _other = sandbox.serve_robot("lambda", "changeling", &[]);
    let error = asker.ask().unwrap_err();
    assert!(matches!(error, Error::Connect(ConnectError::WrongModel { .. })), "{error}");
    assert!(asker.output.iter().all(|number| number.is_nan()));
    // nor with other gravity, which is part of the model
    drop(_other);
    let _other = sandbox.serve("changeling", &["--gravity", "0,0,-1.62"]);
    assert!(matches!(asker.ask(), Err(Error::Connect(ConnectError::WrongModel { .. }))));
}

#[test]
fn a_new_start_clears_what_a_crash_left() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("crash", &[]);
    let clients =
        [Transport::Lane, Transport::Service].map(|transport| sandbox.client("crash", transport));
    server.kill();
    let _ = clients.map(|client| client.kill());
    assert_ne!(
        sandbox.leftovers(),
        NOTHING,
        "a crash leaves something, or this test tests nothing"
    );
    assert!(sandbox.serve("crash", &[]).stop().success());
    assert_eq!(sandbox.leftovers(), NOTHING);
}
