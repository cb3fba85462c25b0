//! What the bridge tells of all actuators after a cycle.

use sarrus_proto::actuators::{MAX_ACTUATORS, MechanismState, Reason, flag};

use super::Bridge;
use super::mechanism::Course;
use crate::drive::Power;

impl Bridge {
    /// The state after a cycle.
    pub(super) fn report(&mut self, now_ns: u64) {
        let state = &mut self.state;
        state.sequence += 1;
        state.stamp_ns = now_ns;
        state.command = self.command.sequence;
        let driven = self.mechanisms.iter().filter(|mechanism| mechanism.has_motors);
        let worst = driven.max_by_key(|mechanism| mechanism.severity());
        state.state = worst.map_or(MechanismState::Disabled, |worst| worst.state) as u32;
        state.reason = worst.map_or(Reason::None, |worst| worst.reason) as u32;
        for (actuator, number) in self.configuration.mechanisms.iter().enumerate() {
            let Some(mechanism) = self.mechanisms.get(*number) else { continue };
            put(&mut state.states, actuator, mechanism.state as u32);
            put(&mut state.reasons, actuator, mechanism.reason as u32);
            put(&mut state.flags, actuator, flag::NO_MOTOR);
        }
        for motor in &self.motors {
            let actuator = motor.config.actuator;
            let number = self
                .configuration
                .mechanisms
                .get(actuator)
                .and_then(|number| self.mechanisms.get(*number));
            let course =
                number.and_then(|mechanism| mechanism.course(now_ns, self.configuration.ramp_ns));
            let is_ramping = matches!(course, Some(Course::Follow(ramp)) if ramp < 1.0);
            let drive = motor.config.drive.state();
            let mut flags = motor.flags;
            for (is_set, bit) in [
                (course == Some(Course::Damp), flag::DAMPED),
                (matches!(course, Some(Course::Brake(_))), flag::STOPPING),
                (is_ramping, flag::RAMPING),
                (motor.is_stale(now_ns, self.configuration.timeouts.feedback_ns), flag::STALE),
                (drive.fault != 0, flag::MOTOR_FAULT),
                (drive.power == Power::On, flag::POWERED),
            ] {
                flags |= if is_set { bit } else { 0 };
            }
            put(&mut state.flags, actuator, flags);
            put(&mut state.faults, actuator, drive.fault);
            put(&mut state.measured_ns, actuator, motor.measured_ns.unwrap_or(0));
            put(&mut state.position, actuator, motor.measured.position);
            put(&mut state.velocity, actuator, motor.measured.velocity);
            put(&mut state.effort, actuator, motor.measured.effort);
            put(&mut state.temperature, actuator, motor.measured.temperature);
        }
    }
}

fn put<T>(array: &mut [T; MAX_ACTUATORS], place: usize, value: T) {
    if let Some(slot) = array.get_mut(place) {
        *slot = value;
    }
}
