//! The model's inputs from the motors, and its assessment of their mechanisms.

use sarrus_proto::actuators::MechanismState;

use super::Bridge;
use super::course::Course;
use super::model::{Activity, Measured};
use super::motor::Motor;
use crate::drive::Mode;

impl Bridge {
    /// Runs one cycle of the model, if there is one.
    pub(super) fn assess_mechanisms(&mut self, now_ns: u64) {
        let Bridge { model, motors, mechanisms, configuration, command, .. } = self;
        let Some(model) = model else { return };
        for motor in motors.iter() {
            let actuator = motor.config.actuator;
            let stiffness = command.stiffness.get(actuator).copied().unwrap_or(0.0);
            // only a held position can be one that the mechanism does not have
            let is_held = match motor.config.common.mode {
                Mode::Position => true,
                Mode::Impedance | Mode::Torque => stiffness > 0.0,
                Mode::Velocity => false,
            };
            let Motor { measured, last_position, .. } = motor;
            // own loops answer each set-point with a stroke, of which a report shows one moment
            let tells_effort = !motor.config.common.mode.has_own_loops();
            model.measure(
                actuator,
                Measured {
                    position: measured.position,
                    velocity: measured.velocity,
                    effort: if tells_effort { measured.effort } else { f64::NAN },
                    measured_ns: motor.measured_ns.unwrap_or(0),
                    setpoint: is_held.then_some(*last_position),
                },
            );
        }
        for (number, mechanism) in mechanisms.iter().enumerate() {
            let course = mechanism.course(now_ns, configuration.ramp_ns);
            let is_enabled = mechanism.state == MechanismState::Enabled;
            let activity = match course {
                None => Activity::Idle,
                Some(Course::Follow(ramp)) if is_enabled && ramp < 1.0 => Activity::Ramping,
                Some(Course::Follow(_)) if is_enabled => Activity::Following,
                Some(_) => Activity::Powered,
            };
            model.activity(number, activity);
        }
        model.cycle(now_ns);
        for motor in motors {
            motor.gravity = model.gravity(motor.config.actuator);
        }
    }
}
