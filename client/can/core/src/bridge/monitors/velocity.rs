//! A speed beyond its limit, by the reports and by the positions.
//!
//! Reported: |q̇| > (1 + margin) v in three consecutive measurements. By positions: the excess is
//! summed up, s ← max(0, s ± Δq − (1 + margin) v Δt), which neither lost frames nor jitter enlarge,
//! and compared with half a cycle at the limit.

use sarrus_proto::actuators::Reason;

use super::{NOISE, Seen};

const MEASUREMENTS: u32 = 3;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Velocity {
    n_fast: u32,
    /// Distance in excess of the allowed one, forwards and backwards.
    ahead: f64,
    back: f64,
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
        self.ahead = (self.ahead + seen.way() - allowed).max(0.0);
        self.back = (self.back - seen.way() - allowed).max(0.0);
        let bound = 0.5 * seen.limits.velocity * seen.period + NOISE * steps.position;
        let is_ahead = self.ahead.max(self.back) > bound;
        (self.n_fast >= MEASUREMENTS || is_ahead).then_some(Reason::VelocityLimit)
    }
}
