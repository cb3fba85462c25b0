//! A reported effort that differs from the commanded one: a limp motor, a stuck one, a second
//! master.
//!
//! With gains in the motor the commanded effort depends on the motor's own measurement, and a reply
//! shows the effort of an earlier set-point. So the last two set-points are applied to the newest
//! measurement, and the range of their efforts is kept for about 8 ms, or where that is longer for
//! two cycles, the age that the measurement may have (`punctual`) and the unevenness of cycles
//! (`velocity`). The report may lie outside by a part of the limit, by the noise of its own codes,
//! and by the noise of position and velocity times the gains. A motor that reports almost no effort
//! while the whole range exceeds 5 % of the limit is limp, however small the difference. Motors
//! with their own position or velocity loop may use up to the limit.

use sarrus_proto::actuators::Reason;

use super::{NOISE, Seen};
use crate::drive::Mode;
use crate::state::state;

/// Least time for which set-points are kept `[s]`, and cycles from a set-point to its report.
const MEMORY: f64 = 8e-3;
const CYCLES: f64 = 2.0;

/// The longest time from a set-point to a report that is not late, for a cycle and by how much
/// measurements are taken at unequal ones `[s]`.
pub(in crate::bridge) fn lag(period: f64, clocks: f64) -> f64 {
    CYCLES * period + clocks
}
/// Consecutive measurements outside the range, and the time from the first to the last `[s]`.
const OFF: (u32, f64) = (3, 6e-3);
const LIMP: (u32, f64) = (5, 12e-3);
/// Least effort that a motor must report, as part of the limit, and the part of it that is enough.
const WORTH: f64 = 0.05;
const REPORTED: f64 = 0.2;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Effort {
    /// The newest set-points.
    low: f64,
    high: f64,
    off: Run,
    limp: Run,
}

/// Consecutive measurements after the first one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    n: u32,
    time: f64,
}

impl Run {
    /// Counts on or ends; whether it is long enough.
    pub(super) fn count(&mut self, goes_on: bool, elapsed: f64, (n, time): (u32, f64)) -> bool {
        if !goes_on {
            *self = Run::default();
            return false;
        }
        self.time += if self.n > 0 { elapsed } else { 0.0 };
        self.n += 1;
        self.n >= n && self.time >= time
    }
}

impl Effort {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let steps = seen.steps;
        let reported = seen.measured.effort;
        let limit = seen.limits.effort;
        if !reported.is_finite() || seen.bounds.effort == f64::INFINITY {
            return None;
        }
        let [last, _] = seen.asked;
        let mut noise = NOISE * steps.effort;
        if matches!(seen.mode, Mode::Position | Mode::Velocity) {
            (self.low, self.high) = (-limit, limit);
        } else {
            let [one, two] = seen.efforts;
            if !(one + two).is_finite() {
                return None;
            }
            let [_, late] = seen.late;
            let memory = MEMORY.max(late + seen.lag);
            let forget = (seen.elapsed / memory).min(1.0);
            self.low = (self.low + forget * (one - self.low)).min(one).min(two);
            self.high = (self.high + forget * (one - self.high)).max(one).max(two);
            noise += NOISE * (last.stiffness * steps.position + last.damping * steps.velocity);
            if last.stiffness != 0.0 {
                noise += steps.stiffness * (last.position - seen.measured.position).abs();
            }
            if last.damping != 0.0 {
                noise += steps.damping * (last.velocity - seen.measured.velocity).abs();
            }
        }
        let tolerance = seen.bounds.effort * limit + noise;
        let is_off = reported > self.high + tolerance || reported < self.low - tolerance;
        // the least effort asked for, if all have one sign
        let least = self.low.max(-self.high);
        let is_limp = least > WORTH * limit + noise
            && reported.abs() < REPORTED * least + NOISE * steps.effort;
        let is_off = self.off.count(is_off, seen.elapsed, OFF);
        let is_limp = self.limp.count(is_limp, seen.elapsed, LIMP);
        (is_off || is_limp).then_some(Reason::EffortMismatch)
    }
}

state!(Effort { low, high, off, limp });
state!(Run { n, time });
