//! The rules: set-points of the motors in each cycle, from commands, measurements and the state of
//! the buses.
//!
//! Each closed mechanism goes DISABLED → ARMING → ENABLED, and to FAULT from both. Arming waits
//! until every motor measures, is calibrated, has no fault and an active watchdog, until the buses
//! are error-active with empty send queues, and until a controller commands. The first set-point is
//! the measured position without gains; gains, efforts and the motion to the commanded position
//! then grow together. Commands older than T1 cause damping, and new ones act at once. Commands
//! older than T2, `disarm`, and faults that leave the motors able to brake cause a controlled stop:
//! STOPPING, then DISABLED or FAULT. Nothing ever arms by itself.

mod assess;
mod bus;
mod chatter;
mod counters;
mod course;
mod mechanism;
mod model;
mod monitors;
mod motor;
mod operate;
mod reaction;
mod report;
mod rest;
mod setpoint;
mod snapshot;
mod stop;
#[cfg(test)]
mod tests;
mod transitions;
mod verdict;
mod whereabouts;

pub use counters::{BusCounters, Counters};
pub use sarrus_proto::counts::CommandVerdict;

pub use crate::event::{BusEvent, BusState};

use sarrus_proto::actuators::{ActuatorCommand, ActuatorState, Reason, flag};

use crate::config::{Commissioning, Configuration, MotorConfig};
use crate::drive::{DriveCommand, Power, Receipt};
use crate::frame::{Frame, FrameQueue};
use bus::{Bus, FRAMES_PER_MOTOR};
use course::Course;
use mechanism::Mechanism;
use model::RobotModel;
use motor::Motor;

/// A reset is repeated for this long to motors that keep a fault `[ns]`.
const RESET_NS: u64 = 1_000_000_000;

/// An uneven cycle is forgotten after some hundred cycles.
const UNEVEN: u64 = 64;

/// The bridge between commands and motors of one robot.
#[derive(Debug)]
pub struct Bridge {
    configuration: Configuration,
    motors: Vec<Motor>,
    mechanisms: Vec<Mechanism>,
    /// `None` without a model.
    model: Option<RobotModel>,
    buses: Vec<Bus>,
    command: ActuatorCommand,
    /// Stamp of the command when the robot was last asked to arm `[ns]`; arming waits for a later
    /// one.
    armed_at: u64,
    /// Stamp of the newest request to disarm `[ns]`.
    disarmed_at: u64,
    /// Whom it meant, as it travelled.
    disarmed: u32,
    /// Whether there was a command yet.
    commanded: bool,
    /// Since when a reset of each mechanism is under way `[ns]`.
    reset_ns: Vec<Option<u64>>,
    last_cycle_ns: Option<u64>,
    /// By how much cycles were longer or shorter than a period, lately at most `[ns]`.
    uneven_ns: u64,
    state: ActuatorState,
    counters: Counters,
    faults: u64,
    last_fault: Option<(usize, Reason)>,
}

impl Bridge {
    /// A bridge whose motors are all disabled. Allocates; nothing after it does.
    pub fn new(mut configuration: Configuration) -> Bridge {
        let model = RobotModel::new(&configuration);
        let buses = (0..configuration.buses.len()).map(|bus| {
            let motors = configuration.motors.iter().enumerate();
            let mut members = motors.filter(|(_, motor)| motor.bus == bus);
            let places = members.clone().map(|(place, _)| place).collect();
            Bus::new(places, members.find_map(|(_, motor)| motor.drive.sync()))
        });
        let buses = buses.collect();
        let period_ns = configuration.period_ns();
        let feedback_ns = configuration.feedback_ns();
        let number = |motor: &MotorConfig| {
            configuration.mechanisms.get(motor.actuator).copied().unwrap_or(usize::MAX)
        };
        let motors = std::mem::take(&mut configuration.motors);
        let own_loops = motors.iter().filter(|motor| motor.common.mode.has_own_loops());
        let rippled: Vec<usize> = own_loops.map(number).collect();
        let motors: Vec<Motor> = motors
            .into_iter()
            .map(|motor| {
                let number = number(&motor);
                let mut motor = Motor::new(motor, number, period_ns, feedback_ns);
                if rippled.contains(&number) {
                    motor.ripple = rest::STILL * motor.config.limits.speed();
                }
                if configuration.commissioning == Commissioning::Waived {
                    motor.lasting |= flag::UNCOMMISSIONED;
                }
                motor
            })
            .collect();
        let of_mechanism = |number: usize| {
            let members = motors.iter().enumerate().filter(|(_, motor)| motor.mechanism == number);
            members.map(|(place, _)| place).collect()
        };
        let mechanisms = (0..configuration.n_mechanisms())
            .map(|number| {
                let stop = configuration.stops.get(number).copied().unwrap_or_default();
                let of_number = motors.iter().filter(|motor| motor.mechanism == number);
                let has_rest = of_number.into_iter().all(|motor| motor.config.rest.is_some());
                Mechanism::new(of_mechanism(number), stop, has_rest)
            })
            .collect();
        let reset_ns = vec![None; configuration.n_mechanisms()];
        let state = ActuatorState {
            fingerprint: configuration.fingerprint,
            n_u: configuration.actuators.len() as u64,
            ..ActuatorState::default()
        };
        Bridge {
            configuration,
            motors,
            mechanisms,
            model,
            buses,
            command: ActuatorCommand::default(),
            armed_at: 0,
            disarmed_at: 0,
            disarmed: 0,
            commanded: false,
            reset_ns,
            last_cycle_ns: None,
            uneven_ns: 0,
            state,
            counters: Counters::default(),
            faults: 0,
            last_fault: None,
        }
    }

    /// The configuration, without its motors.
    pub fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Takes a frame that came on a bus at `now_ns`.
    pub fn receive(&mut self, now_ns: u64, bus: usize, frame: &Frame) {
        let Some(of_bus) = self.buses.get_mut(bus) else { return };
        of_bus.counters.counts.received += 1;
        for _ in 0..of_bus.members.len() {
            let place = of_bus.members.get(of_bus.next).or(of_bus.members.first());
            of_bus.next = if of_bus.next < of_bus.members.len() { of_bus.next + 1 } else { 1 };
            let Some(motor) = place.and_then(|place| self.motors.get_mut(*place)) else { continue };
            match motor.config.drive.receive(now_ns, frame) {
                Receipt::NotMine => continue,
                Receipt::Malformed => {
                    of_bus.counters.counts.malformed += 1;
                    motor.is_malformed = true;
                }
                Receipt::Foreign => {
                    of_bus.counters.foreign += 1;
                    if !of_bus.is_echo(frame) {
                        motor.monitors.foreign.hear(now_ns);
                    }
                }
                Receipt::Noted | Receipt::Parameter(..) => {}
                Receipt::Measured(measured) => {
                    if let Some(reply_ns) = motor.measured(now_ns, &measured) {
                        self.counters.reply_ns = reply_ns;
                        self.counters.replies += 1;
                    } else if !measured.position.is_finite() {
                        of_bus.counters.counts.malformed += 1;
                    }
                }
            }
            return;
        }
        if !self.model.as_mut().is_some_and(|model| model.receive(now_ns, bus, frame)) {
            of_bus.counters.counts.unknown += 1;
        }
    }

    /// Takes an event of a bus.
    pub fn bus_event(&mut self, now_ns: u64, bus: usize, event: BusEvent) {
        let Some(of_bus) = self.buses.get_mut(bus) else { return };
        of_bus.counters.add(event);
        match event {
            BusEvent::ErrorActive | BusEvent::Restarted => of_bus.state = BusState::Active,
            BusEvent::ErrorWarning => of_bus.state = BusState::Warning,
            BusEvent::ErrorPassive => of_bus.state = BusState::Passive,
            BusEvent::BusOff => of_bus.state = BusState::Off,
            BusEvent::Backlog(frames) => of_bus.backlog = frames,
            BusEvent::Dropped(_) | BusEvent::Overrun(_) => {}
            BusEvent::Late => {
                let period_ns = self.configuration.period_ns();
                let of_bus = self.motors.iter_mut().filter(|motor| motor.config.bus == bus);
                of_bus.for_each(|motor| motor.excuse(now_ns, period_ns));
            }
        }
        if matches!(event, BusEvent::BusOff | BusEvent::Restarted) {
            self.motors
                .iter_mut()
                .filter(|motor| motor.config.bus == bus)
                .for_each(|motor| motor.config.drive.forget());
        }
        if event == BusEvent::BusOff {
            self.fail(|motor| motor.config.bus == bus, Reason::BusOff);
        }
    }

    /// Takes a command, or returns why not; a rejected command changes nothing but a counter.
    pub fn command(&mut self, now_ns: u64, command: &ActuatorCommand) -> CommandVerdict {
        let verdict = self.assess(now_ns, command);
        self.counters.commands.add(verdict);
        if verdict == CommandVerdict::Accepted {
            self.command = *command;
            self.commanded = true;
        }
        verdict
    }

    /// One cycle: assesses, decides, and makes the frames to be sent now.
    pub fn cycle(&mut self, now_ns: u64) {
        // a clock that goes backwards is one that stood still for ever
        let gap_ns = self.last_cycle_ns.map_or(0, |last| now_ns.wrapping_sub(last));
        self.last_cycle_ns = Some(now_ns);
        self.counters.cycles += 1;
        self.buses.iter_mut().for_each(Bus::begin);

        // failures since the last cycle
        if gap_ns > self.configuration.timeouts.disable_ns {
            self.mechanisms.iter_mut().for_each(|mechanism| mechanism.torque_off(Reason::Stalled));
        }
        let feedback_ns = self.configuration.feedback_ns();
        // a deadline was missed
        let period_ns = self.configuration.period_ns();
        if gap_ns > 2 * period_ns {
            for motor in &mut self.motors {
                motor.own_late_ns = motor.own_late_ns.saturating_add(gap_ns - period_ns);
            }
        }
        self.uneven_ns -= self.uneven_ns / UNEVEN;
        self.uneven_ns = self.uneven_ns.max(gap_ns.abs_diff(period_ns).min(period_ns));
        for motor in &mut self.motors {
            motor.is_silent = motor.is_stale(now_ns, feedback_ns);
            motor.ask_drive();
        }
        self.assess_mechanisms(now_ns);
        self.look_for_faults(now_ns);
        self.look_at_measurements(now_ns);
        self.motors.iter_mut().for_each(Motor::forget_if_silent);

        // how old the command is
        let age_ns = now_ns.saturating_sub(self.command.stamp_ns);
        let is_late = !self.commanded || age_ns > self.configuration.timeouts.damping_ns;
        let is_lost = !self.commanded || age_ns > self.configuration.timeouts.disable_ns;
        self.counters.age_ns = age_ns;

        // where each mechanism goes
        self.arm(now_ns, is_late);
        for number in 0..self.mechanisms.len() {
            self.follow(number, now_ns, is_late, is_lost);
            if let Some(mechanism) = self.mechanisms.get_mut(number) {
                mechanism.given = mechanism.course(now_ns, self.configuration.ramp_ns);
            }
        }

        self.note_powered_buses();
        self.send_setpoints(now_ns, gap_ns);
        self.report(now_ns);
    }

    /// Notes which buses with a common frame have motors with power: these get the frame.
    fn note_powered_buses(&mut self) {
        for bus in self.buses.iter_mut().filter(|bus| bus.sync.is_some()) {
            bus.has_power = bus.members.iter().any(|place| {
                let motor = self.motors.get(*place);
                motor
                    .and_then(|motor| self.mechanisms.get(motor.mechanism))
                    .is_some_and(Mechanism::is_powered)
            });
        }
    }

    /// Makes the frames of each motor, and the common frame of each bus.
    fn send_setpoints(&mut self, now_ns: u64, gap_ns: u64) {
        let elapsed = gap_ns.min(2 * self.configuration.period_ns()) as f64 * 1e-9;
        for motor in &mut self.motors {
            let (Some(mechanism), Some(bus)) =
                (self.mechanisms.get(motor.mechanism), self.buses.get_mut(motor.config.bus))
            else {
                continue;
            };
            if motor.pauses(now_ns, mechanism.is_powered(), bus.has_power) {
                bus.is_synchronous &= motor.config.drive.sync().is_none();
                continue;
            }
            let since = self.reset_ns.get(motor.mechanism).copied().flatten();
            let is_reset = since.is_some_and(|since| now_ns.saturating_sub(since) < RESET_NS);
            motor.sent_ns = Some(now_ns);
            let n_before = bus.queue.frames().len();
            let course = mechanism.given;
            if course == Some(Course::QuickStop)
                && motor.config.drive.quick_stop(now_ns, &mut bus.queue)
            {
                motor.is_asked_nothing();
            } else {
                let command = match course {
                    Some(course) => {
                        DriveCommand::On(motor.setpoint(&self.command, course, elapsed))
                    }
                    None if is_reset && motor.drive.fault != 0 => DriveCommand::Reset,
                    None => DriveCommand::Off,
                };
                motor.config.drive.cycle(now_ns, command, &mut bus.queue);
            }
            // one that keeps its power is asked before the rules of the next cycle
            let keeps_power = course.is_some_and(|course| course != Course::QuickStop);
            if !keeps_power || motor.drive.power != Power::On {
                motor.ask_drive();
            }
            let mut n_frames = bus.queue.frames().len() - n_before;
            if n_frames > 1 {
                n_frames -= motor.heartbeats(bus.queue.frames().get(n_before..));
            }
            motor.ask(n_frames);
        }
        for bus in &mut self.buses {
            bus.queue.push_some(bus.sync.filter(|_| bus.is_synchronous));
        }
    }

    /// How many faults there were since the start, and the mechanism and reason of the last one.
    pub fn faults(&self) -> (u64, Option<(usize, Reason)>) {
        (self.faults, self.last_fault)
    }

    /// The frames of the last cycle for a bus, in the order of sending. Drop frames that cannot be
    /// sent at once: the next cycle has newer ones.
    pub fn frames(&self, bus: usize) -> &[Frame] {
        self.buses.get(bus).map_or(&[], |bus| bus.queue.frames())
    }

    /// Frames that take the power from every motor become those of [`Bridge::frames`]; for every
    /// way out. Send them several times.
    pub fn shutdown(&mut self) {
        self.mechanisms.iter_mut().for_each(|mechanism| mechanism.disable(Reason::Disarmed));
        for (number, bus) in self.buses.iter_mut().enumerate() {
            bus.queue.clear();
            let of_bus = self.motors.iter().filter(|motor| motor.config.bus == number);
            of_bus.for_each(|motor| motor.config.drive.disable(&mut bus.queue));
        }
    }

    /// The frames of a bus that [`Bridge::shutdown`] would make, to be kept for the worst case.
    /// Allocates.
    pub fn shutdown_frames(&self, bus: usize) -> Vec<Frame> {
        let mut queue = FrameQueue::new(self.motors.len() * FRAMES_PER_MOTOR);
        let of_bus = self.motors.iter().filter(|motor| motor.config.bus == bus);
        of_bus.for_each(|motor| motor.config.drive.disable(&mut queue));
        queue.frames().to_vec()
    }

    /// State of all actuators after the last cycle.
    pub fn state(&self) -> &ActuatorState {
        &self.state
    }

    /// Counts since the start.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Counts of a bus since the start, and its state.
    pub fn bus_counters(&self, bus: usize) -> Option<(BusState, &BusCounters)> {
        self.buses.get(bus).map(|bus| (bus.state, &bus.counters))
    }
}
