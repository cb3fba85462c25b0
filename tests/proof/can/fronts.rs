//! One input log, the same bytes: the library in this process, and the replay of both fronts.

use std::fmt::Write;
use std::process::Command;

use sarrus_can::bridge::{Bridge, BusEvent};
use sarrus_can::config::Configuration;
use sarrus_can::frame::FrameQueue;
use sarrus_can::motor::{Physics, Simulated};
use sarrus_proto::actuators::{ActuatorCommand, MAX_ACTUATORS, Operation};
use sarrus_tests::python::environment;
use sarrus_tests::seed::Seeded;
use serde_json::json;

use super::harness::{Stage, sarrus_can};

const PERIOD_NS: u64 = 4_000_000;

/// A session with simulated motors in this process: what went into the bridge, and what came out.
struct Session {
    log: String,
    frames: String,
    configuration: Configuration,
    bridge: Bridge,
    motors: Vec<(usize, Simulated)>,
    now_ns: u64,
    sequence: u64,
    seeded: Seeded,
}

impl Session {
    fn new(path: &str, seed: u64) -> Session {
        let load = || Configuration::load(path.as_ref()).unwrap_or_else(|error| panic!("{error}"));
        let physics = Physics { inertia: 0.01, friction: 0.01, torque_limit: f64::INFINITY };
        let configuration = load();
        let simulated = |motor: &sarrus_can::config::MotorConfig| {
            (motor.bus, Simulated::new(motor.protocol.name, &motor.settings, motor.common, physics).unwrap())
        };
        let motors = configuration.motors.iter().map(simulated).collect();
        let (log, frames) = (String::new(), String::new());
        let bridge = Bridge::new(load());
        Session { log, frames, configuration, bridge, motors, now_ns: 1_234_567_891, sequence: 0, seeded: Seeded::new(seed) }
    }

    fn operate(&mut self, operation: Operation) {
        writeln!(self.log, "{}", json!({"t": self.now_ns, "operate": operation.name()})).unwrap();
        self.bridge.operate(self.now_ns, operation);
    }

    fn event(&mut self, bus: usize, name: &str, event: BusEvent, count: u32) {
        let line = json!({"t": self.now_ns, "event": name, "bus": self.configuration.buses[bus].name, "count": count});
        writeln!(self.log, "{line}").unwrap();
        self.bridge.bus_event(self.now_ns, bus, event);
    }

    fn command(&mut self) {
        self.sequence += 1;
        let n_u = self.configuration.actuators.len();
        let mut command = ActuatorCommand {
            sequence: self.sequence,
            stamp_ns: self.now_ns,
            fingerprint: self.configuration.fingerprint,
            n_u: n_u as u64,
            ..ActuatorCommand::default()
        };
        let mut random = |into: &mut [f64; MAX_ACTUATORS], from: f64, to: f64| {
            into.iter_mut().take(n_u).for_each(|number| *number = self.seeded.within(from, to));
        };
        random(&mut command.position, -0.2, 0.2);
        random(&mut command.velocity, -1.0, 1.0);
        random(&mut command.effort, -100.0, 100.0);
        random(&mut command.stiffness, 0.0, 100.0);
        random(&mut command.damping, 0.0, 10.0);
        let of = |numbers: &[f64; MAX_ACTUATORS]| numbers[..n_u].to_vec();
        let line = json!({"t": self.now_ns, "command": {
            "sequence": command.sequence, "stamp_ns": command.stamp_ns, "position": of(&command.position), "velocity": of(&command.velocity),
            "effort": of(&command.effort), "stiffness": of(&command.stiffness), "damping": of(&command.damping),
        }});
        writeln!(self.log, "{line}").unwrap();
        self.bridge.command(self.now_ns, &command);
    }

    /// A cycle, and what the motors answer before the next one.
    fn cycle(&mut self) {
        writeln!(self.log, "{}", json!({"t": self.now_ns, "cycle": true})).unwrap();
        self.bridge.cycle(self.now_ns);
        let (seconds, micros) = (self.now_ns / 1_000_000_000, self.now_ns / 1000 % 1_000_000);
        let mut out = FrameQueue::new(64);
        for (bus, config) in self.configuration.buses.iter().enumerate() {
            for frame in self.bridge.frames(bus) {
                writeln!(self.frames, "({seconds}.{micros:06}) {} {frame}", config.name).unwrap();
                let of_bus = self.motors.iter_mut().filter(|(place, _)| *place == bus);
                of_bus.for_each(|(_, motor)| {
                    let _ = motor.receive(self.now_ns + 100_000, frame, &mut out);
                });
            }
            let of_bus = self.motors.iter_mut().filter(|(place, _)| *place == bus);
            of_bus.for_each(|(_, motor)| motor.step(self.now_ns + 1_000_000, &mut out));
            for frame in out.frames() {
                let heard_ns = self.now_ns + 1_000_000;
                writeln!(self.log, "{}", json!({"t": heard_ns, "frame": frame.to_string(), "bus": config.name})).unwrap();
                self.bridge.receive(heard_ns, bus, frame);
            }
            out.clear();
        }
        self.now_ns += PERIOD_NS;
    }

    fn cycles(&mut self, n: usize, commands: bool) {
        for _ in 0..n {
            if commands {
                self.command();
            }
            self.cycle();
        }
    }

    /// Everything that can happen, in one session.
    fn play(&mut self) {
        self.cycles(40, true);
        self.operate(Operation::Arm);
        self.cycles(200, true);
        assert!((0..self.configuration.buses.len()).all(|bus| !self.bridge.frames(bus).is_empty()));
        assert_eq!(self.bridge.state().standing, 2, "the session is not enabled: {:?}", self.bridge.state().reason);
        self.event(0, "dropped", BusEvent::Dropped(3), 3);
        self.event(0, "backlog", BusEvent::Backlog(2), 2);
        self.cycles(5, true);
        self.event(0, "backlog", BusEvent::Backlog(0), 0);
        // late, and in time again
        self.cycles(80, false);
        self.cycles(60, true);
        // lost
        self.cycles(230, false);
        self.operate(Operation::Arm);
        self.cycles(120, true);
        self.event(0, "error_warning", BusEvent::ErrorWarning, 1);
        self.event(0, "overrun", BusEvent::Overrun(1), 1);
        self.event(0, "bus_off", BusEvent::BusOff, 1);
        self.cycles(20, true);
        self.event(0, "restarted", BusEvent::Restarted, 1);
        self.operate(Operation::Reset);
        self.cycles(300, true);
        self.operate(Operation::Arm);
        self.cycles(120, true);
        self.operate(Operation::Disarm);
        self.cycles(10, true);
    }
}

fn replay(mut command: Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn both_fronts_give_the_bytes_of_the_library_for_one_log() {
    let stage = Stage::new();
    let mut session = Session::new(&stage.configuration, 5);
    session.play();
    assert!(session.frames.lines().count() > 10_000);
    let log = stage.folder.join("log.jsonl");
    std::fs::write(&log, &session.log).unwrap();
    let log = log.to_str().unwrap();
    let python = replay(environment().can(&["replay", &stage.configuration, log]));
    assert!(python == session.frames, "the replay in Python differs from the library");
    let mut program = Command::new(sarrus_can());
    program.args(["replay", &stage.configuration, log]);
    assert!(replay(program) == session.frames, "the replay in Rust differs from the library");
}

#[test]
fn a_log_that_is_none_is_told_with_its_line() {
    let stage = Stage::new();
    let log = stage.folder.join("log.jsonl");
    for (line, word) in [
        ("[]", ""),
        ("{", ""),
        (r#"{"t": 1}"#, "neither"),
        (r#"{"t": 1, "frame": "1#", "bus": "left"}"#, "123#0011"),
        (r#"{"t": 1, "frame": "123#00", "bus": "none"}"#, "none"),
        (r#"{"t": 1, "operate": "dance"}"#, "dance"),
        (r#"{"t": 1, "event": "rain", "bus": "left"}"#, "rain"),
    ] {
        std::fs::write(&log, format!("{}\n{line}\n", r#"{"t": 0, "cycle": true}"#)).unwrap();
        let output = environment().can(&["replay", &stage.configuration, log.to_str().unwrap()]).output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{line}: {told}");
        assert!(told.contains("line 2: ") && told.contains(word), "{line}: {told}");
    }
}
