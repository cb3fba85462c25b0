//! The encoder's own noise, learned from a joint at rest without power, where nothing else moves.
//!
//! An encoder is noisy if at least half of a row of reports differ from the one before, over two
//! codes or more: then it leaves every code soon, wherever it is between two of them.

use crate::state::state;

/// Reports that are judged together.
const ROW: u32 = 24;
/// Codes that the reports spread over.
const SPREAD: f64 = 1.5;
/// A noisy encoder, and a dithered joint, leave each code within this time `[s]`.
pub(super) const NOISY: f64 = 0.1;
pub(super) const DITHERED: f64 = 0.2;
/// Time of one swing of a dither `[s]`.
pub(in crate::bridge) const DITHER: f64 = 0.1;

#[derive(Clone, Copy, Debug, Default)]
pub(in crate::bridge) struct Noise {
    n: u32,
    n_changed: u32,
    last: f64,
    low: f64,
    high: f64,
    is_noisy: bool,
}

impl Noise {
    /// A report of a joint at rest, with codes of this step.
    pub(super) fn learn(&mut self, position: f64, step: f64) {
        if self.n == 0 {
            (self.low, self.high, self.n_changed) = (position, position, 0);
        } else {
            self.n_changed += u32::from(position != self.last);
        }
        (self.low, self.high) = (self.low.min(position), self.high.max(position));
        (self.last, self.n) = (position, self.n + 1);
        if self.n == ROW {
            let is_spread = self.high - self.low > SPREAD * step;
            self.is_noisy = is_spread && 2 * self.n_changed >= ROW;
            self.n = 0;
        }
    }

    /// The joint moves: the row begins again.
    pub(super) fn begin(&mut self) {
        self.n = 0;
    }

    pub(super) fn is_noisy(&self) -> bool {
        self.is_noisy
    }
}

state!(Noise { n, n_changed, last, low, high, is_noisy });
