//! How much older a measurement may be than its time of arrival.
//!
//! Measurements are taken at equal intervals T and keep their order, but arrive later by a delay
//! that varies: frames wait in queues and come in bursts. From the times of arrival r,
//!
//! ```text
//! a ← max(0, a + r − r_before − T),    taken between r − a and r
//! ```
//!
//! a is the delay beyond the smallest one so far. A lost measurement looks like a delay. T is the
//! mean interval, lost measurements included, and [`LEAK`] longer, so that they are forgotten after
//! some hundred others.

use crate::state::state;

/// Part by which an interval counts as longer than it is.
const LEAK: f64 = 0.01;
/// The mean is of this many intervals, or of all while there are fewer.
const INTERVALS: f64 = 200.0;
/// A longer interval is a silence, and not counted in the mean `[s]`.
const SILENCE: f64 = 0.2;
/// Part of a delay beyond this one that each measurement forgets `[s]`.
const LONG: f64 = 0.02;
const FORGOTTEN: f64 = 0.02;

#[derive(Clone, Copy, Debug, Default)]
pub(in crate::bridge) struct Punctual {
    /// Mean interval `[s]`, and of how many.
    pub(super) mean: f64,
    n_intervals: f64,
    /// The motor was not asked until nothing was on its way any more, or for other things.
    has_paused: bool,
    /// How much older than its arrival the newest measurement may be `[s]`.
    pub(in crate::bridge) late: f64,
}

impl Punctual {
    /// A measurement came, this long after the one before `[s]`.
    pub(in crate::bridge) fn take(&mut self, elapsed: f64) {
        if self.has_paused {
            // it answers the newest request
            (self.has_paused, self.late) = (false, 0.0);
            return;
        }
        if elapsed <= SILENCE {
            if self.n_intervals < INTERVALS {
                self.n_intervals += 1.0;
            }
            self.mean += (elapsed - self.mean) / self.n_intervals;
        }
        self.late = (self.late + elapsed - (1.0 + LEAK) * self.mean).max(0.0);
        if self.late > LONG {
            self.late -= FORGOTTEN * (self.late - LONG);
        }
    }

    /// The motor goes without requests until it is silent, or answers other ones until now.
    pub(super) fn pause(&mut self) {
        self.has_paused = true;
    }
}

state!(Punctual { mean, n_intervals, has_paused, late });
