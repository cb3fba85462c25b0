//! How much older a measurement may be than its time of arrival.
//!
//! Measurements are taken at equal intervals T and keep their order, but arrive later by a delay
//! that varies: frames wait in queues and come in bursts. From the times of arrival r,
//!
//! ```text
//! a ← max(0, a + r − r_before − T),    taken between r − a and r
//! ```
//!
//! a is the delay beyond the smallest one so far, and counts lost measurements as delay. T is the
//! cycle of a motor that is asked, and the mean interval of one that measures by itself; it is
//! [`LEAK`] longer here, so that a lost measurement is forgotten after some hundred others.

/// Part by which an interval counts as longer than it is.
const LEAK: f64 = 0.01;
/// Weight of the newest interval in the mean of those of a motor that is not asked.
const SHARE: f64 = 0.02;
/// A longer interval is a silence, after which all begins anew `[s]`.
const SILENCE: f64 = 0.2;

#[derive(Clone, Copy, Debug)]
pub(in crate::bridge) struct Punctual {
    /// Time between two cycles `[s]`.
    period: f64,
    /// Mean interval of a motor that is not asked; 0 before the first one `[s]`.
    mean: f64,
    /// How much older than its arrival the newest measurement may be `[s]`.
    pub(in crate::bridge) late: f64,
}

impl Punctual {
    pub(in crate::bridge) fn new(period: f64) -> Punctual {
        Punctual { period, mean: 0.0, late: 0.0 }
    }

    /// A measurement came, this long after the one before `[s]`.
    pub(in crate::bridge) fn take(&mut self, elapsed: f64, is_asked: bool) {
        if elapsed > SILENCE {
            (self.mean, self.late) = (0.0, 0.0);
            return;
        }
        let interval = if is_asked {
            self.period
        } else {
            let share = if self.mean == 0.0 { 1.0 } else { SHARE };
            self.mean += share * (elapsed - self.mean);
            self.mean
        };
        self.late = (self.late + elapsed - (1.0 + LEAK) * interval).max(0.0);
    }
}
