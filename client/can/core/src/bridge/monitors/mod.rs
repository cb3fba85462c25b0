//! Monitors of measurements: one rule per file, each with its reason.
//!
//! A rule is a struct with its state for one motor. Rules for measurements have `check(&mut self,
//! seen)`; it is called for each new measurement while the motor has power. Noise of two codes on
//! every number must never cause a fault, so bounds are [`NOISE`] codes wider.

mod age;
mod answers;
mod effort;
mod following;
mod foreign;
mod frozen;
mod jump;
mod noise;
pub(super) mod position;
mod punctual;
mod temperature;
mod velocity;
mod watch;

pub(super) use noise::{DITHER, Noise};
pub(super) use punctual::Punctual;
use sarrus_proto::actuators::Reason;
#[cfg(test)]
pub(super) use {effort::lag, velocity::clocks};

use super::rest;
use crate::config::{Limits, MonitorBounds, MotorConfig};
use crate::drive::Mode;
use crate::event::BusState;
use crate::mapping::{ActuatorMeasurement, ActuatorSetpoint};
use crate::state::state;

/// Codes by which two equal numbers may differ, with two codes of noise on each.
const NOISE: f64 = 4.5;
/// Codes of protocols with exact numbers: those of an encoder of 14 bits, and of a speed that
/// is derived from it `[rad, rad/s]`.
const EXACT: [f64; 2] = [3.8e-4, 0.015];
/// Step of an exact effort, as part of its limit.
const EXACT_EFFORT: f64 = 0.002;

/// Input of all rules, on the actuator's side.
#[derive(Debug)]
pub(super) struct Seen<'a> {
    /// Bounds beyond which the motor's measurements are doubted, and one code of each number.
    pub(super) bounds: &'a MonitorBounds,
    pub(super) steps: &'a ActuatorSetpoint,
    /// Time between two cycles, and by how much measurements are taken at unequal ones `[s]`.
    pub(super) period: f64,
    pub(super) clocks: f64,
    /// The longest time from a set-point to a report that is not late `[s]`.
    pub(super) lag: f64,
    /// The newest measurement.
    pub(super) measured: &'a ActuatorMeasurement,
    /// The one before, and the time between the arrivals of the two `[s]`.
    pub(super) before: &'a ActuatorMeasurement,
    pub(super) elapsed: f64,
    /// How much older than its arrival the one before may be, and the newest `[s]`.
    pub(super) late: [f64; 2],
    /// The last two set-points.
    pub(super) asked: &'a [ActuatorSetpoint; 2],
    /// Effort of each of the two at the newest measurement `[N m, N]`; NaN where it needs a
    /// velocity that is not reported.
    pub(super) efforts: [f64; 2],
    /// The stiffness before spring and effort were made to stay within the limit.
    pub(super) stiffness: f64,
    pub(super) limits: &'a Limits,
    /// Deceleration of a stop, and its delay `[rad/s², m/s², s]`.
    pub(super) braking: &'a [f64; 2],
    /// The positions from which it can stop at any allowed speed.
    pub(super) free: &'a [f64; 2],
    /// A position that stays one code for longer is frozen `[s]`.
    pub(super) dwell: f64,
    pub(super) mode: Mode,
    /// Speed by which strokes of own loops in its mechanism may hide the mean one.
    pub(super) ripple: f64,
    /// It follows commands: neither late ones, nor a stop.
    pub(super) is_following: bool,
}

impl Seen<'_> {
    /// The longest and the shortest time that may have passed between the two measurements `[s]`.
    fn longest(&self) -> f64 {
        self.elapsed + self.late[0]
    }

    fn shortest(&self) -> f64 {
        (self.elapsed - self.late[1]).max(0.0)
    }

    /// How far the set-point goes in a cycle, by its position or its velocity; 0 for an effort.
    fn way_asked(&self) -> f64 {
        let [last, before] = self.asked;
        let [by_velocity, by_position] =
            [last.velocity * self.period, last.position - before.position];
        match self.mode {
            Mode::Velocity => by_velocity,
            Mode::Impedance | Mode::Torque if self.stiffness == 0.0 => 0.0,
            _ if by_velocity.abs() > by_position.abs() => by_velocity,
            _ => by_position,
        }
    }

    /// How far the actuator moved between the two measurements.
    fn way(&self) -> f64 {
        self.measured.position - self.before.position
    }
}

/// Effort of a set-point at a measurement; NaN where it needs a velocity that is not reported.
pub(super) fn effort_of(asked: &ActuatorSetpoint, measured: &ActuatorMeasurement) -> f64 {
    let mut total = asked.effort;
    if asked.stiffness != 0.0 {
        total += asked.stiffness * (asked.position - measured.position);
    }
    if asked.damping != 0.0 {
        total += asked.damping * (asked.velocity - measured.velocity);
    }
    total
}

/// The rules of one motor.
#[derive(Debug)]
pub(super) struct Monitors {
    pub(super) bounds: MonitorBounds,
    /// One code of each number.
    pub(super) steps: ActuatorSetpoint,
    /// The largest stiffness and damping that the motor can be given.
    largest_gains: [f64; 2],
    pub(super) age: age::Age,
    pub(super) punctual: Punctual,
    pub(super) answers: answers::Answers,
    pub(super) foreign: foreign::Foreign,
    pub(super) rules: Rules,
}

/// Rules for measurements; all but the temperature's start again with power.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rules {
    effort: effort::Effort,
    following: following::Following,
    frozen: frozen::Frozen,
    position: position::Position,
    velocity: velocity::Velocity,
    temperature: temperature::Temperature,
}

impl Rules {
    /// The reason to doubt a new measurement. Measurements that are wrong come first.
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        // each looks at every measurement, also where another has a finding
        let jump = jump::check(seen);
        let frozen = self.frozen.check(seen);
        let effort = self.effort.check(seen);
        let velocity = self.velocity.check(seen);
        let position = self.position.check(seen);
        let following = self.following.check(seen);
        let temperature = self.temperature.check(seen);
        jump.or(frozen).or(effort).or(velocity).or(position).or(following).or(temperature)
    }
}

impl Monitors {
    /// For a motor; a cycle and the time after which it counts as silent in ns.
    pub(super) fn new(config: &MotorConfig, period_ns: u64, feedback_ns: u64) -> Monitors {
        Monitors {
            bounds: config.monitors,
            steps: steps(config),
            largest_gains: config.drive.largest_gains().map(|gain| {
                gain * config.mapping.gear * config.mapping.gear * config.mapping.torque_constant
            }),
            age: age::Age::new(config.monitors.late, period_ns, feedback_ns),
            punctual: Punctual::default(),
            answers: answers::Answers::default(),
            foreign: foreign::Foreign::default(),
            rules: Rules::default(),
        }
    }

    /// The motor has no power: the rules start again.
    pub(super) fn begin(&mut self) {
        self.rules = Rules { temperature: self.rules.temperature, ..Rules::default() };
    }

    /// Checks without a measurement: the bus, and other masters on it.
    pub(super) fn check_bus(&self, now_ns: u64, bus: BusState) -> Option<Reason> {
        if self.age.is_late() {
            Some(Reason::FeedbackLate)
        } else if self.answers.is_second(&self.bounds) {
            Some(Reason::SecondAnswer)
        } else if self.bounds.second_master && self.foreign.is_heard(now_ns) {
            Some(Reason::SecondMaster)
        } else if self.bounds.bus_passive && bus == BusState::Passive {
            Some(Reason::BusPassive)
        } else {
            None
        }
    }

    /// A set-point as the motor gets it.
    pub(super) fn given(&self, setpoint: ActuatorSetpoint) -> ActuatorSetpoint {
        let [stiffness, damping] = self.largest_gains;
        ActuatorSetpoint {
            stiffness: setpoint.stiffness.min(stiffness),
            damping: setpoint.damping.min(damping),
            ..setpoint
        }
    }

    /// The part of the speed's limit that a hot motor keeps, from 0 to 1.
    pub(super) fn derated(&self) -> f64 {
        self.rules.temperature.part(&self.bounds)
    }

    /// The direction in which a position is outside the limits by more than its noise, where
    /// efforts outwards end: 1, −1, or 0 inside.
    pub(super) fn outwards(&self, limits: &Limits, position: f64) -> f64 {
        let noise = NOISE * self.steps.position;
        if position > limits.upper + noise {
            1.0
        } else if position < limits.lower - noise {
            -1.0
        } else {
            0.0
        }
    }

    /// Distance that a joint at rest keeps to for a tenth of a second, and its speed, with noise.
    pub(super) fn still(&self, limits: &Limits) -> [f64; 2] {
        let speed = rest::STILL * limits.speed();
        [speed * rest::REST + NOISE * self.steps.position, speed + NOISE * self.steps.velocity]
    }

    /// Distance that counts as none.
    pub(super) fn margin(&self, limits: &Limits) -> f64 {
        position::margin(limits, &self.bounds, &self.steps)
    }

    /// Whether a position is so far outside the limits that nothing may be armed there.
    pub(super) fn is_beyond(&self, limits: &Limits, position: f64) -> bool {
        let margin = self.margin(limits);
        position > limits.upper + margin || position < limits.lower - margin
    }
}

/// One code of each number, on the actuator's side.
fn steps(config: &MotorConfig) -> ActuatorSetpoint {
    let said = config.drive.steps();
    let gear = config.mapping.gear;
    let limit = config.limits.effort;
    let by_effort = gear * config.mapping.torque_constant;
    let [position, velocity] = EXACT;
    ActuatorSetpoint {
        position: if said.position > 0.0 { said.position } else { position } / gear,
        velocity: if said.velocity > 0.0 { said.velocity } else { velocity } / gear,
        effort: if said.torque > 0.0 { said.torque * by_effort } else { EXACT_EFFORT * limit },
        stiffness: said.stiffness * gear * by_effort,
        damping: said.damping * gear * by_effort,
    }
}

state!(Rules { effort, following, frozen, position, velocity, temperature });
state!(Monitors { age, punctual, answers, foreign, rules; bounds, steps, largest_gains });
