//! The motion that a mechanism with power gives its motors in one cycle.

use crate::state::state;

/// Part of the greatest effort with which an actuator returns inside its limits.
pub(super) const RETURN_EFFORT: f64 = 0.5;

/// The motion of the motors of a mechanism with power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Course {
    /// The commands, scaled by this ramp from 0 to 1.
    Follow(f64),
    /// Damping.
    Damp,
    /// A stop.
    Brake {
        /// Fraction of the initial speed that remains.
        speed: f64,
        /// Fraction of its time that has passed.
        passed: f64,
    },
    /// No more than this speed down with gravity `[rad/s, m/s]`.
    Lower(f64),
    /// The quick stop of the drive.
    QuickStop,
    /// A slow return inside the limits.
    Return,
    /// A slow way to where it may rest without power.
    Rest,
}

impl Course {
    /// Part of a stop.
    pub(super) fn is_stop(self) -> bool {
        !matches!(self, Course::Follow(_) | Course::Damp | Course::Return)
    }
}

/// The target of a stop for one motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reference {
    /// Position of this cycle `[rad, m]`.
    pub(super) position: f64,
    /// Velocity at the beginning, no faster than the limit `[rad/s, m/s]`.
    pub(super) velocity: f64,
    /// Speed at the beginning `[rad/s, m/s]`.
    pub(super) speed: f64,
    /// How far spring and damper have grown, from 1.
    pub(super) gain: f64,
    /// Load at the beginning, where no model knows it `[N m, N]`.
    pub(super) load: f64,
    /// Speed beyond which the motor runs away: faster than at the beginning by the greatest
    /// velocity, which no load within the effort's limit reaches against the damper `[rad/s, m/s]`.
    pub(super) away: f64,
}

state!(Reference { position, velocity, speed, gain, load, away });
