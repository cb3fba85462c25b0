//! A bridge and its motors on simulated time: shafts with inertia, friction and load of their own,
//! which the motors' firmware turns, and everything that can go wrong between the two.

use std::collections::VecDeque;

use sarrus_can_core::bridge::{Bridge, BusEvent, CommandVerdict};
use sarrus_can_core::config::{Configuration, Limits, Surroundings};
use sarrus_can_core::drive::{Mode, Setpoint};
use sarrus_can_core::fault_log::{FaultLog, STATE_NS};
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::log::{self, Line, What};
use sarrus_can_core::mapping::Mapping;
use sarrus_can_sim::{Physics, Simulated};
use sarrus_models::LoadError;
use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Operation, Reason};

use super::robots::{self, Drawn, ENCODER_ID, ENCODER_STEP, Robot};

pub(crate) const MS: u64 = 1_000_000;
/// Time from a cycle to the motors, and from their answers to the bridge `[ns]`.
const THERE_NS: u64 = 100_000;
const BACK_NS: u64 = 200_000;
/// Step of the shafts `[ns]`.
const STEP_NS: u64 = 250_000;

/// Numbers by chance (SplitMix64).
#[derive(Clone, Debug)]
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (self.bits() >> 11) as f64 / (1_u64 << 53) as f64 * (high - low)
    }
}

/// False report of an encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Encoder {
    True,
    /// Turned against the motor.
    Reversed,
    /// The position repeats itself; the velocity is true, or zero.
    Frozen {
        position: f64,
        velocity_too: bool,
    },
    /// Its position is off by this.
    Off(f64),
}

/// A motor with its shaft, in the motor's coordinate.
pub(crate) struct Shaft {
    pub(crate) motor: Simulated,
    pub(crate) bus: usize,
    pub(crate) actuator: usize,
    pub(crate) mapping: Mapping,
    pub(crate) limits: Limits,
    pub(crate) mode: Mode,
    steps: Setpoint,
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    pub(crate) torque: f64,
    pub(crate) inertia: f64,
    pub(crate) friction: f64,
    /// Dry friction `[N m]`.
    pub(crate) dry: f64,
    pub(crate) load: f64,
    /// Step of its encoder; 0 where it is exact `[rad]`.
    pub(crate) quantum: f64,
    pub(crate) is_blocked: bool,
    /// The brake of a robot's motor holds it.
    pub(crate) is_braked: bool,
    /// The motor's torque with any set-point.
    pub(crate) stuck: Option<f64>,
    pub(crate) encoder: Encoder,
    /// It reports a velocity of 0.
    pub(crate) hides_velocity: bool,
    pub(crate) temperature: f64,
    /// Each answer comes twice.
    pub(crate) is_doubled: bool,
    /// Its answers have this identifier, and these four bits of a motor in their first byte.
    pub(crate) poses_as: Option<(Id, u8)>,
    pub(crate) delay_ns: u64,
    answers: VecDeque<(u64, Frame)>,
}

impl Shaft {
    fn sensed(&self) -> (f64, f64) {
        let position = match self.quantum {
            0.0 => self.position,
            quantum => quantum * (self.position / quantum).round(),
        };
        match self.encoder {
            Encoder::True => (position, self.velocity),
            Encoder::Reversed => (-position, -self.velocity),
            Encoder::Frozen { position, velocity_too: false } => (position, self.velocity),
            Encoder::Frozen { position, velocity_too: true } => (position, 0.0),
            Encoder::Off(by) => (position + by, self.velocity),
        }
    }

    /// Position and velocity of its actuator.
    pub(crate) fn at_actuator(&self) -> [f64; 2] {
        let part = self.mapping.sign / self.mapping.gear;
        [part * self.position + self.mapping.offset, part * self.velocity]
    }

    /// Effort against its friction at a velocity of its actuator.
    pub(crate) fn drag(&self, velocity: f64) -> f64 {
        let Mapping { gear, torque_constant, .. } = self.mapping;
        let dry = if velocity == 0.0 { 0.0 } else { self.dry * velocity.signum() };
        gear * torque_constant * (dry + self.friction * gear * velocity)
    }

    /// Takes the torque of the motor.
    fn drive(&mut self) {
        let (position, velocity) = self.sensed();
        self.motor.plant.carry(position, velocity);
        self.torque = self.stuck.unwrap_or(self.motor.plant.drive_torque());
    }

    fn turn(&mut self, seconds: f64) {
        if self.is_blocked {
            self.velocity = 0.0;
            return;
        }
        let total = self.torque + self.load - self.friction * self.velocity;
        self.velocity += seconds * total / self.inertia;
        let dry = (seconds * self.dry / self.inertia).min(self.velocity.abs());
        self.velocity -= dry * self.velocity.signum();
        self.position += seconds * self.velocity;
    }

    /// Alters the next report of the motor: noise of so many codes on each number.
    fn say(&mut self, noise: f64, chance: &mut Chance) {
        let (position, velocity) = self.sensed();
        // a frozen number has no noise
        let is_frozen = matches!(self.encoder, Encoder::Frozen { .. });
        let is_all = matches!(self.encoder, Encoder::Frozen { velocity_too: true, .. });
        let mut off = |step: f64, is_frozen: bool| {
            if noise == 0.0 || is_frozen {
                0.0
            } else {
                chance.within(-noise - 0.5, noise + 0.5).round() * step
            }
        };
        let plant = &mut self.motor.plant;
        plant.position = position + off(self.steps.position, is_frozen);
        plant.velocity = if self.hides_velocity { 0.0 } else { velocity };
        plant.velocity += off(self.steps.velocity, is_all);
        plant.torque = self.torque + off(self.steps.torque, false);
        plant.temperature = self.temperature;
    }
}

/// Input and frames of a bridge, as [`log`] writes both.
#[derive(Debug, Default)]
pub(crate) struct Record {
    pub(crate) lines: Vec<Line>,
    pub(crate) frames: Vec<String>,
    /// When each fault was, and [`log::fault`].
    pub(crate) faults: Vec<String>,
}

/// An answer as another motor would give it.
fn posing(frame: Frame, poses_as: Option<(Id, u8)>) -> Frame {
    let Some((id, tag)) = poses_as else { return frame };
    let mut data = frame.data().to_vec();
    if let Some(first) = data.first_mut() {
        *first = *first & 0xF0 | tag;
    }
    Frame::classic(id, &data).unwrap_or(frame)
}

/// Gives a line to a bridge and to the log of its faults, with the bridge's state once a second
/// from `since_ns` on.
pub(crate) fn keep(bridge: &mut Bridge, log: &mut FaultLog, since_ns: &mut u64, line: Line) {
    let t = line.t;
    let is_cycle = line.what == What::Cycle;
    assert!(line.apply(bridge), "a state of another bridge");
    log.push(line);
    if is_cycle && t.saturating_sub(*since_ns) >= STATE_NS {
        *since_ns = t;
        let mut room = bridge.room();
        assert!(bridge.save(&mut room));
        drop(log.state(t, room));
    }
}

pub(crate) struct World {
    pub(crate) bridge: Bridge,
    pub(crate) shafts: Vec<Shaft>,
    pub(crate) now_ns: u64,
    pub(crate) period_ns: u64,
    pub(crate) command: ActuatorCommand,
    pub(crate) chance: Chance,
    /// Part of the frames that are lost, there and back.
    pub(crate) loss: f64,
    /// Codes of noise.
    pub(crate) noise: f64,
    /// Largest lateness of a cycle, and of an answer `[ns]`.
    pub(crate) jitter_ns: [u64; 2],
    /// Until when every frame is lost, and until when answers are held back `[ns]`.
    pub(crate) lost_until_ns: u64,
    pub(crate) held_until_ns: u64,
    /// A frame of a second master in each cycle.
    pub(crate) intruder: Option<Frame>,
    /// Where it is recorded.
    pub(crate) record: Option<Record>,
    /// The robot that its shafts move; `None` where each has a load of its own.
    pub(crate) robot: Option<Robot>,
    /// By how much the encoder of the robot is wrong, and its frames on their way.
    pub(crate) slip: f64,
    pub(crate) encoder_frames: VecDeque<(u64, Frame)>,
    /// Commands are made for another robot.
    pub(crate) is_stranger: bool,
    /// Any verdict on a command is right.
    pub(crate) is_any_verdict: bool,
    /// The controller says nothing.
    pub(crate) is_mute: bool,
    /// Answers of the past, which come again from this one on instead of the true ones.
    pub(crate) tape: Option<(Vec<Frame>, Option<usize>)>,
    /// Room for the answers of one motor.
    pub(crate) out: FrameQueue,
}

impl World {
    pub(crate) fn new(configuration: Configuration, seed: u64) -> World {
        let shafts = configuration
            .motors
            .iter()
            .map(|motor| {
                let physics = Physics { inertia: 1.0, friction: 0.0, torque_limit: 1e3 };
                let protocol = motor.protocol.name;
                let simulated = Simulated::new(protocol, &motor.settings, motor.common, physics);
                Shaft {
                    motor: simulated.expect("a simulated motor"),
                    bus: motor.bus,
                    actuator: motor.actuator,
                    mapping: motor.mapping,
                    limits: motor.limits,
                    mode: motor.common.mode,
                    steps: motor.drive.steps(),
                    position: 0.0,
                    velocity: 0.0,
                    torque: 0.0,
                    inertia: 0.011,
                    friction: 0.008,
                    dry: 0.0,
                    load: 0.0,
                    quantum: 0.0,
                    is_blocked: false,
                    is_braked: false,
                    stuck: None,
                    encoder: Encoder::True,
                    hides_velocity: false,
                    temperature: 30.0,
                    is_doubled: false,
                    poses_as: None,
                    delay_ns: 0,
                    answers: VecDeque::new(),
                }
            })
            .collect();
        let command = ActuatorCommand {
            fingerprint: configuration.fingerprint,
            n_u: configuration.actuators.len() as u64,
            ..ActuatorCommand::default()
        };
        World {
            period_ns: configuration.period_ns(),
            bridge: Bridge::new(configuration),
            shafts,
            now_ns: 1_000 * MS,
            command,
            chance: Chance(seed),
            loss: 0.0,
            noise: 0.0,
            jitter_ns: [0, 0],
            lost_until_ns: 0,
            held_until_ns: 0,
            intruder: None,
            record: None,
            robot: None,
            slip: 0.0,
            encoder_frames: VecDeque::new(),
            is_stranger: false,
            is_any_verdict: false,
            is_mute: false,
            tape: None,
            out: FrameQueue::new(64),
        }
    }

    /// The motors of a robot; `None` where a bus is too slow for them.
    pub(crate) fn of_robot(drawn: &Drawn) -> Option<World> {
        let surroundings = Surroundings {
            file: &|_| Err("absent".into()),
            robot: &|_| robots::loaded(drawn.name),
        };
        let read = Configuration::read("robot.yml", drawn.text.clone().into(), &surroundings);
        let configuration = match read {
            Ok(configuration) => configuration,
            Err(report) if report.to_string().contains("load") => return None,
            Err(report) => panic!("{report}\n{}", drawn.text),
        };
        let robot = Robot::new(configuration.model.clone()?, drawn.encoder);
        let mut world = World::new(configuration, 1);
        for shaft in &mut world.shafts {
            [shaft.position, shaft.velocity] = robot.shaft(shaft);
        }
        world.robot = Some(robot);
        Some(world)
    }

    /// The configuration of one motor of a drive, as the first one on a bench: 250 Hz, ± 3 rad,
    /// 5 rad/s, 2 N m.
    pub(crate) fn text(drive: &str, more: &str) -> String {
        format!(
            "rate_hz: 250\nbuses:\n- {{name: bench, interface: none, channel: none, bitrate: \
            1000000, data_bitrate: 5000000}}\nramp_ms: 100\nmotors:\n- actuator: motor\n  bus: \
            bench\n  drive: {drive}\n  offset: 0\n  limits: {{position: [-3, 3], velocity: 5, \
            effort: 2}}\n  damping: 0.1\n  watchdog_ms: 50\n  watchdog: believed\n{more}"
        )
    }

    /// Such a motor.
    pub(crate) fn one(drive: &str, more: &str) -> World {
        World::read(World::text(drive, more))
    }

    /// The motors of a configuration.
    pub(crate) fn read(text: String) -> World {
        World::read_beside(text, "")
    }

    /// As [`World::read`], beside a file of the motors' signals.
    pub(crate) fn read_beside(text: String, file: &str) -> World {
        let surroundings = Surroundings {
            file: &|_| Ok(file.into()),
            robot: &|_| Err(LoadError::Open("robot".into(), "absent".into())),
        };
        let read = Configuration::read("bench.yml", text.into_bytes(), &surroundings);
        World::new(read.unwrap_or_else(|report| panic!("{report}")), 1)
    }

    /// One cycle: a command, the frames of the bridge, and the time until the next one.
    pub(crate) fn cycle(&mut self) {
        let [late_ns, back_ns] = self.jitter_ns;
        let later = |chance: &mut Chance, most: u64| chance.within(0.0, most as f64) as u64;
        let begin_ns = self.now_ns;
        let cycle_ns = begin_ns + later(&mut self.chance, late_ns);
        if !self.is_mute {
            self.say(cycle_ns);
        }
        self.put(cycle_ns, What::Cycle);
        // a robot's brakes open for motors that follow; some of them rest at an effort of zero
        for i in 0..if self.robot.is_some() { self.shafts.len() } else { 0 } {
            let (state, _) = self.state(self.shafts[i].actuator);
            let follows = matches!(state, MechanismState::Enabled | MechanismState::Stopping);
            self.shafts[i].is_braked = !follows;
        }

        // to the motors
        let mut out = std::mem::replace(&mut self.out, FrameQueue::new(0));
        for i in 0..self.shafts.len() {
            let mut sent: Vec<Frame> = self.bridge.frames(self.shafts[i].bus).to_vec();
            sent.extend(self.intruder.filter(|_| self.shafts[i].bus == 0));
            let heard_ns = cycle_ns + THERE_NS;
            for frame in &sent {
                if self.chance.within(0.0, 1.0) < self.loss || heard_ns < self.lost_until_ns {
                    continue;
                }
                self.shafts[i].say(self.noise, &mut self.chance);
                self.shafts[i].motor.receive(heard_ns, frame, &mut out);
                self.collect(i, heard_ns, &mut out, back_ns);
            }
        }
        if let Some(frame) = self.intruder {
            self.put(cycle_ns + THERE_NS, What::Frame(0, frame));
        }

        // and time goes by
        let end_ns = begin_ns + self.period_ns;
        while self.now_ns < end_ns {
            self.now_ns = (self.now_ns + STEP_NS).min(end_ns);
            self.turn(STEP_NS as f64 * 1e-9);
            for i in 0..self.shafts.len() {
                self.shafts[i].say(self.noise, &mut self.chance);
                self.shafts[i].motor.tick(self.now_ns, &mut out);
                self.collect(i, self.now_ns, &mut out, back_ns);
                while let Some((at_ns, frame)) = self.shafts[i].answers.front().copied() {
                    if at_ns > self.now_ns {
                        break;
                    }
                    self.shafts[i].answers.pop_front();
                    self.put(at_ns, What::Frame(self.shafts[i].bus, frame));
                }
            }
            while let Some((at_ns, frame)) = self.encoder_frames.front().copied() {
                if at_ns > self.now_ns {
                    break;
                }
                self.encoder_frames.pop_front();
                self.put(at_ns, What::Frame(0, frame));
            }
        }
        self.out = out;
        self.tell(back_ns);
    }

    /// The controller commands.
    fn say(&mut self, cycle_ns: u64) {
        self.command.sequence += 1;
        self.command.stamp_ns = cycle_ns;
        let verdict = self.bridge.command(cycle_ns, &self.command);
        let expected = match self.is_stranger {
            true => CommandVerdict::WrongModel,
            false => CommandVerdict::Accepted,
        };
        assert!(self.is_any_verdict || verdict == expected, "{verdict:?}");
        if self.record.is_some() {
            self.note(cycle_ns, What::Command(Box::new(self.command)));
        }
    }

    /// The shafts turn under the torques of their motors.
    fn turn(&mut self, seconds: f64) {
        self.shafts.iter_mut().for_each(Shaft::drive);
        let Some(robot) = &mut self.robot else {
            return self.shafts.iter_mut().for_each(|shaft| shaft.turn(seconds));
        };
        robot.step(&self.shafts, seconds);
        for shaft in &mut self.shafts {
            [shaft.position, shaft.velocity] = robot.shaft(shaft);
        }
    }

    /// The encoder of the robot reports.
    fn tell(&mut self, back_ns: u64) {
        let Some(angle) = self.robot.as_ref().and_then(Robot::encoder) else { return };
        let at_ns = self.now_ns + BACK_NS + self.chance.within(0.0, back_ns as f64) as u64;
        let at_ns = at_ns.max(self.held_until_ns);
        let at_ns = self.encoder_frames.back().map_or(at_ns, |(last, _)| at_ns.max(*last));
        if self.chance.within(0.0, 1.0) < self.loss || self.now_ns < self.lost_until_ns {
            return;
        }
        let [low, high] = (((angle + self.slip) / ENCODER_STEP).round() as i16).to_le_bytes();
        let frame = Frame::classic(Id::Standard(ENCODER_ID), &[0, low, high]);
        self.encoder_frames.extend(frame.map(|frame| (at_ns, frame)));
    }

    fn collect(&mut self, i: usize, now_ns: u64, out: &mut FrameQueue, back_ns: u64) {
        let shaft = &mut self.shafts[i];
        for frame in out.frames() {
            let mut frame = *frame;
            match &mut self.tape {
                Some((frames, None)) => frames.push(frame),
                Some((frames, Some(next))) => {
                    frame = frames[*next % frames.len()];
                    *next += 1;
                }
                None => {}
            }
            let at_ns =
                now_ns + BACK_NS + shaft.delay_ns + self.chance.within(0.0, back_ns as f64) as u64;
            let at_ns = at_ns.max(self.held_until_ns);
            // a bus keeps the order
            let at_ns = shaft.answers.back().map_or(at_ns, |(last, _)| at_ns.max(*last));
            for _ in 0..1 + usize::from(shaft.is_doubled) {
                if self.chance.within(0.0, 1.0) >= self.loss && now_ns >= self.lost_until_ns {
                    shaft.answers.push_back((at_ns, posing(frame, shaft.poses_as)));
                }
            }
        }
        out.clear();
    }

    /// Gives the bridge something.
    fn put(&mut self, t: u64, what: What) {
        let (before, _) = self.bridge.faults();
        Line { t, what: what.clone() }.apply(&mut self.bridge);
        if let (Some(record), (now, _)) = (&mut self.record, self.bridge.faults())
            && now != before
        {
            let fault = log::fault(&self.bridge).unwrap_or_default();
            record.faults.push(format!("{t} ns {fault}"));
        }
        if let (Some(record), What::Cycle) = (&mut self.record, &what) {
            record.frames.extend(log::sent(&self.bridge, t));
        }
        self.note(t, what);
    }

    fn note(&mut self, t: u64, what: What) {
        if let Some(record) = &mut self.record {
            record.lines.push(Line { t, what });
        }
    }

    pub(crate) fn operate(&mut self, operation: Operation) {
        self.put(self.now_ns, What::Operate(operation, None));
    }

    pub(crate) fn event(&mut self, bus: usize, event: BusEvent) {
        self.put(self.now_ns, What::Event(bus, event));
    }

    pub(crate) fn cycles(&mut self, n: usize) {
        (0..n).for_each(|_| self.cycle());
    }

    pub(crate) fn state(&self, actuator: usize) -> (MechanismState, Reason) {
        let state = self.bridge.state();
        (
            MechanismState::from_code(state.states[actuator]).expect("a state"),
            Reason::from_code(state.reasons[actuator]).expect("a reason"),
        )
    }

    /// Whether all follow.
    pub(crate) fn is_enabled(&self) -> bool {
        self.shafts.iter().all(|shaft| self.state(shaft.actuator).0 == MechanismState::Enabled)
    }

    /// Asks for power until all have it; the milliseconds that it took, or `None` after three
    /// seconds.
    pub(crate) fn arm(&mut self) -> Option<u64> {
        let begin_ns = self.now_ns;
        self.cycles((1_500 * MS / self.period_ns) as usize);
        self.operate(Operation::Arm);
        while self.now_ns < begin_ns + 4_500 * MS {
            self.cycle();
            if self.is_enabled() {
                return Some((self.now_ns - begin_ns) / MS - 1_500);
            }
        }
        None
    }

    /// The first of the actuators that does not follow, by its state and reason.
    pub(crate) fn stopped(&self) -> Option<(MechanismState, Reason)> {
        let states = self.shafts.iter().map(|shaft| self.state(shaft.actuator));
        states.into_iter().find(|(state, _)| *state != MechanismState::Enabled)
    }

    /// Commands all actuators alike.
    pub(crate) fn give(&mut self, setpoint: Setpoint) {
        for u in 0..self.command.n_u as usize {
            self.command.position[u] = setpoint.position;
            self.command.velocity[u] = setpoint.velocity;
            self.command.effort[u] = setpoint.torque;
            self.command.stiffness[u] = setpoint.stiffness;
            self.command.damping[u] = setpoint.damping;
        }
    }
}
