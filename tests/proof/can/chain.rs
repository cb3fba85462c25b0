//! The whole chain: encoders, the server, a controller (the example `follow`), the bridge, and
//! motors that move the robot.

use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::harness::{BUSES, Frontend, N_U, Process, Stage, sarrus_can, takes_power, wait_for};

#[test]
fn motors_go_safe_when_the_server_is_stopped_or_killed() {
    for signal in ["-STOP", "-KILL"] {
        // both frontends at once, each in a domain of its own
        let stage = Stage::new();
        let other = stage.beside();
        std::thread::scope(|scope| {
            scope.spawn(|| run_chain(Frontend::Rust, &stage, signal));
            scope.spawn(|| run_chain(Frontend::Python, &other, signal));
        });
    }
}

fn run_chain(frontend: Frontend, stage: &Stage, signal: &str) {
    let command = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(sarrus_can().with_file_name(program));
        command.args(arguments);
        stage.at_home(command)
    };
    let mut motors = Process::start(
        "motors",
        command("sarrus-can", &["simulate", &stage.configuration, "--pty", "--dynamics", "robot"]),
    );
    BUSES.iter().for_each(|_| assert!(motors.line().starts_with("ready ")));
    let server = Process::start(
        "server",
        command("sarrus", &["serve", "--name", "end_to_end", "--robot", "rh5v2_upper_body"]),
    );
    assert!(server.line().starts_with("ready "));
    let _bridge = stage.bridge(frontend);
    let _controller =
        Process::start("controller", command("examples/follow", &["end_to_end", "end_to_end"]));
    let operate = |operation: &str| {
        command("sarrus-can", &[operation, "end_to_end"]).output().unwrap().status.success()
    };
    // a fault of a late process is reset
    let armed = || (operate("arm") || operate("reset") && operate("arm")).then_some(());
    wait_for("power", armed);
    assert!(powers(&mut motors).iter().all(|power| *power), "{frontend:?} {signal}");

    server.signal(signal);
    let report = wait_for("motors without power", || {
        let report = motors.report();
        report.iter().all(|motor| motor["power"] == false).then_some(report)
    });
    // the bridge took the power, before the motors' own watchdogs did
    let took = |motor: &Value| motor["tripped"] == false && takes_power(motor);
    assert!(report.len() == N_U && report.iter().all(took), "{frontend:?} {signal}: {report:?}");
    let end = Instant::now() + Duration::from_millis(2 * stage.times[1]);
    while Instant::now() < end {
        assert!(powers(&mut motors).iter().all(|power| !*power), "{frontend:?} {signal}");
    }
}

fn powers(motors: &mut Process) -> Vec<bool> {
    motors.report().iter().map(|motor| motor["power"] == true).collect()
}
