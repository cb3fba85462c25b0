//! Maps between an actuator and its motor: sign, gear, offset and torque constant, in one place for
//! every path.
//!
//! q = s q_m / N + o, q̇ = s q̇_m / N, and since both sides have the same power τ q̇ = τ_m q̇_m,
//! τ_m = s τ / N. A spring or damper at the actuator is N² times softer at the motor. The torque
//! constant maps a protocol's torque to the true one, τ_m = k τ_said, and its gains likewise.

use crate::drive::{Measurement, Setpoint};
use crate::state::state;

/// The map from a motor's coordinate to its actuator's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    /// s: 1, or −1 if actuator and motor move in opposite directions.
    pub sign: f64,
    /// N: motor rotation per actuator rotation `[rad/rad]` or translation `[rad/m]`; greater than
    /// 0.
    pub gear: f64,
    /// o: the actuator's position at a motor position of 0 `[rad, m]`.
    pub offset: f64,
    /// k: true torque per unit of protocol torque; greater than 0.
    pub torque_constant: f64,
}

/// A set-point or a measurement of an actuator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActuatorSetpoint {
    /// Position `[rad, m]`.
    pub position: f64,
    /// Velocity `[rad/s, m/s]`.
    pub velocity: f64,
    /// Moment or force `[N m, N]`.
    pub effort: f64,
    /// Stiffness `[N m/rad, N/m]`.
    pub stiffness: f64,
    /// Damping `[N m s/rad, N s/m]`.
    pub damping: f64,
}

/// Measurement of an actuator's motor, on the actuator's side; NaN for numbers without a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorMeasurement {
    /// Position `[rad, m]`.
    pub position: f64,
    /// Velocity `[rad/s, m/s]`.
    pub velocity: f64,
    /// Moment or force `[N m, N]`.
    pub effort: f64,
    /// Temperature of the motor `[°C]`.
    pub temperature: f64,
}

impl ActuatorMeasurement {
    /// Nothing is known.
    pub const NONE: ActuatorMeasurement = ActuatorMeasurement {
        position: f64::NAN,
        velocity: f64::NAN,
        effort: f64::NAN,
        temperature: f64::NAN,
    };
}

impl Mapping {
    /// Where the motor's own shaft is `[rad]`.
    pub(crate) fn at_motor(&self, position: f64) -> f64 {
        self.sign * self.gear * (position - self.offset)
    }

    /// Where the actuator is `[rad, m]`.
    pub(crate) fn at_actuator(&self, at_motor: f64) -> f64 {
        self.sign / self.gear * at_motor + self.offset
    }

    /// The motor's set-point for one of the actuator.
    pub fn to_motor(&self, setpoint: &ActuatorSetpoint) -> Setpoint {
        let Mapping { sign, gear, offset, torque_constant } = *self;
        let softer = 1.0 / (gear * gear * torque_constant);
        Setpoint {
            position: sign * gear * (setpoint.position - offset),
            velocity: sign * gear * setpoint.velocity,
            torque: sign * setpoint.effort / (gear * torque_constant),
            stiffness: setpoint.stiffness * softer,
            damping: setpoint.damping * softer,
        }
    }

    /// The actuator's measurement for one of the motor.
    pub fn to_actuator(&self, measured: &Measurement) -> ActuatorMeasurement {
        let Mapping { sign, gear, offset, torque_constant } = *self;
        ActuatorMeasurement {
            position: sign * measured.position / gear + offset,
            velocity: sign * measured.velocity / gear,
            effort: sign * measured.torque * gear * torque_constant,
            temperature: measured.temperature,
        }
    }
}

state!(ActuatorMeasurement { position, velocity, effort, temperature });
state!(ActuatorSetpoint { position, velocity, effort, stiffness, damping });
