//! The position at which a motor was last trusted.
//!
//! A motor whose supply is away may come back with another zero, and one that is turned meanwhile
//! with another turn. Its position is compared with the last one that was trusted, also over a new
//! start of the bridge: it may differ by the margin of a position limit and by twice the way at the
//! greater of the two reported speeds, and where reports follow each other by the way at 1.2 times
//! its greatest speed. Beyond that it is not trusted until it is back, or until an operator confirms
//! it; nothing is armed before.

use super::Bridge;
use super::motor::Motor;
use crate::mapping::ActuatorMeasurement;

/// The last position that was trusted, and whether the newest one is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Whereabouts {
    trusted: Option<Place>,
    /// The newest position is elsewhere.
    pub(super) is_elsewhere: bool,
    /// It was where a monitor found a jump, which is under power.
    is_from_jump: bool,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    measured_ns: u64,
    position: f64,
    speed: f64,
}

impl Whereabouts {
    fn trust(&mut self, measured_ns: u64, position: f64, speed: f64) {
        // a speed that is not reported is none
        let speed = speed.abs().max(0.0);
        let trusted = Some(Place { measured_ns, position, speed });
        *self = Whereabouts { trusted, ..Whereabouts::default() };
    }
}

impl Motor {
    /// The power is away: the last measurement under the monitors is trusted, but for a jump.
    pub(super) fn leave(&mut self, seen_ns: u64) {
        if !std::mem::take(&mut self.whereabouts.is_from_jump) {
            self.whereabouts.trust(seen_ns, self.before.position, self.before.velocity);
        }
    }

    /// A monitor found a jump after the measurement that it saw before.
    pub(super) fn jumped(&mut self, seen_ns: u64) {
        self.leave(seen_ns);
        self.whereabouts.is_from_jump = true;
    }

    /// Compares a report without power with the place that was trusted last; reports that are
    /// farther apart than `feedback_ns` do not follow each other.
    pub(super) fn find(&mut self, measured_ns: u64, feedback_ns: u64) {
        let ActuatorMeasurement { position, velocity, .. } = self.measured;
        let Some(before) = self.whereabouts.trusted else {
            return self.whereabouts.trust(measured_ns, position, velocity);
        };
        if before.measured_ns == measured_ns {
            return;
        }
        let elapsed_ns = measured_ns.saturating_sub(before.measured_ns);
        let unexplained = match elapsed_ns <= feedback_ns {
            true => self.monitors.bounds.jump * self.config.limits.velocity,
            false => 0.0,
        };
        let speed = 2.0 * before.speed.max(velocity.abs()) + unexplained;
        let way = speed * (elapsed_ns as f64 * 1e-9) + self.monitors.margin(&self.config.limits);
        if (position - before.position).abs() <= way {
            self.whereabouts.trust(measured_ns, position, velocity);
        } else {
            self.whereabouts.is_elsewhere = true;
        }
    }

    /// An operator confirms its position.
    pub(super) fn confirm(&mut self) {
        if let Some(measured_ns) = self.measured_ns {
            self.whereabouts.trust(measured_ns, self.measured.position, self.measured.velocity);
        }
    }
}

impl Bridge {
    /// Where each motor was last trusted, at its own shaft, by actuator, for the bridge's next
    /// start `[rad]`.
    pub fn positions(&self) -> impl Iterator<Item = (usize, f64)> {
        self.motors.iter().filter_map(|motor| {
            let place = motor.whereabouts.trusted?;
            // with power the newest measurement is the monitors' business
            let position = motor.seen_ns.map_or(place.position, |_| motor.measured.position);
            Some((motor.config.actuator, motor.config.mapping.at_motor(position)))
        })
    }

    /// Takes the position at which a motor was trusted before this start `[rad]`.
    pub fn remember(&mut self, actuator: usize, at_motor: f64) {
        let of_actuator = |motor: &&mut Motor| motor.config.actuator == actuator;
        if let Some(motor) = self.motors.iter_mut().find(of_actuator) {
            // as long ago as the monotonic clock can tell
            motor.whereabouts.trust(0, motor.config.mapping.at_actuator(at_motor), 0.0);
        }
    }
}
