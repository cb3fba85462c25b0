//! The encoder's own noise, learned from a joint at rest without power, where nothing else moves.
//!
//! An encoder is noisy if at least half of the reports of each of three rows differ from the one
//! before, over two codes or more: then it leaves every code soon, wherever it is between two of
//! them. One that is quieter, for five of six reports on one code, looks so for a row by chance.

use crate::state::state;

/// Reports that are judged together.
const ROW: u32 = 24;
/// Rows one after the other.
const ROWS: u32 = 3;
/// Codes that the reports spread over.
const SPREAD: f64 = 1.5;
/// A noisy encoder leaves each code within this time, and so many reports `[s]`.
pub(super) const NOISY: f64 = 0.1;
pub(super) const REPORTS: f64 = 48.0;
/// And a dithered joint within this time `[s]`.
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
    /// Noisy rows until now.
    n_noisy: u32,
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
            let is_noisy = is_spread && 2 * self.n_changed >= ROW;
            self.n_noisy = if is_noisy { (self.n_noisy + 1).min(ROWS) } else { 0 };
            self.n = 0;
        }
    }

    /// The joint moves: the row begins again.
    pub(super) fn begin(&mut self) {
        self.n = 0;
    }

    pub(super) fn is_noisy(&self) -> bool {
        self.n_noisy == ROWS
    }
}

state!(Noise { n, n_changed, last, low, high, n_noisy });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_noisy_rows_are_noise_and_one_is_chance() {
        let mut noise = Noise::default();
        let row = |noise: &mut Noise, code: fn(u32) -> f64| {
            (0..ROW).for_each(|i| noise.learn(code(i), 1.0));
            noise.is_noisy()
        };
        let quiet = |i: u32| f64::from(i % 6 == 5);
        let noisy = |i: u32| f64::from(i % 3);
        assert!(!row(&mut noise, noisy) && !row(&mut noise, noisy) && !row(&mut noise, quiet));
        assert!(!row(&mut noise, noisy) && !row(&mut noise, noisy));
        assert!(row(&mut noise, noisy) && row(&mut noise, noisy));
        assert!(!row(&mut noise, quiet));
    }
}
