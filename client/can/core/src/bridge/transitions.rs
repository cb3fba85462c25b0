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
        for number in 0..self.mechanisms.len() {
            let is_powered = self.mechanisms.get(number).is_some_and(Mechanism::is_powered);
            let fault = self.model.as_ref().and_then(|model| model.fault(number));
            if let (true, Some(reason)) = (is_powered, fault) {
                self.fail_mechanism(number, reason);
            }
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
        let Some(mechanism) = self.mechanisms.get_mut(number) else { return };
        let before = (mechanism.state, mechanism.reason);
        mechanism.fail(reason);
        if (mechanism.state, mechanism.reason) != before {
            self.faults += 1;
            self.last_fault = Some((number, reason));
        }
        if self.configuration.stop == Stop::Robot {
            self.mechanisms.iter_mut().for_each(|mechanism| mechanism.fail(Reason::OtherMechanism));
        }
    }

    /// Gives power to mechanisms that wait for it, each once it misses nothing; with `stop: robot`
    /// once none of them misses anything.
    pub(super) fn arm(&mut self, now_ns: u64, is_late: bool) {
        let arming_ns = self.configuration.timeouts.arming_ns;
        let is_waiting = |bridge: &Bridge, number: usize| {
            bridge.mechanisms.get(number).is_some_and(Mechanism::is_waiting)
        };
        let of_robot = match self.configuration.stop {
            Stop::Robot => (0..self.mechanisms.len())
                .filter(|number| is_waiting(self, *number))
                .find_map(|number| self.missing(number, now_ns, is_late)),
            Stop::Mechanism => None,
        };
        for number in 0..self.mechanisms.len() {
            if !is_waiting(self, number) {
                continue;
            }
            let missing = of_robot.or_else(|| self.missing(number, now_ns, is_late));
            if missing.is_none() {
                let mechanisms = &self.configuration.mechanisms;
                let is_member = |motor: &&mut Motor| is_of(mechanisms, motor, number);
                self.motors.iter_mut().filter(is_member).for_each(Motor::hold);
            }
            if let Some(mechanism) = self.mechanisms.get_mut(number) {
                mechanism.wait(now_ns, arming_ns, missing);
            }
        }
    }

    /// What a mechanism that is to be armed still waits for: of its motors and their buses, of its
    /// pose, of the controller.
    fn missing(&self, number: usize, now_ns: u64, is_late: bool) -> Option<Reason> {
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
        // the way back needs no controller, and leads to a pose that the model takes
        let returns = self.mechanisms.get(number).is_some_and(Mechanism::returns);
        let of_model = || self.model.as_ref().and_then(|model| model.missing(number, now_ns));
        let no_command =
            (is_late || self.command.stamp_ns <= self.armed_at).then_some(Reason::NoCommand);
        let is_member = |motor: &&Motor| is_of(&self.configuration.mechanisms, motor, number);
        let of_motors = self.motors.iter().filter(is_member).find_map(of_motor);
        of_motors.or_else(|| if returns { None } else { of_model().or(no_command) })
    }

    /// A mechanism whose motors all have power follows; one whose commands stay away is stopped.
    pub(super) fn follow(&mut self, number: usize, now_ns: u64, is_late: bool, is_lost: bool) {
        let mechanisms = &self.configuration.mechanisms;
        let is_member = |motor: &Motor| is_of(mechanisms, motor, number);
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
                Change::Stop(reaction) => motor.begin_stop(reaction),
            }
        }
    }
}

/// Whether a motor acts on a mechanism; `mechanisms` are those of the actuators.
pub(super) fn is_of(mechanisms: &[usize], motor: &Motor, number: usize) -> bool {
    mechanisms.get(motor.config.actuator) == Some(&number)
}
