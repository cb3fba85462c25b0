//! A bridge with plain motors that answer, one millisecond at a time.

use std::sync::atomic::{AtomicU32, Ordering};

use sarrus_models::Diagnostics;
use sarrus_models::yaml;
use sarrus_proto::actuators::{MAX_ACTUATORS, Operation};

use super::super::*;
use crate::config::{
    BusConfig, Commissioning, Limits, MechanismStop, MonitorBounds, MotorConfig, Stop, Timeouts,
};
use crate::drive::Power;
use crate::drive::{Drive, DriveState, Measurement, Mode, Reply, Setpoint, Watchdog};
use crate::frame::Id;
use crate::mapping::Mapping;
use crate::protocol::{Common, Protocol, Settings};
use sarrus_proto::actuators::MechanismState;

/// Motor and actuator are one.
pub(super) const DIRECT: Mapping =
    Mapping { sign: 1.0, gear: 1.0, offset: 0.0, torque_constant: 1.0 };
/// No monitor at all.
pub(super) const OFF: MonitorBounds = MonitorBounds {
    position: f64::INFINITY,
    velocity: f64::INFINITY,
    following: f64::INFINITY,
    effort: f64::INFINITY,
    frozen: f64::INFINITY,
    jump: f64::INFINITY,
    late: f64::INFINITY,
    second_answer: f64::INFINITY,
    second_master: false,
    derate: f64::INFINITY,
    temperature: f64::INFINITY,
    bus_passive: false,
};

pub(super) const MS: u64 = 1_000_000;
/// Steps after which motors count as at rest.
pub(super) const AT_REST: usize = 110;

/// Commands that a motor was given.
pub(super) type Given = std::sync::Arc<std::sync::Mutex<Vec<DriveCommand>>>;

/// A motor as simple as can be: one byte says off, on with a position of that many hundredths, or a
/// fault; the answer likewise.
#[derive(Debug)]
struct Plain {
    id: u16,
    state: DriveState,
    given: Given,
    watchdog_ms: std::sync::Arc<AtomicU32>,
}

impl Drive for Plain {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        self.given.lock().unwrap().push(command);
        if command == DriveCommand::Reset {
            self.state.fault = 0;
        }
        out.push_some(Frame::classic(
            Id::Standard(self.id),
            &[u8::from(matches!(command, DriveCommand::On(_)))],
        ));
    }
    fn encode(&self, _setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(Frame::classic(Id::Standard(self.id), &[1]));
    }
    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(Frame::classic(Id::Standard(self.id), &[0]));
    }
    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        if frame.id == Id::Standard(self.id) {
            return Receipt::Foreign;
        }
        if frame.id != Id::Standard(self.id + 16) {
            return Receipt::NotMine;
        }
        let (is_on, fault, position, velocity) = match frame.data() {
            [is_on, fault, position] => (*is_on, *fault, f64::from(*position) / 100.0, 0.0),
            [is_on, fault, _, _, rest @ ..] if rest.len() == 8 => {
                let (position, velocity) = rest.split_at(4);
                let number =
                    |bytes: &[u8]| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()));
                (*is_on, *fault, number(position), number(velocity))
            }
            _ => return Receipt::Malformed,
        };
        let watchdog = Watchdog::Set(self.watchdog_ms.load(Ordering::Relaxed));
        self.state = DriveState {
            power: if is_on == 1 { Power::On } else { Power::Off },
            fault: u32::from(fault),
            watchdog,
        };
        Receipt::Measured(Measurement { position, velocity, torque: 0.0, temperature: 30.0 })
    }
    fn state(&self) -> DriveState {
        self.state
    }
    fn forget(&mut self) {
        self.state = DriveState::default();
    }
    fn identifiers(&self) -> Vec<Id> {
        vec![Id::Standard(self.id), Id::Standard(self.id + 16)]
    }
    fn replies(&self) -> Vec<Reply> {
        Vec::new()
    }
}

crate::state::state!(Plain { state; id, given, watchdog_ms });

/// A shaft with an inertia and a load, turned by a motor of a mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaft {
    pub(super) mode: Mode,
    /// `[kg m²]`
    pub(super) inertia: f64,
    /// Torque of the load `[N m]`.
    pub(super) load: f64,
    pub(super) position: f64,
    pub(super) velocity: f64,
    /// Torque of the motor `[N m]`.
    pub(super) torque: f64,
    /// Where the load lies on something `[rad]`.
    pub(super) floor: f64,
    /// Which way its sensor counts.
    pub(super) sensor: f64,
}

impl Default for Shaft {
    fn default() -> Shaft {
        Shaft {
            mode: Mode::Impedance,
            inertia: 1.0,
            load: 0.0,
            position: 0.0,
            velocity: 0.0,
            torque: 0.0,
            floor: f64::NEG_INFINITY,
            sensor: 1.0,
        }
    }
}

impl Shaft {
    /// One millisecond in steps of fifty microseconds.
    fn turn(&mut self, command: DriveCommand) {
        for _ in 0..20 {
            let setpoint = match command {
                DriveCommand::On(setpoint) => setpoint,
                _ => Setpoint::default(),
            };
            // drives that follow positions or velocities have stiff controllers of their own
            let (stiffness, damping) = match (command, self.mode) {
                (DriveCommand::On(_), Mode::Position) => (1e4, 200.0),
                (DriveCommand::On(_), Mode::Velocity) => (0.0, 200.0),
                _ => (setpoint.stiffness / self.inertia, setpoint.damping / self.inertia),
            };
            self.torque = setpoint.torque
                + self.inertia * stiffness * (setpoint.position - self.position)
                + self.inertia * damping * (setpoint.velocity - self.velocity);
            self.velocity += 5e-5 * (self.torque + self.load) / self.inertia;
            self.position += 5e-5 * self.velocity;
            if self.position < self.floor {
                (self.position, self.velocity) = (self.floor, 0.0);
            }
        }
    }
}

static PLAIN: Protocol = Protocol {
    name: "plain",
    about: "",
    modes: &[Mode::Impedance],
    fd: false,
    keys: &[],
    make: |_, _, _| None,
};

/// A bridge over three plain motors: the first two on one mechanism and bus, the third alone on
/// another.
pub(super) struct Bench {
    pub(super) bridge: Bridge,
    pub(super) given: Vec<Given>,
    pub(super) now_ns: u64,
    pub(super) sequence: u64,
    /// Fault code in each motor's answers.
    pub(super) fault: [u8; 3],
    pub(super) answers: [bool; 3],
    pub(super) position: u8,
    /// Shafts that the motors turn, instead of the position of all.
    pub(super) shafts: Option<[Shaft; 3]>,
    /// Watchdog that each motor reports `[ms]`.
    pub(super) watchdog_ms: [std::sync::Arc<AtomicU32>; 3],
    pub(super) commands: bool,
    /// Commanded set-point.
    pub(super) target: Setpoint,
}

impl Bench {
    pub(super) fn new(change: impl Fn(&mut Configuration)) -> Bench {
        let given: Vec<Given> = (0..3).map(|_| std::sync::Arc::default()).collect();
        let watchdog_ms: [std::sync::Arc<AtomicU32>; 3] =
            core::array::from_fn(|_| std::sync::Arc::new(AtomicU32::new(50)));
        let settings = || {
            let mut diagnostics = Diagnostics::new(false);
            let node = yaml::read("", b"{}".to_vec(), "settings", &mut diagnostics).unwrap();
            Settings::read(&node, "", &[], &[], &|_| Err(String::new()), &mut diagnostics).unwrap()
        };
        let motor = |i: usize| MotorConfig {
            actuator: i,
            bus: i / 2,
            protocol: &PLAIN,
            settings: settings(),
            common: Common {
                mode: Mode::Impedance,
                watchdog_ms: 50,
                torque_limit: 10.0,
                velocity_limit: 100.0,
                period_ns: 0,
            },
            drive: Box::new(Plain {
                id: i as u16,
                state: DriveState::default(),
                given: given[i].clone(),
                watchdog_ms: watchdog_ms[i].clone(),
            }),
            mapping: DIRECT,
            is_calibrated: true,
            watchdog_believed: false,
            limits: Limits {
                lower: -1.0,
                upper: 1.0,
                velocity: 100.0,
                effort: 10.0,
                effort_rate: f64::INFINITY,
            },
            damping: 3.0,
            dither: 0.0,
            rest: None,
            monitors: OFF,
        };
        let bus = |name: &str| BusConfig {
            name: name.into(),
            interface: "none".into(),
            channel: name.into(),
            bitrate: 1_000_000,
            data_bitrate: None,
        };
        let mut configuration = Configuration {
            robot: None,
            source: None,
            fingerprint: 7,
            model: None,
            model_rules: crate::config::ModelRules { effort: 0.0, external: 0.0, clearance: 0.0 },
            actuators: ["a", "b", "c"].map(String::from).to_vec(),
            mechanisms: vec![0, 0, 1],
            rate_hz: 1000.0,
            timeouts: Timeouts {
                damping_ns: 20 * MS,
                disable_ns: 100 * MS,
                feedback_ns: 20 * MS,
                arming_ns: 500 * MS,
            },
            ramp_ns: 100 * MS,
            stop: Stop::Mechanism,
            stops: vec![MechanismStop::default(); 2],
            buses: vec![bus("x"), bus("y")],
            motors: (0..3).map(motor).collect(),
            encoders: Vec::new(),
            commissioning: Commissioning::Unneeded,
            record_file: String::new(),
            warnings: Vec::new(),
        };
        change(&mut configuration);
        let mut bridge = Bridge::new(configuration);
        // they stop at once: the braking distance has tests of its own
        for motor in &mut bridge.motors {
            motor.braking = [1e12, 1e-9];
            motor.free = [f64::NEG_INFINITY, f64::INFINITY];
        }
        Bench {
            bridge,
            given,
            now_ns: 5 * MS,
            sequence: 0,
            fault: [0; 3],
            answers: [true; 3],
            position: 20,
            shafts: None,
            watchdog_ms,
            commands: true,
            target: Setpoint { position: 0.5, torque: 1.0, stiffness: 2.0, ..Setpoint::default() },
        }
    }

    pub(super) fn command(&self) -> ActuatorCommand {
        ActuatorCommand {
            sequence: self.sequence,
            stamp_ns: self.now_ns,
            fingerprint: 7,
            n_u: 3,
            position: [self.target.position; MAX_ACTUATORS],
            velocity: [self.target.velocity; MAX_ACTUATORS],
            effort: [self.target.torque; MAX_ACTUATORS],
            stiffness: [self.target.stiffness; MAX_ACTUATORS],
            damping: [self.target.damping; MAX_ACTUATORS],
        }
    }

    /// One millisecond: a command, a cycle, and the answers of the motors to its frames.
    pub(super) fn step(&mut self) {
        self.now_ns += MS;
        if self.commands {
            self.sequence += 1;
            self.bridge.command(self.now_ns, &self.command());
        }
        self.bridge.cycle(self.now_ns);
        for (bus, reply) in self.replies() {
            self.bridge.receive(self.now_ns + MS / 4, bus, &reply);
        }
    }

    /// Answers of the motors to the frames of the last cycle, with their buses.
    pub(super) fn replies(&mut self) -> Vec<(usize, Frame)> {
        let mut replies = Vec::new();
        for i in 0..3_usize {
            let sent = self
                .bridge
                .frames(i / 2)
                .iter()
                .find(|frame| frame.id == Id::Standard(i as u16))
                .copied();
            if let (Some(frame), true) = (sent, self.answers[i]) {
                let id = Id::Standard(i as u16 + 16);
                let [is_on, fault] = [frame.data()[0], self.fault[i]];
                let answer = match &mut self.shafts {
                    None => Frame::classic(id, &[is_on, fault, self.position]).unwrap(),
                    Some(shafts) => {
                        shafts[i].turn(*self.given[i].lock().unwrap().last().unwrap());
                        let mut answer = vec![is_on, fault, 0, 0];
                        let Shaft { position, velocity, sensor, .. } = shafts[i];
                        answer.extend(((sensor * position) as f32).to_le_bytes());
                        answer.extend(((sensor * velocity) as f32).to_le_bytes());
                        Frame::fd(id, false, &answer).unwrap()
                    }
                };
                replies.push((i / 2, answer));
            }
        }
        replies
    }

    /// Reports an event of both buses.
    pub(super) fn each_bus(&mut self, event: BusEvent) {
        (0..2).for_each(|bus| self.bridge.bus_event(0, bus, event));
    }

    pub(super) fn steps(&mut self, n: usize) {
        (0..n).for_each(|_| self.step());
    }

    pub(super) fn armed() -> Bench {
        let mut bench = Bench::new(|_| {});
        bench.arm();
        bench
    }

    pub(super) fn arm(&mut self) {
        self.steps(AT_REST);
        self.bridge.operate(self.now_ns, Operation::Arm);
        self.steps(5);
        assert_eq!(self.states(), [MechanismState::Enabled; 3]);
    }

    /// One command more, which is the last, and ages.
    pub(super) fn send(&mut self, change: impl Fn(&mut ActuatorCommand)) {
        self.commands = false;
        self.sequence += 1;
        self.now_ns += 1;
        let mut command = self.command();
        change(&mut command);
        assert_eq!(self.bridge.command(self.now_ns, &command), CommandVerdict::Accepted);
    }

    pub(super) fn states(&self) -> [MechanismState; 3] {
        core::array::from_fn(|i| MechanismState::from_code(self.bridge.state().states[i]).unwrap())
    }

    pub(super) fn reason(&self, i: usize) -> Reason {
        Reason::from_code(self.bridge.state().reasons[i]).unwrap()
    }

    pub(super) fn last(&self, i: usize) -> DriveCommand {
        *self.given[i].lock().unwrap().last().unwrap()
    }

    pub(super) fn setpoint(&self, i: usize) -> Setpoint {
        match self.last(i) {
            DriveCommand::On(setpoint) => setpoint,
            other => panic!("motor {i} is given {other:?}"),
        }
    }
}
