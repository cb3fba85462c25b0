//! A position code that repeats itself bit for bit although it must have moved.
//!
//! From the measurement on that the code last changed with:
//!
//! - the reported velocity, less its noise, goes on over more than five codes; or
//! - the effort that the motor is asked for changed by more than a part of the limit; or
//! - the code stood still from one measurement to the next after it had twice moved by more than
//!   eight codes.
//!
//! A joint that stands in balance repeats its code for hours under a constant effort, and that is
//! no alarm: without noise it looks like an encoder that froze there.

use sarrus_proto::actuators::Reason;

use super::effort::Run;
use super::{NOISE, Seen};
use crate::drive::Mode;

/// Repetitions that follow each other and the time between the first and the last `[s]`, where the
/// motor contradicts itself, and where it does not.
const CONTRARY: (u32, f64) = (3, 8e-3);
const REPEATED: (u32, f64) = (4, 12e-3);
/// Codes that a moving joint passes.
const PASSED: f64 = 5.0;
/// Codes from one measurement to the next that are a speed.
const FAST: f64 = 8.0;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frozen {
    /// Way by the reported velocity since the code last changed.
    passed: f64,
    /// Set-points since then.
    low: f64,
    high: f64,
    /// The last two ways before it stood still.
    ways: [f64; 2],
    moved: Run,
    pushed: Run,
    stopped: Run,
}

impl Frozen {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let Seen { bounds, steps, .. } = seen;
        if bounds.frozen == f64::INFINITY {
            return None;
        }
        let [last, before] = match seen.mode {
            Mode::Impedance | Mode::Torque => seen.efforts,
            Mode::Position | Mode::Velocity => [0.0; 2],
        };
        let way = seen.way();
        if way != 0.0 {
            // the last set-point acts after the code changed
            let low = last.min(before);
            let high = last.max(before);
            let [_, earlier] = self.ways;
            *self = Frozen { low, high, ways: [earlier, way], ..Frozen::default() };
            return None;
        }
        // comparisons of NaN fail: a velocity that is not reported passes none
        let velocity = seen.measured.velocity;
        if velocity.abs() > NOISE * steps.velocity {
            self.passed += velocity * seen.elapsed;
        }
        (self.low, self.high) = (self.low.min(last), self.high.max(last));
        let moved = self.passed.abs() > PASSED * steps.position;
        let pushed = self.high - self.low > bounds.frozen * seen.limits.effort;
        let [one, two] = self.ways;
        let fast = FAST * steps.position;
        let stopped = one.abs() > fast && two.abs() > fast && one * two > 0.0;
        let is_frozen = [
            self.moved.count(moved, seen.elapsed, CONTRARY),
            self.pushed.count(pushed, seen.elapsed, REPEATED),
            self.stopped.count(stopped, seen.elapsed, CONTRARY),
        ];
        is_frozen.contains(&true).then_some(Reason::FeedbackFrozen)
    }
}
