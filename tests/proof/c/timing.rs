//! A call from C and C++ beside one from Rust, in process and through a lane, in one run with
//! alternating blocks of calls.

use std::path::Path;
use std::time::Instant;

use sarrus_client::{ConnectOptions, Domain, Options, Request, Robot, Source};

use super::{C, CPP, Program, Talk, present};
use crate::examples::{Server, root};

const BLOCKS: usize = 200;
const CALLS: u32 = 100;
const INPUT: [f64; 3] = [0.2, 1.0, 0.0];

/// The fastest block; other load on the machine only slows blocks down.
fn fastest(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Fastest block of Rust and of each program `[ns]`.
fn measure(mut robot: Robot, mut programs: Vec<Talk>) -> Vec<f64> {
    let query = robot.query(Request::InverseDynamics).given(["y", "yd", "ydd"]).want(["tau_u"]);
    let plan = query.prepare().unwrap();
    let mut tau_u = [0.0];
    robot.ask(plan, &INPUT, &mut tau_u).unwrap().ok().unwrap();
    for program in &mut programs {
        assert_eq!(program.line().parse(), Ok(tau_u[0]));
    }
    let mut times = vec![Vec::new(); 1 + programs.len()];
    for _ in 0..BLOCKS {
        let start = Instant::now();
        for _ in 0..CALLS {
            robot.ask(plan, &INPUT, &mut tau_u).unwrap().ok().unwrap();
        }
        times[0].push(start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS));
        for (program, times) in programs.iter_mut().zip(&mut times[1..]) {
            program.tell(&CALLS.to_string());
            times.push(program.line().parse().unwrap());
        }
    }
    programs.into_iter().for_each(Talk::end);
    times.iter().map(|times| fastest(times)).collect()
}

#[test]
fn a_call_from_c_and_cpp_has_the_same_bits_and_its_time_is_printed_beside_rusts() {
    let compile = |compilers: &[&'static str], name: &str, flags: &[&str]| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/c").join(name);
        let compiler = present(compilers).into_iter().next();
        compiler.map(|compiler| (compiler, Program::compile(compiler, &source, flags)))
    };
    let programs =
        [compile(&C, "calls.c", &["-D_POSIX_C_SOURCE=200809L"]), compile(&CPP, "calls.cpp", &[])];
    let programs: Vec<_> = programs.into_iter().flatten().collect();
    let _server = Server::start("timed");
    let domain = Domain::at(&root()).unwrap();
    let lane = Robot::connect_in(domain, "timed", ConnectOptions::default()).unwrap();
    let here = Robot::load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    for (name, robot, arguments) in
        [("in process", here, &[][..]), ("through a lane", lane, &["timed"])]
    {
        let talks = programs.iter().map(|(_, program)| program.talk(arguments)).collect();
        let times = measure(robot, talks);
        let others = programs.iter().map(|(compiler, _)| *compiler);
        for (by, time) in std::iter::once("Rust").chain(others).zip(&times) {
            let more = time - times[0];
            println!("{name}, fastest of {BLOCKS} blocks: {by} {time:.0} ns, {more:+.0} ns");
        }
    }
}
