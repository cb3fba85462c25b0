//! A session of a bridge on simulated time with every kind of event.

use std::fmt::Write;

use sarrus_can_core::bridge::{Bridge, BusEvent, CommandVerdict};
use sarrus_can_core::config::Configuration;
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_sim::{Physics, Simulated};
use sarrus_proto::actuators::{ActuatorCommand, MAX_ACTUATORS, MechanismState, Operation, Reason};
use sarrus_tests::seed::Seeded;
use serde_json::json;

const PERIOD_NS: u64 = 4_000_000;

/// A session with simulated motors in this process, with the bridge's input and output.
pub(super) struct Session {
    pub(super) log: String,
    pub(super) frames: String,
    configuration: Configuration,
    bridge: Bridge,
    motors: Vec<(usize, Simulated)>,
    now_ns: u64,
    sequence: u64,
    seeded: Seeded,
}

impl Session {
    pub(super) fn new(path: &str, seed: u64) -> Session {
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
        let log = String::new();
        let frames = String::new();
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

    /// Measured position of each actuator after the last cycle.
    pub(super) fn positions(&self) -> Vec<f64> {
        self.bridge.state().position[..self.configuration.actuators.len()].to_vec()
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

    /// A random command after a change.
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
        // within the limits of every monitor
        random(&mut command.position, -0.005, 0.005);
        random(&mut command.velocity, -0.05, 0.05);
        random(&mut command.effort, -1.0, 1.0);
        random(&mut command.stiffness, 0.0, 100.0);
        random(&mut command.damping, 0.0, 10.0);
        change(&mut command);
        // JSON has null for a NaN
        let of = |numbers: &[f64; MAX_ACTUATORS]| numbers[..n_u].to_vec();
        let mut line = json!({"t": self.now_ns, "command": {
            "sequence": command.sequence, "stamp_ns": command.stamp_ns,
            "position": of(&command.position), "velocity": of(&command.velocity),
            "effort": of(&command.effort), "stiffness": of(&command.stiffness),
            "damping": of(&command.damping),
        }});
        // omitted where it equals the configuration's
        if command.fingerprint != self.configuration.fingerprint {
            line["command"]["fingerprint"] = command.fingerprint.into();
        }
        if command.n_u != n_u as u64 {
            line["command"]["n_u"] = command.n_u.into();
        }
        writeln!(self.log, "{line}").unwrap();
        self.bridge.command(self.now_ns, &command)
    }

    /// Sends commands that are refused.
    fn bad_commands(&mut self) {
        let now_ns = self.now_ns;
        let sequence = self.sequence;
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

    /// Sends invalid frames: short ones, ones with a wrong length, frames of other devices.
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

    /// One cycle and the motors' answers to it.
    fn cycle(&mut self) {
        writeln!(self.log, "{}", json!({"t": self.now_ns, "cycle": true})).unwrap();
        self.bridge.cycle(self.now_ns);
        let seconds = self.now_ns / 1_000_000_000;
        let micros = self.now_ns / 1000 % 1_000_000;
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

    /// Plays every kind of event in one session.
    pub(super) fn play(&mut self) {
        self.cycles(40, true);
        self.operate(Operation::Arm);
        self.cycles(200, true);
        assert!((0..self.configuration.buses.len()).all(|bus| !self.bridge.frames(bus).is_empty()));
        self.demand("enabled");
        self.bad_commands();
        self.bad_frames();
        self.cycles(5, true);
        self.event(0, "dropped", BusEvent::Dropped(3), 3);
        self.event(0, "backlog", BusEvent::Backlog(2), 2);
        self.cycles(5, true);
        self.event(0, "backlog", BusEvent::Backlog(0), 0);
        // late, then in time again
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
        self.demand("enabled");
        // a stop, and one that is cut short
        self.operate(Operation::Disarm);
        self.cycles(250, true);
        self.demand("disabled");
        self.operate(Operation::Arm);
        self.cycles(120, true);
        self.demand("enabled");
        self.operate(Operation::Disarm);
        self.cycles(3, true);
        self.operate(Operation::Disarm);
        self.cycles(10, true);
        self.demand("disabled");
        // a fault of a motor, and its reset
        self.operate(Operation::Arm);
        self.cycles(120, true);
        self.demand("enabled");
        self.motors.iter_mut().take(1).for_each(|(_, motor)| motor.fault(0xA));
        self.cycles(200, true);
        self.demand("fault");
        self.motors.iter_mut().take(1).for_each(|(_, motor)| motor.fault(0));
        self.operate(Operation::Reset);
        self.cycles(300, true);
        self.operate(Operation::Arm);
        self.cycles(120, true);
        self.demand("enabled");
        // commands end
        self.cycles(450, false);
        self.demand("disabled");
    }

    /// Checks the state of the worst mechanism.
    fn demand(&self, expected: &str) {
        let state = self.bridge.state();
        let [name, why] = [
            MechanismState::from_code(state.state).map_or("unknown", MechanismState::name),
            Reason::from_code(state.reason).map_or("unknown", Reason::name),
        ];
        assert_eq!(name, expected, "{why}");
    }
}
