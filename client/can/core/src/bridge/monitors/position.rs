//! A position beyond its limit that moves outwards.
//!
//! The margin is a part of the range between the limits, and at least its noise. A joint that rests
//! beyond the limit or moves back causes no fault. It moves outwards by its reported speed, by the
//! last two measurements, or relative to its least distance beyond the limit so far.
//!
//! Inside the limits a joint must be able to stop within a quarter of the margin: with the
//! deceleration a of a stop and the delay t from a measurement to all of the effort that follows,
//!
//! ```text
//! v² / (2 a) + v t ≤ distance
//! ```

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

/// Cycles from a measurement to the effort that follows from it, and the time in which the effort
/// of a stop grows `[s]`.
const DELAY: f64 = 4.0;
const GROWTH: f64 = 0.04;
/// Part of the margin within which a joint must be able to stop.
const WITHIN: f64 = 0.25;

/// The positions from which a joint stops before its limits at any allowed speed, and to which
/// set-points go at any of them.
pub(in crate::bridge) fn free(limits: &Limits, [braking, delay]: [f64; 2]) -> [f64; 2] {
    let speed = 1.1 * limits.speed();
    let reach = speed * (speed / braking).max(2.0 * delay).max(0.5 * speed / braking + delay);
    [limits.lower + reach, limits.upper - reach]
}

/// The delay of a stop, for a cycle `[s]`.
pub(in crate::bridge) fn delay(period_ns: u64) -> f64 {
    GROWTH + DELAY * period_ns as f64 * 1e-9
}

/// The way of a stop from a speed, with its deceleration and delay.
pub(in crate::bridge) fn way(speed: f64, [braking, delay]: [f64; 2]) -> f64 {
    speed * (0.5 * speed / braking + delay)
}

/// It cannot stop within the margin beyond the limit that it moves to.
fn is_too_fast(seen: &Seen<'_>) -> bool {
    let Seen { bounds, steps, limits, measured, .. } = seen;
    // a speed that is hidden or not reported shows in the positions
    let passed = seen.way();
    let noise = NOISE * steps.position;
    let by_way = (passed.abs() - noise) / (seen.longest() + seen.period);
    let speed = measured.velocity.abs().max(by_way);
    let ahead = if by_way > 0.0 { passed } else { measured.velocity };
    let room = match ahead > 0.0 {
        true => limits.upper - measured.position,
        false => measured.position - limits.lower,
    };
    let left = room + WITHIN * margin(limits, bounds, steps);
    left > 0.0 && way(speed, *seen.braking) > left && bounds.position < f64::INFINITY
}

impl Position {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let Seen { bounds, steps, limits, .. } = seen;
        let position = seen.measured.position;
        let [low, high] = seen.free;
        if *low < position && position < *high {
            self.least = f64::INFINITY;
            return None;
        }
        if is_too_fast(seen) {
            return Some(Reason::PositionLimit);
        }
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
