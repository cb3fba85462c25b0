//! A speed beyond its limit, by the reports and by the positions.
//!
//! Reported: |q̇| > (1 + margin) v in three consecutive measurements.
//!
//! By positions: since some earlier measurement the actuator went farther than the limit allows in
//! the longest possible time. A measurement arrives at r and may be a older (`punctual`). Its
//! excess s over the best earlier one is
//!
//! ```text
//! s ← s ± Δq − (1 + margin) v Δr,   fault where s > v t + noise,   s ← max(s, −(1 + margin) v a)
//! ```
//!
//! with t = T / 2, at least [`CLOCKS`], and by how much the bridge's own cycles were uneven lately:
//! motors measure when they are asked.

use sarrus_proto::actuators::Reason;

use super::{NOISE, Seen};
use crate::state::state;

const MEASUREMENTS: u32 = 3;
/// Times of arrival may be off by this in spite of their bound `[s]`.
const CLOCKS: f64 = 1e-3;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Velocity {
    n_fast: u32,
    /// Distance in excess of the allowed one from the best measurement, forwards and backwards.
    ahead: f64,
    back: f64,
}

/// How unequal the times of measurements may be, for a cycle and the unevenness of cycles `[s]`.
pub(in crate::bridge) fn clocks(period: f64, uneven: f64) -> f64 {
    (0.5 * period).max(CLOCKS) + uneven
}

impl Velocity {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let Seen { bounds, steps, .. } = seen;
        let most = (1.0 + bounds.velocity) * seen.limits.velocity;
        if most == f64::INFINITY {
            return None;
        }
        let is_fast = seen.measured.velocity.abs() > most + NOISE * steps.velocity;
        self.n_fast = if is_fast { self.n_fast + 1 } else { 0 };
        let allowed = most * seen.elapsed;
        let ahead = self.ahead + seen.way() - allowed;
        let back = self.back - seen.way() - allowed;
        let bound = seen.limits.velocity * seen.clocks + NOISE * steps.position;
        let is_ahead = ahead.max(back) > bound;
        let [_, late] = seen.late;
        (self.ahead, self.back) = (ahead.max(-most * late), back.max(-most * late));
        (self.n_fast >= MEASUREMENTS || is_ahead).then_some(Reason::VelocityLimit)
    }
}

state!(Velocity { n_fast, ahead, back });
