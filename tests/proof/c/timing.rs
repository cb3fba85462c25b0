//! A lane call from C++ beside one from Rust, in one run and one after the other.

use std::path::Path;
use std::time::Instant;

use sarrus_client::{ConnectOptions, Domain, Request, Robot};

use super::{CPP, Program, present};
use crate::examples::{Server, root};

const BLOCKS: usize = 200;
const CALLS: u32 = 100;

/// The fastest block: what others on the machine take is in all slower ones.
fn fastest(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

#[test]
fn a_lane_call_from_cpp_has_the_same_bits_and_its_time_is_printed_beside_rusts() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/c/lane.cpp");
    let Some(compiler) = present(&CPP).into_iter().next() else { return };
    let program = Program::compile(compiler, &source, &[]);
    let _server = Server::start("timed");
    let domain = Domain::at(&root()).unwrap();
    let mut robot = Robot::connect_in(domain, "timed", ConnectOptions::default()).unwrap();
    let query = robot.query(Request::InverseDynamics).given(["y", "yd", "ydd"]).want(["tau_u"]);
    let plan = query.prepare().unwrap();
    let mut tau_u = [0.0];
    let mut talk = program.talk(&["timed"]);
    let found: f64 = talk.line().parse().unwrap();
    let input = [0.2, 1.0, 0.0];
    robot.ask(plan, &input, &mut tau_u).unwrap().ok().unwrap();
    assert_eq!(found, tau_u[0]);

    let (mut rust, mut cpp) = (Vec::new(), Vec::new());
    for _ in 0..BLOCKS {
        let start = Instant::now();
        for _ in 0..CALLS {
            robot.ask(plan, &input, &mut tau_u).unwrap().ok().unwrap();
        }
        rust.push(start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS));
        talk.tell(&CALLS.to_string());
        cpp.push(talk.line().parse().unwrap());
    }
    talk.end();
    let (rust, cpp) = (fastest(&rust), fastest(&cpp));
    println!(
        "a lane call, fastest of {BLOCKS} blocks: Rust {rust:.0} ns, C++ {cpp:.0} ns, difference {:.0} ns",
        cpp - rust
    );
}
