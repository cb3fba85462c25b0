//! The position at which a motor was last trusted.
//!
//! A motor whose supply is away may come back with another zero, and one that is turned meanwhile
//! with another turn. Its position is compared with the last one that was trusted, also over a new
//! start of the bridge: it may differ by the margin of a position limit and by twice the way at the
//! greater of the two reported speeds, and where reports follow each other by the way at a quarter
//! of its greatest speed, or at 1.2 times where it reports none. Beyond that it is not trusted
//! until it is back, however long that takes, or until an operator confirms it; nothing is armed
//! before.

use crate::mapping::ActuatorMeasurement;
use crate::state::state;

/// The last position that was trusted, and whether the newest one is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Whereabouts {
    trusted: Option<Place>,
    /// The newest position is elsewhere.
    pub(super) is_elsewhere: bool,
    /// It was where a monitor found a jump, which is under power.
    is_from_jump: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Place {
    measured_ns: u64,
    position: f64,
    speed: f64,
}

/// How far a motor may be from where it was.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowed {
    /// Distance that counts as none `[rad, m]`.
    pub(super) margin: f64,
    /// Speed that is possible without a report of it `[rad/s, m/s]`.
    pub(super) speed: f64,
    /// Reports that are farther apart do not follow each other `[ns]`.
    pub(super) feedback_ns: u64,
}

impl Whereabouts {
    /// Trusts a position.
    pub(super) fn trust(&mut self, measured_ns: u64, measured: &ActuatorMeasurement) {
        // a speed that is not reported is none
        let speed = measured.velocity.abs().max(0.0);
        let trusted = Some(Place { measured_ns, position: measured.position, speed });
        *self = Whereabouts { trusted, ..Whereabouts::default() };
    }

    /// The position that was trusted `[rad, m]`.
    pub(super) fn position(&self) -> Option<f64> {
        self.trusted.map(|place| place.position)
    }

    /// The power is away: the last measurement under the monitors is trusted, but for a jump.
    pub(super) fn leave(&mut self, seen_ns: u64, seen: &ActuatorMeasurement) {
        if !std::mem::take(&mut self.is_from_jump) {
            self.trust(seen_ns, seen);
        }
    }

    /// A monitor found a jump after the measurement that it saw before.
    pub(super) fn jumped(&mut self, seen_ns: u64, seen: &ActuatorMeasurement) {
        self.leave(seen_ns, seen);
        self.is_from_jump = true;
    }

    /// Compares a report without power with the place that was trusted last.
    pub(super) fn find(
        &mut self,
        measured_ns: u64,
        measured: &ActuatorMeasurement,
        allowed: Allowed,
    ) {
        let Some(before) = self.trusted else { return self.trust(measured_ns, measured) };
        let elapsed_ns = measured_ns.saturating_sub(before.measured_ns);
        let unexplained = if elapsed_ns <= allowed.feedback_ns { allowed.speed } else { 0.0 };
        let speed = 2.0 * before.speed.max(measured.velocity.abs()) + unexplained;
        let way = speed * (elapsed_ns as f64 * 1e-9) + allowed.margin;
        if (measured.position - before.position).abs() <= way {
            self.trust(measured_ns, measured);
        } else {
            // it moves from here on, and time explains no more of the way
            self.trusted = Some(Place { measured_ns, speed: 0.0, ..before });
            self.is_elsewhere = true;
        }
    }
}

state!(Whereabouts { trusted, is_elsewhere, is_from_jump });
state!(Place { measured_ns, position, speed });
