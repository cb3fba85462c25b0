//! One input log, the same bytes: the library in this process, and the replay of both frontends.

use std::fmt::Write;
use std::process::{Command, Output};

use sarrus_can_core::bridge::{Bridge, BusEvent, CommandVerdict};
use sarrus_can_core::config::Configuration;
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_sim::{Physics, Simulated};
use sarrus_proto::actuators::{ActuatorCommand, MAX_ACTUATORS, Operation};
use sarrus_tests::python::environment;
use sarrus_tests::seed::Seeded;
use serde_json::json;

use super::harness::{BUSES, Frontend, Process, Stage, sarrus_can, wait_for};

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
        let simulated = |motor: &sarrus_can_core::config::MotorConfig| {
            (
                motor.bus,
                Simulated::new(motor.protocol.name, &motor.settings, motor.common, physics)
                    .unwrap(),
            )
        };
        let motors = configuration.motors.iter().map(simulated).collect();
        let (log, frames) = (String::new(), String::new());
        let bridge = Bridge::new(load());
        Session {
            log,
            frames,
            configuration,
            bridge,
            motors,
            now_ns: 1_234_567_891,
            sequence: 0,
            seeded: Seeded::new(seed),
        }
    }

    fn operate(&mut self, operation: Operation) {
        writeln!(self.log, "{}", json!({"t": self.now_ns, "operate": operation.name()})).unwrap();
        self.bridge.operate(self.now_ns, operation);
    }

    fn event(&mut self, bus: usize, name: &str, event: BusEvent, count: u32) {
        let line = json!({"t": self.now_ns, "event": name,
        "bus": self.configuration.buses[bus].name, "count": count});
        writeln!(self.log, "{line}").unwrap();
        self.bridge.bus_event(self.now_ns, bus, event);
    }

    fn command(&mut self) {
        self.command_with(|_| {});
    }

    /// A command of random numbers, changed.
    fn command_with(&mut self, change: impl FnOnce(&mut ActuatorCommand)) -> CommandVerdict {
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
        change(&mut command);
        // a number that is none becomes null
        let of = |numbers: &[f64; MAX_ACTUATORS]| numbers[..n_u].to_vec();
        let mut line = json!({"t": self.now_ns, "command": {
            "sequence": command.sequence, "stamp_ns": command.stamp_ns,
            "position": of(&command.position), "velocity": of(&command.velocity),
            "effort": of(&command.effort), "stiffness": of(&command.stiffness),
            "damping": of(&command.damping),
        }});
        // what is the configuration's need not be said
        if command.fingerprint != self.configuration.fingerprint {
            line["command"]["fingerprint"] = command.fingerprint.into();
        }
        if command.n_u != n_u as u64 {
            line["command"]["n_u"] = command.n_u.into();
        }
        writeln!(self.log, "{line}").unwrap();
        self.bridge.command(self.now_ns, &command)
    }

    /// Commands that are refused.
    fn bad_commands(&mut self) {
        let (now_ns, sequence) = (self.now_ns, self.sequence);
        assert_eq!(
            self.command_with(|command| command.position[3] = f64::NAN),
            CommandVerdict::NotFinite
        );
        assert_eq!(
            self.command_with(|command| command.effort[0] = f64::INFINITY),
            CommandVerdict::NotFinite
        );
        assert_eq!(
            self.command_with(|command| command.stiffness[1] = -1.0),
            CommandVerdict::Negative
        );
        assert_eq!(self.command_with(|command| command.sequence = sequence), CommandVerdict::Old);
        assert_eq!(
            self.command_with(|command| command.stamp_ns -= 1_000_000_000),
            CommandVerdict::Old
        );
        assert_eq!(
            self.command_with(|command| command.stamp_ns = now_ns + 10_000_000_000),
            CommandVerdict::Ahead
        );
        assert_eq!(
            self.command_with(|command| command.fingerprint ^= 1),
            CommandVerdict::WrongModel
        );
        assert_eq!(self.command_with(|command| command.n_u -= 1), CommandVerdict::WrongSize);
    }

    /// Frames that no motor sends: cut short, too long for what they say, of others.
    fn bad_frames(&mut self) {
        let before = self.bridge.bus_counters(0).unwrap().1.counts;
        for text in [
            "101#",
            "101#11",
            "101#FFFFFFFFFFFFFF",
            "102##1FFFFFFFFFFFFFFFF",
            "00000101#0102030405060708",
            "7AB#00",
            "1ABCDEF0#",
        ] {
            let bus = &self.configuration.buses[0].name;
            writeln!(self.log, "{}", json!({"t": self.now_ns, "frame": text, "bus": bus})).unwrap();
            self.bridge.receive(self.now_ns, 0, &Frame::from_text(text).unwrap());
        }
        let after = self.bridge.bus_counters(0).unwrap().1.counts;
        assert!(after.malformed > before.malformed && after.unknown > before.unknown);
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
                writeln!(
                    self.log,
                    "{}",
                    json!({"t": heard_ns, "frame": frame.to_string(), "bus": config.name})
                )
                .unwrap();
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
        assert_eq!(
            self.bridge.state().state,
            2,
            "the session is not enabled: {:?}",
            self.bridge.state().reason
        );
        self.bad_commands();
        self.bad_frames();
        self.cycles(5, true);
        self.event(0, "dropped", BusEvent::Dropped(3), 3);
        self.event(0, "backlog", BusEvent::Backlog(2), 2);
        self.cycles(5, true);
        self.event(0, "backlog", BusEvent::Backlog(0), 0);
        // late, and in time again
        self.cycles(80, false);
        self.cycles(60, true);
        // lost, and stopped
        self.cycles(400, false);
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
fn a_line_that_is_none_is_told_by_both_frontends_in_the_same_words() {
    let stage = Stage::new();
    let log = stage.folder.join("log.jsonl");
    let path = log.to_str().unwrap();
    for (line, word) in [
        ("[]", "no time"),
        ("{", "not JSON"),
        (r#"{"t": 1}"#, "says nothing"),
        (r#"{"t": -1, "cycle": true}"#, "no time"),
        (r#"{"t": 1.5, "cycle": true}"#, "no time"),
        (r#"{"t": Infinity, "cycle": true}"#, "not JSON"),
        (r#"{"t": 18446744073709551616, "cycle": true}"#, "no time"),
        (r#"{"t": 1, "frame": "1#", "bus": "left"}"#, "frame"),
        (r#"{"t": 1, "frame": "+12#00", "bus": "left"}"#, "frame"),
        (r#"{"t": 1, "frame": 5, "bus": "left"}"#, "frame"),
        (r#"{"t": 1, "frame": "123#00", "bus": "none"}"#, "none"),
        (r#"{"t": 1, "frame": "123#00"}"#, "no bus"),
        (r#"{"t": 1, "operate": "dance"}"#, "no such operation"),
        (r#"{"t": 1, "event": "rain", "bus": "left"}"#, "no such event"),
        (r#"{"t": 1, "event": "dropped", "count": -1, "bus": "left"}"#, "`count`"),
        (r#"{"t": 1, "event": "dropped", "count": 4294967296, "bus": "left"}"#, "`count`"),
        (r#"{"t": 1, "command": {"sequence": 1, "position": [NaN]}}"#, "not JSON"),
        (r#"{"t": 1, "command": {"sequence": 1, "position": ["1"]}}"#, "`position`"),
        (r#"{"t": 1, "command": {"sequence": 1, "position": 1}}"#, "`position`"),
        (r#"{"t": 1, "command": {"sequence": -1}}"#, "`sequence`"),
        (r#"{"t": 1, "command": {"torque": [1]}}"#, "`torque`"),
        (r#"{"t": 1, "command": null}"#, "no mapping"),
    ] {
        std::fs::write(&log, format!("{}\n\n{line}\n", r#"{"t": 0, "cycle": true}"#)).unwrap();
        let python = environment().can(&["replay", &stage.configuration, path]).output().unwrap();
        let rust = Command::new(sarrus_can())
            .args(["replay", &stage.configuration, path])
            .output()
            .unwrap();
        let text = |output: &Output| String::from_utf8(output.stderr.clone()).unwrap();
        assert_eq!(
            (python.status.code(), rust.status.code()),
            (Some(1), Some(1)),
            "{line}: {}{}",
            text(&python),
            text(&rust)
        );
        let rust = text(&rust);
        assert!(
            rust.starts_with(&format!("{path}:3:1: ")) && rust.contains(word),
            "{line}: {rust}"
        );
        assert_eq!(text(&python), format!("sarrus.can: {rust}"), "{line}");
    }
    // lists that are not given are zeros
    let line = r#"{"t": 1, "command": {"sequence": 1, "stamp_ns": 1}}"#;
    std::fs::write(&log, format!("{line}\n{}\n", r#"{"t": 2, "cycle": true}"#)).unwrap();
    let mut program = Command::new(sarrus_can());
    program.args(["replay", &stage.configuration, path]);
    let frames = replay(program);
    assert!(!frames.is_empty());
    assert_eq!(replay(environment().can(&["replay", &stage.configuration, path])), frames);
    // what is no text cannot be read
    std::fs::write(&log, b"\xFF\xFE\n").unwrap();
    let python = environment().can(&["replay", &stage.configuration, path]).output().unwrap();
    let rust =
        Command::new(sarrus_can()).args(["replay", &stage.configuration, path]).output().unwrap();
    assert_eq!((python.status.code(), rust.status.code()), (Some(2), Some(2)));
}

#[test]
fn a_run_that_was_logged_sends_the_same_frames_when_it_is_replayed() {
    let stage = Stage::new();
    let mut motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
    let (log, recording) = (stage.folder.join("run.jsonl"), stage.folder.join("run.log"));
    let (log, recording) = (log.to_str().unwrap(), recording.to_str().unwrap());
    let mut command = stage.bridge_command(Frontend::Python);
    command.args(["--log", log, "--record", recording]);
    let mut bridge = Process::start("bridge", command);
    assert!(bridge.line().starts_with("ready "));
    let mut controller = stage.controller();
    let mut powered = |desired: bool| {
        wait_for("power", || {
            motors
                .iter_mut()
                .flat_map(Process::report)
                .all(|motor| motor["power"] == desired)
                .then_some(())
        });
    };
    controller.tell("arm");
    powered(true);
    controller.tell("nan 3");
    powered(false);
    controller.tell("good");
    controller.tell("arm");
    powered(true);
    controller.tell("disarm");
    powered(false);
    bridge.signal("-INT");
    assert_eq!(bridge.end().code(), Some(0));

    let mut program = Command::new(sarrus_can());
    program.args(["replay", &stage.configuration, log]);
    let replayed = replay(program);
    assert!(
        replay(environment().can(&["replay", &stage.configuration, log])) == replayed,
        "the frontends differ"
    );
    let sent = std::fs::read_to_string(recording).unwrap();
    for (bus, actuators) in BUSES {
        // `(time) bus frame`, and in a recording whether it came or went
        let of_bus = |line: &str| line.split(' ').skip(1).map(str::to_owned).collect::<Vec<_>>();
        let frames = |text: &str, goes: bool| -> Vec<String> {
            let lines = text.lines().map(of_bus).filter(|line| line[0] == bus);
            lines
                .filter(|line| line.get(2).is_none_or(|way| (way == "T") == goes))
                .map(|mut line| line.swap_remove(1))
                .collect()
        };
        let (replayed, sent) = (frames(&replayed, true), frames(&sent, true));
        assert!(replayed.len() > 100 * actuators.len(), "{bus}: {} frames", replayed.len());
        assert_eq!(sent[..replayed.len()], replayed[..], "{bus}");
        // only the shutdown frames come after the last cycle
        assert!(
            sent.len() > replayed.len()
                && sent[replayed.len()..].iter().all(|frame| frame.ends_with("#FFFFFFFFFFFFFFFD")),
            "{bus}"
        );
    }
}
