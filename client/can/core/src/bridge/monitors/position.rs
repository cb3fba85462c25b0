//! A position beyond its limit that moves outwards.
//!
//! The margin is a part of the range between the limits, and at least its noise. A joint that rests
//! beyond the limit or moves back causes no fault. It moves outwards by its reported speed, by the
//! last two measurements, or relative to its least distance beyond the limit so far.

use sarrus_proto::actuators::Reason;

use super::{NOISE, Seen};
use crate::config::{Limits, MonitorBounds};
use crate::mapping::ActuatorSetpoint;
use crate::state::state;

#[derive(Clone, Copy, Debug)]
pub(super) struct Position {
    /// Least distance beyond the margin since the position was last within it.
    least: f64,
}

impl Default for Position {
    fn default() -> Position {
        Position { least: f64::INFINITY }
    }
}

/// Margin of a measured position beyond its limit.
pub(super) fn margin(limits: &Limits, bounds: &MonitorBounds, steps: &ActuatorSetpoint) -> f64 {
    let range = limits.upper - limits.lower;
    let noise = NOISE * steps.position;
    // arming has a limit even if the monitor is off
    let part = bounds.position;
    let part = if part < f64::INFINITY { part } else { MonitorBounds::USUAL.position };
    if range < f64::INFINITY { noise.max(part * range) } else { noise }
}

impl Position {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let Seen { bounds, steps, limits, .. } = seen;
        let position = seen.measured.position;
        let (beyond, outwards) = if position > limits.upper {
            (position - limits.upper, 1.0)
        } else {
            (limits.lower - position, -1.0)
        };
        if beyond <= 0.0 || beyond <= margin(limits, bounds, steps) {
            self.least = f64::INFINITY;
            return None;
        }
        self.least = self.least.min(beyond);
        let noise = NOISE * steps.position;
        let moves = outwards * seen.measured.velocity > NOISE * steps.velocity
            || outwards * seen.way() > noise
            || beyond - self.least > noise;
        (moves && bounds.position < f64::INFINITY).then_some(Reason::PositionLimit)
    }
}

state!(Position { least });
