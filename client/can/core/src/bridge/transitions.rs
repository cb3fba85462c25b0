//! From state to state: what brings a mechanism to power, keeps it there and takes it away.

use sarrus_proto::actuators::Reason;

use super::mechanism::{Change, Mechanism, Members};
use super::motor::Motor;
use super::{Bridge, BusState};
use crate::config::Stop;
use crate::drive::Power;

impl Bridge {
    /// Motors that fail bring their mechanism, or the robot, to FAULT.
    pub(super) fn look_for_faults(&mut self, now_ns: u64) {
        let feedback_ns = self.configuration.timeouts.feedback_ns;
        for i in 0..self.motors.len() {
            let Some(motor) = self.motors.get(i) else { continue };
            let Some(number) = self.configuration.mechanisms.get(motor.config.actuator).copied()
            else {
                continue;
            };
            let Some(mechanism) =
                self.mechanisms.get(number).filter(|mechanism| mechanism.is_powered())
            else {
                continue;
            };
            let drive = motor.config.drive.state();
            let reason = if drive.fault != 0 {
                Reason::MotorFault
            } else if motor.is_stale(now_ns, feedback_ns) {
                Reason::FeedbackStale
            } else if let Some(reason) = motor.config.wrong_watchdog(drive.watchdog) {
                reason
            } else if mechanism.needs_power() && drive.power != Power::On {
                Reason::PowerLost
            } else {
                continue;
            };
            self.fail_mechanism(number, reason);
        }
    }

    pub(super) fn fail(&mut self, is_meant: impl Fn(&Motor) -> bool, reason: Reason) {
        for i in 0..self.motors.len() {
            let number = self
                .motors
                .get(i)
                .filter(|motor| is_meant(motor))
                .and_then(|motor| self.configuration.mechanisms.get(motor.config.actuator));
            if let Some(number) = number.copied() {
                self.fail_mechanism(number, reason);
            }
        }
    }

    pub(super) fn fail_mechanism(&mut self, number: usize, reason: Reason) {
        self.mechanisms.get_mut(number).into_iter().for_each(|mechanism| mechanism.fail(reason));
        if self.configuration.stop == Stop::Robot {
            self.mechanisms.iter_mut().for_each(|mechanism| mechanism.fail(Reason::OtherMechanism));
        }
    }

    /// Gives power to mechanisms that wait for it, once nothing is missing anywhere.
    pub(super) fn arm(&mut self, now_ns: u64, is_late: bool) {
        if !self.mechanisms.iter().any(Mechanism::is_waiting) {
            return;
        }
        let missing = self.missing(now_ns, is_late);
        if missing.is_none() {
            let Bridge { motors, mechanisms, configuration, .. } = self;
            let of = |motor: &Motor| {
                configuration
                    .mechanisms
                    .get(motor.config.actuator)
                    .and_then(|number| mechanisms.get(*number))
            };
            let begins = |motor: &&mut Motor| of(motor).is_some_and(Mechanism::is_waiting);
            motors.iter_mut().filter(begins).for_each(Motor::hold);
        }
        let arming_ns = self.configuration.timeouts.arming_ns;
        for mechanism in &mut self.mechanisms {
            mechanism.wait(now_ns, arming_ns, missing);
        }
    }

    /// What arming still waits for: of the buses, of the motors that wait, of the controller.
    pub(super) fn missing(&self, now_ns: u64, is_late: bool) -> Option<Reason> {
        let is_waiting = |motor: &&Motor| self.mechanism(motor).is_some_and(Mechanism::is_waiting);
        let of_bus = |motor: &Motor| match self
            .buses
            .get(motor.config.bus)
            .map(|bus| (bus.state, bus.backlog))
        {
            Some((BusState::Off, _)) => Some(Reason::BusOff),
            Some((BusState::Passive, _)) => Some(Reason::BusPassive),
            Some((_, 1..)) => Some(Reason::Backlog),
            _ => None,
        };
        let feedback_ns = self.configuration.timeouts.feedback_ns;
        let of_motor = |motor: &Motor| of_bus(motor).or_else(|| motor.missing(now_ns, feedback_ns));
        let follows = |mechanism: &Mechanism| mechanism.is_waiting() && !mechanism.returns();
        let no_command = (is_late || self.command.stamp_ns <= self.armed_at)
            && self.mechanisms.iter().any(follows);
        let no_command = no_command.then_some(Reason::NoCommand);
        self.motors.iter().filter(is_waiting).find_map(of_motor).or(no_command)
    }

    /// The mechanism that a motor acts on.
    pub(super) fn mechanism(&self, motor: &Motor) -> Option<&Mechanism> {
        let number = self.configuration.mechanisms.get(motor.config.actuator)?;
        self.mechanisms.get(*number)
    }

    /// A mechanism whose motors all have power follows; one whose commands stay away is stopped.
    pub(super) fn follow(&mut self, number: usize, now_ns: u64, is_late: bool, is_lost: bool) {
        let mechanisms = &self.configuration.mechanisms;
        let is_member = |motor: &Motor| mechanisms.get(motor.config.actuator) == Some(&number);
        let Some(mechanism) = self.mechanisms.get_mut(number) else { return };
        let mut members = Members {
            all_on: true,
            all_off: true,
            runs_away: false,
            moves: false,
            is_outside: false,
        };
        for motor in self.motors.iter().filter(|motor| is_member(motor)) {
            let is_on = motor.config.drive.state().power == Power::On;
            members.all_on &= is_on;
            members.all_off &= !is_on;
            members.runs_away |= motor.runs_away();
            members.is_outside |= motor.is_outside();
            members.moves |= motor.velocity.abs() > mechanism.still();
        }
        let change = mechanism.follow(
            now_ns,
            self.configuration.timeouts.arming_ns,
            members,
            is_late,
            is_lost,
        );
        let Some(change) = change else { return };
        for motor in self.motors.iter_mut().filter(|motor| is_member(motor)) {
            match change {
                Change::Begin => motor.hold(),
                Change::Late => motor.late(),
                Change::Resume => {
                    let desired = self.command.position.get(motor.config.actuator).copied();
                    motor.resume(desired.unwrap_or(motor.hold));
                }
                Change::Stop => motor.begin_stop(),
            }
        }
    }
}
