//! The controlled stop of one motor.
//!
//! A velocity v* goes from the measured one to zero, and the motor follows it as a spring and a
//! damper follow a set-point:
//!
//! ```text
//! τ = g + k (p* − p) + d (v* − v),   p* = p₀ + ∫ v* dt,   k = d · 10/s
//! ```
//!
//! which is a servo of the velocity whose integral is the spring: what gravity g does not tell is
//! held after a tenth of a second or two. p* stays within the limits of the position, and no
//! farther from p than where the spring alone has the greatest effort, so that a load which that
//! effort cannot stop at once is not thrown back. Against an inertia J the servo does not oscillate
//! where d ≥ 40/s · J.

use super::motor::Motor;
use crate::mapping::ActuatorSetpoint;

/// Stiffness of a stop for its damping `[1/s]`.
const STIFFNESS: f64 = 10.0;

/// Where a stop is to lead a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reference {
    /// Position of this cycle `[rad, m]`.
    position: f64,
    /// Velocity at the beginning `[rad/s, m/s]`.
    velocity: f64,
}

impl Motor {
    /// A stop begins from where the motor is, as fast as it is.
    pub(super) fn begin_stop(&mut self) {
        let limit = self.config.limits.velocity;
        let velocity = self.measured.velocity;
        self.stop = Reference {
            position: self.place(),
            velocity: if velocity.is_nan() { 0.0 } else { velocity.max(-limit).min(limit) },
        };
    }

    /// The set-point of a stop, with this part of the first velocity.
    pub(super) fn braking(&mut self, part: f64, elapsed: f64) -> ActuatorSetpoint {
        let (limits, damping) = (self.config.limits, self.stop_damping);
        let stiffness = STIFFNESS * damping;
        let velocity = part * self.stop.velocity;

        // no farther away than the effort holds, and within the limits
        let (place, reach) = (self.place(), limits.effort / stiffness);
        let free = self.stop.position + velocity * elapsed;
        let free = free.max(place - reach).min(place + reach);
        self.stop.position = free.max(limits.lower).min(limits.upper);

        ActuatorSetpoint {
            position: self.stop.position,
            velocity: if self.stop.position == free { velocity } else { 0.0 },
            effort: self.gravity,
            stiffness,
            damping,
        }
    }
}
