//! The state of all actuators after a cycle.

use sarrus_proto::actuators::{MAX_ACTUATORS, MechanismState, Reason, flag};

use super::Bridge;
use super::course::Course;
use crate::drive::Power;
use crate::mapping::ActuatorMeasurement;

impl Bridge {
    /// The state after a cycle.
    pub(super) fn report(&mut self, now_ns: u64) {
        let state = &mut self.state;
        state.sequence += 1;
        state.stamp_ns = now_ns;
        state.command = self.command.sequence;
        let driven = self.mechanisms.iter().filter(|mechanism| !mechanism.motors.is_empty());
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
            let mechanism = self.mechanisms.get(motor.mechanism);
            let course = mechanism.and_then(|mechanism| mechanism.given);
            let is_ramping = matches!(course, Some(Course::Follow(ramp)) if ramp < 1.0);
            let flags = motor.flags
                | motor.lasting
                | bit(course == Some(Course::Damp), flag::DAMPED)
                | bit(course.is_some_and(Course::is_stop), flag::STOPPING)
                | bit(is_ramping, flag::RAMPING)
                | bit(motor.is_silent, flag::STALE)
                | bit(motor.drive.fault != 0, flag::MOTOR_FAULT)
                | bit(motor.drive.power == Power::On, flag::POWERED);
            put(&mut state.flags, actuator, flags);
            put(&mut state.faults, actuator, motor.fault());
            put(&mut state.measured_ns, actuator, motor.measured_ns.unwrap_or(0));
            put(&mut state.position, actuator, motor.measured.position);
            put(&mut state.velocity, actuator, motor.measured.velocity);
            put(&mut state.effort, actuator, motor.measured.effort);
            put(&mut state.temperature, actuator, motor.measured.temperature);
        }
    }
}

impl Bridge {
    /// Where each motor was last trusted, at its own shaft, by actuator, for the bridge's next
    /// start `[rad]`.
    pub fn positions(&self) -> impl Iterator<Item = (usize, f64)> {
        self.motors.iter().filter_map(|motor| {
            // with power the newest measurement is the monitors' business
            let position = match motor.seen_ns {
                Some(_) => motor.measured.position,
                None => motor.whereabouts.position()?,
            };
            Some((motor.config.actuator, motor.config.mapping.at_motor(position)))
        })
    }

    /// Takes the position at which a motor was trusted before this start `[rad]`.
    pub fn remember(&mut self, actuator: usize, at_motor: f64) {
        let mut motors = self.motors.iter_mut();
        if let Some(motor) = motors.find(|motor| motor.config.actuator == actuator) {
            let position = motor.config.mapping.at_actuator(at_motor);
            let measured = ActuatorMeasurement { position, ..ActuatorMeasurement::NONE };
            // as long ago as the monotonic clock can tell
            motor.whereabouts.trust(0, &measured);
        }
    }
}

fn bit(is_set: bool, flag: u32) -> u32 {
    if is_set { flag } else { 0 }
}

fn put<T>(array: &mut [T; MAX_ACTUATORS], place: usize, value: T) {
    if let Some(slot) = array.get_mut(place) {
        *slot = value;
    }
}
