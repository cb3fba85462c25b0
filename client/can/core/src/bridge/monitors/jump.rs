//! A position that changed by more than the speed allows.
//!
//! |Δq| > v (Δt + T) + noise, where v is the smaller of `jump` × the limit of the speed and of
//! 2 max|q̇| + a quarter of the limit, from both reported speeds, and Δt the longest time that may
//! lie between the two measurements (`punctual`). A cycle T is added for clocks. Without both a
//! limit and a speed the rule does not apply.

use sarrus_proto::actuators::Reason;

use super::{NOISE, Seen};
use crate::config::{Limits, MonitorBounds};

/// Part of the limit by which a reported speed may be wrong.
const QUARTER: f64 = 0.25;
/// Without a limit a speed may change by this many codes between two measurements.
const FREE: f64 = 500.0;

/// The speed that no report explains, of a motor that tells its speed or not; infinite where the
/// rule is off.
pub(super) fn unexplained(bounds: &MonitorBounds, limits: &Limits, is_told: bool) -> f64 {
    let most = bounds.jump * limits.velocity;
    if is_told && most < f64::INFINITY { QUARTER * limits.velocity } else { most }
}

pub(super) fn check(seen: &Seen<'_>) -> Option<Reason> {
    let Seen { bounds, steps, .. } = seen;
    // no speed is needed to explain noise
    if seen.way().abs() <= NOISE * steps.position {
        return None;
    }
    let limit = seen.limits.velocity;
    let free = if limit < f64::INFINITY { QUARTER * limit } else { FREE * steps.velocity };
    let reported = seen.measured.velocity.abs().max(seen.before.velocity.abs());
    // a speed that is not reported explains nothing
    let explained = if reported.is_nan() { f64::INFINITY } else { 2.0 * reported + free };
    let most = (bounds.jump * limit).min(explained);
    let allowed = most * (seen.longest() + seen.period) + NOISE * steps.position;
    (bounds.jump < f64::INFINITY && seen.way().abs() > allowed).then_some(Reason::FeedbackJump)
}
