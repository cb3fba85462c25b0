//! A hot motor: less speed from one temperature on, a fault at another.
//!
//! The limit of the speed shrinks linearly from `derate` to nothing at `temperature`; the effort
//! that holds a load stays, until the drive's own cut-off. At `temperature` follows a controlled
//! stop, with all of the effort. One measurement alone is no evidence, and a missing one is none.

use sarrus_proto::actuators::Reason;

use super::Seen;
use crate::config::MonitorBounds;
use crate::state::state;

const MEASUREMENTS: u32 = 3;

#[derive(Clone, Copy, Debug)]
pub(super) struct Temperature {
    n_hot: u32,
    /// The lower of the last two `[°C]`.
    lower: f64,
}

impl Default for Temperature {
    fn default() -> Temperature {
        Temperature { n_hot: 0, lower: f64::NAN }
    }
}

impl Temperature {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let now = seen.measured.temperature;
        self.lower = now.min(seen.before.temperature);
        self.n_hot = if now >= seen.bounds.temperature { self.n_hot + 1 } else { 0 };
        (self.n_hot >= MEASUREMENTS).then_some(Reason::OverTemperature)
    }

    /// Part of the limit that remains, from 0 to 1.
    pub(super) fn part(&self, bounds: &MonitorBounds) -> f64 {
        // not so for NaN, and for bounds that are off
        if self.lower > bounds.derate {
            let part = (bounds.temperature - self.lower) / (bounds.temperature - bounds.derate);
            if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) }
        } else {
            1.0
        }
    }
}

state!(Temperature { n_hot, lower });
