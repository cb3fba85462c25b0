//! A position code that repeats bit for bit although the joint must have moved.
//!
//! Since the last change of the code, one of these holds:
//!
//! - the reported velocity, less its noise, integrates to more than five codes; or
//! - the commanded effort changed by more than a part of the limit; or
//! - the code stopped from one measurement to the next after two steps of more than eight codes; or
//! - the joint was held for longer than its encoder's own noise, or a dither of its set-points,
//!   leaves one code.
//!
//! A balanced joint repeats its code for hours under a constant effort. Without noise, dither and a
//! counter of the drive it cannot be distinguished from a frozen encoder: that raises no alarm, and
//! the state has the flag `frozen_undetectable`.

use sarrus_proto::actuators::Reason;

use super::effort::Run;
use super::{NOISE, Seen};
use crate::drive::Mode;

/// Consecutive repetitions and the time from the first to the last `[s]`, if the motor contradicts
/// itself and if it does not.
const CONTRARY: (u32, f64) = (3, 8e-3);
const REPEATED: (u32, f64) = (4, 12e-3);
/// Codes that a moving joint passes.
const PASSED: f64 = 5.0;
/// Codes between two measurements that count as motion.
const FAST: f64 = 8.0;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frozen {
    /// Distance by the reported velocity since the last change of the code.
    passed: f64,
    /// Set-points since then.
    low: f64,
    high: f64,
    /// The last two steps before the code stopped.
    ways: [f64; 2],
    /// Time since the last change of the code `[s]`.
    held: f64,
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
        self.held += seen.elapsed;
        let moved = self.passed.abs() > PASSED * steps.position || self.held > seen.longest;
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
