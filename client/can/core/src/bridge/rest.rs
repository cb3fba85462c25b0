//! A joint at rest, without power: the condition for giving it some.
//!
//! For a tenth of a second the joint keeps to where it was, within its noise and the way at a
//! hundredth of its greatest speed, and reports no speed beyond that one.

use crate::mapping::ActuatorMeasurement;
use crate::state::state;

/// Time at rest before power `[s]`.
pub(super) const REST: f64 = 0.1;
/// Part of the greatest speed that counts as rest.
pub(super) const STILL: f64 = 0.01;

/// How long a joint has been at rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    /// Where it is, and the times of the first and last measurement there `[ns]`.
    position: Option<f64>,
    since_ns: u64,
    pub(super) until_ns: u64,
}

impl Rest {
    /// A measurement; within this distance of the first one and below this speed it is at rest.
    pub(super) fn see(
        &mut self,
        measured_ns: u64,
        measured: &ActuatorMeasurement,
        [distance, speed]: [f64; 2],
    ) {
        let position = measured.position;
        let has_moved = self.position.is_none_or(|before| (position - before).abs() > distance);
        // a speed that is not reported is not beyond
        if has_moved || measured.velocity.abs() > speed {
            (self.position, self.since_ns) = (Some(position), measured_ns);
        }
        self.until_ns = measured_ns;
    }

    /// It has been at rest for long enough.
    pub(super) fn is_long_enough(&self) -> bool {
        self.until_ns.saturating_sub(self.since_ns) >= (REST * 1e9) as u64
    }
}

state!(Rest { position, since_ns, until_ns });
