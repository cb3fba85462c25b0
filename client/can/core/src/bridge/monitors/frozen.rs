//! A position code that repeats bit for bit although the joint must have moved.
//!
//! Since the last change of the code, one of these holds:
//!
//! - the reported velocity, if it is more than its noise, integrates to more than five codes in the
//!   shortest time that may have passed. A motor with its own loop answers each set-point with a
//!   stroke that moves all motors of its mechanism, and of which reports show the same moment: they
//!   differ from the mean velocity, and count only beyond that of rest (`ripple`); or
//! - the commanded effort changed by more than a part of the limit while the joint was at rest, and
//!   would have moved it by one and a half codes had it the least acceleration: with its greatest
//!   effort a joint reaches its greatest speed within [`SLOWEST`]; or
//! - the code stopped from one measurement to the next after two steps of more than eight codes,
//!   and the set-point goes on as fast; or
//! - the joint was held for longer than its encoder's own noise, or a dither of its set-points,
//!   leaves one code.
//!
//! A joint that ends a motion is braked by efforts until it is at rest, and may pass part of a code
//! meanwhile: efforts then count from [`SETTLED`] after the last change of the code on, or from
//! eight times the interval between the last two changes on. A balanced joint repeats its code for
//! hours under a constant effort. Without noise, dither and a counter of the drive it cannot be
//! distinguished from a frozen encoder: that raises no alarm, and the state has the flag
//! `frozen_undetectable`.

use sarrus_proto::actuators::Reason;

use super::effort::Run;
use super::{NOISE, Seen};
use crate::drive::Mode;
use crate::state::state;

/// Consecutive repetitions and the time from the first to the last `[s]`, if the motor contradicts
/// itself and if it does not.
const CONTRARY: (u32, f64) = (3, 8e-3);
const REPEATED: (u32, f64) = (4, 12e-3);
/// Codes that a moving joint passes.
const PASSED: f64 = 5.0;
/// Codes between two measurements that count as motion.
const FAST: f64 = 8.0;
/// Codes that a joint passes under an effort that moves it.
const MOVED: f64 = 1.5;
/// The longest time in which the greatest effort gives the greatest speed `[s]`.
const SLOWEST: f64 = 1.0;
/// Time after which set-points of the motion before have had their effect `[s]`.
const SETTLED: f64 = 8e-3;
/// A joint whose code changed at longer intervals does not come from a motion `[s]`.
const SLOW: f64 = 0.05;
/// Intervals in which a joint comes to rest from a code an interval.
const REST: f64 = 8.0;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frozen {
    /// Distance by the reported velocity since the last change of the code.
    passed: f64,
    /// Time since then `[s]`, and the set-points at rest.
    still: f64,
    low: f64,
    high: f64,
    /// Speed and way of the least acceleration by the change of the set-points.
    speed: f64,
    way: f64,
    /// Time between the last two changes `[s]`.
    interval: f64,
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
        let Seen { bounds, steps, limits, .. } = seen;
        if bounds.frozen == f64::INFINITY {
            return None;
        }
        let [last, before] = match seen.mode {
            Mode::Impedance | Mode::Torque => seen.efforts,
            Mode::Position | Mode::Velocity => [0.0; 2],
        };
        let way = seen.way();
        let low = last.min(before);
        let high = last.max(before);
        if way != 0.0 {
            let [_, earlier] = self.ways;
            self.interval = self.still + seen.elapsed;
            if self.held > 0.0 {
                *self = Frozen { interval: self.interval, ..Frozen::default() };
            }
            (self.low, self.high, self.ways) = (low, high, [earlier, way]);
            return None;
        }
        let elapsed = seen.shortest();
        // comparisons of NaN fail: a velocity that is not reported passes none
        let velocity = seen.measured.velocity;
        if velocity.abs() > NOISE * steps.velocity && velocity.abs() > seen.ripple {
            self.passed += velocity * elapsed;
        }
        let settles = self.interval < SLOW && self.still < SETTLED.max(REST * self.interval);
        (self.low, self.high) = match settles {
            true => (low, high),
            false => (self.low.min(low), self.high.max(high)),
        };
        self.still += elapsed;
        self.held += seen.elapsed;
        let moved = self.passed.abs() > PASSED * steps.position || self.held > seen.dwell;
        let change = (self.high - self.low) / limits.effort;
        let pushed = change > bounds.frozen;
        if pushed {
            self.speed += change * limits.speed() / SLOWEST * elapsed;
            self.way += self.speed * elapsed;
        }
        let fast = FAST * steps.position;
        let ways = [self.ways[0], self.ways[1], seen.way_asked()];
        let stopped = ways.iter().all(|way| *way > fast) || ways.iter().all(|way| *way < -fast);
        let is_pushed = self.pushed.count(pushed, seen.elapsed, REPEATED);
        let is_frozen = [
            self.moved.count(moved, seen.elapsed, CONTRARY),
            is_pushed && self.way > MOVED * steps.position,
            self.stopped.count(stopped, seen.elapsed, CONTRARY),
        ];
        is_frozen.contains(&true).then_some(Reason::FeedbackFrozen)
    }
}

state!(Frozen {
    passed,
    still,
    low,
    high,
    speed,
    way,
    interval,
    ways,
    held,
    moved,
    pushed,
    stopped
});
