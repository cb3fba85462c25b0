//! Transitions between the states of a mechanism: power, its conditions and its end.

use sarrus_proto::actuators::Reason;

use super::mechanism::{Change, Mechanism, Members};
use super::motor::Motor;
use super::{Bridge, BusState};
use crate::config::Stop;
use crate::drive::Power;

impl Bridge {
    /// Motors that fail bring their mechanism, or the robot, to FAULT.
    pub(super) fn look_for_faults(&mut self, now_ns: u64) {
        for i in 0..self.motors.len() {
            let Some(motor) = self.motors.get(i) else { continue };
            let number = motor.mechanism;
            let drive = motor.drive;
            let Some(mechanism) =
                self.mechanisms.get(number).filter(|mechanism| mechanism.is_powered())
            else {
                continue;
            };
            let reason = if drive.fault != 0 {
                Reason::MotorFault
            } else if motor.is_silent {
                motor.silence(now_ns)
            } else if let Some(reason) = motor.config.wrong_watchdog(drive.watchdog) {
                reason
            } else if mechanism.needs_power() && drive.power != Power::On {
                Reason::PowerLost
            } else {
                continue;
            };
            self.fail_mechanism(number, reason);
        }
        let n_modelled = self.model.as_ref().map_or(0, |_| self.mechanisms.len());
        for number in 0..n_modelled {
            let is_powered = self.mechanisms.get(number).is_some_and(Mechanism::is_powered);
            let fault = self.model.as_ref().and_then(|model| model.fault(number));
            if let (true, Some(reason)) = (is_powered, fault) {
                self.fail_mechanism(number, reason);
            }
        }
    }

    pub(super) fn fail(&mut self, is_meant: impl Fn(&Motor) -> bool, reason: Reason) {
        for i in 0..self.motors.len() {
            if let Some(motor) = self.motors.get(i).filter(|motor| is_meant(motor)) {
                self.fail_mechanism(motor.mechanism, reason);
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
            let Some(mechanism) = self.mechanisms.get_mut(number) else { continue };
            if missing.is_none() {
                mechanism.each_motor(&mut self.motors, Motor::hold);
            }
            mechanism.wait(now_ns, arming_ns, missing);
        }
    }

    /// The condition that arming a mechanism still waits for: of its motors and their buses, of its
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
        let of_motor = |motor: &Motor| of_bus(motor).or_else(|| motor.missing(now_ns));
        // the way back needs no controller, and leads to a pose that the model takes
        let mechanism = self.mechanisms.get(number)?;
        let returns = mechanism.returns();
        let of_model = || self.model.as_ref().and_then(|model| model.missing(number, now_ns));
        let no_command =
            (is_late || self.command.stamp_ns <= self.armed_at).then_some(Reason::NoCommand);
        let of_motors = mechanism.motors(&self.motors).find_map(of_motor);
        of_motors.or_else(|| if returns { None } else { of_model().or(no_command) })
    }

    /// A mechanism whose motors all have power follows; one whose commands stay away is stopped.
    pub(super) fn follow(&mut self, number: usize, now_ns: u64, is_late: bool, is_lost: bool) {
        let Some(mechanism) = self.mechanisms.get_mut(number) else { return };
        let mut members = Members {
            all_on: true,
            all_off: true,
            runs_away: false,
            moves: false,
            is_outside: false,
            all_resting: true,
        };
        let still = mechanism.still();
        let is_stopping = mechanism.is_stopping();
        for motor in mechanism.motors(&self.motors) {
            let is_on = motor.drive.power == Power::On;
            members.all_on &= is_on;
            members.all_off &= !is_on;
            members.runs_away |= motor.runs_away();
            members.is_outside |= motor.is_outside();
            members.all_resting &= !is_stopping || motor.is_resting();
            members.moves |= motor.velocity.abs() > still;
        }
        let change = mechanism.follow(
            now_ns,
            self.configuration.timeouts.arming_ns,
            members,
            is_late,
            is_lost,
        );
        let Some(change) = change else { return };
        mechanism.each_motor(&mut self.motors, |motor| match change {
            Change::Begin => motor.hold(),
            Change::Late => motor.late(),
            Change::Resume => {
                let desired = self.command.position.get(motor.config.actuator).copied();
                motor.resume(desired.unwrap_or(motor.hold));
            }
            Change::Stop(reaction) => motor.begin_stop(reaction),
        });
    }
}
