//! Reported efforts against the inverse dynamics of the model.
//!
//! ```text
//! δτ_u = W G_u N⁻¹ (τ_y(y, ẏ, ÿ) − G_uᵀ τ_reported)
//! |δτ_u| > part · limits.effort + ½ |τ_u(y, ẏ, ÿ) − τ_u(y, 0, 0)|
//! ```
//!
//! ẏ is the velocity that the motors report, or else the change of y; both it and its derivative ÿ
//! go through a filter of 5 ms, and the efforts through two of them, so that they are as late. In
//! addition, half of the motion's forces may be wrong: rotors and friction are not in the model. It
//! is a fault for 10 ms of the time that measurements tell, and in three of them. A gap between
//! them hides efforts whose motion shows behind it: for four times the filter's 5 ms after one,
//! none counts.

use crate::state::state;

/// Time constant of the filters `[s]`.
const FILTER: f64 = 0.005;
/// The efforts may contradict the model for this time `[ns]`, or in fewer measurements.
const HOLD_NS: u64 = 10_000_000;
const MEASUREMENTS: u32 = 3;
/// Time after which the filters have forgotten the efforts in a gap `[ns]`.
pub(super) const SETTLED_NS: u64 = (4.0 * FILTER * 1e9) as u64;

/// The longest time between two measurements that is no gap, for the usual one `[s]`.
pub(super) fn longest(usual: f64) -> f64 {
    FILTER.max(1.5 * usual)
}

/// Part of the forces of the motion that may be wrong.
pub(super) const MOTION: f64 = 0.5;

/// A number and its rate of change, both filtered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Filtered {
    pub(super) value: f64,
    pub(super) rate: f64,
}

impl Filtered {
    /// Advances by `h` seconds.
    pub(super) fn update(&mut self, newest: f64, h: f64) {
        let share = h / (h + FILTER);
        let before = self.value;
        self.value += share * (newest - self.value);
        self.rate += share * ((self.value - before) / h - self.rate);
    }

    /// Two filters in series; the second filter's output is stored in the place of the rate.
    pub(super) fn update_twice(&mut self, newest: f64, h: f64) {
        let share = h / (h + FILTER);
        self.value += share * (newest - self.value);
        self.rate += share * (self.value - self.rate);
    }
}

/// How long a mechanism's efforts have contradicted.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Contradiction {
    since_ns: Option<u64>,
    last_ns: u64,
    n: u32,
}

impl Contradiction {
    /// Takes whether the efforts of a time contradict; true once they have for long enough.
    pub(super) fn update(&mut self, seen_ns: u64, is_beyond: bool) -> bool {
        if !is_beyond {
            *self = Contradiction::default();
            return false;
        }
        let since_ns = *self.since_ns.get_or_insert(seen_ns);
        self.n += u32::from(seen_ns != self.last_ns);
        self.last_ns = seen_ns;
        self.n >= MEASUREMENTS && seen_ns.saturating_sub(since_ns) >= HOLD_NS
    }
}

state!(Filtered { value, rate });
state!(Contradiction { since_ns, last_ns, n });
