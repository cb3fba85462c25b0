//! A position that changed by more than the speed allows.
//!
//! |Δq| > v (Δt + T) + noise, where v is the smaller of `jump` × the limit of the speed and of
//! 2 max|q̇| + a quarter of the limit, from both reported speeds, and Δt the longest time that may
//! lie between the two measurements (`punctual`). A cycle T is added for clocks. Without both a
//! limit and a speed the rule does not apply.

use sarrus_proto::actuators::Reason;

use super::{NOISE, Seen};

/// Without a limit a speed may change by this many codes between two measurements.
const FREE: f64 = 500.0;

pub(super) fn check(seen: &Seen<'_>) -> Option<Reason> {
    let Seen { bounds, steps, .. } = seen;
    // no speed is needed to explain noise
    if seen.way().abs() <= NOISE * steps.position {
        return None;
    }
    let limit = seen.limits.velocity;
    let free = if limit < f64::INFINITY { 0.25 * limit } else { FREE * steps.velocity };
    let reported = seen.measured.velocity.abs().max(seen.before.velocity.abs());
    // a speed that is not reported explains nothing
    let explained = if reported.is_nan() { f64::INFINITY } else { 2.0 * reported + free };
    let most = (bounds.jump * limit).min(explained);
    let allowed = most * (seen.longest() + seen.period) + NOISE * steps.position;
    (bounds.jump < f64::INFINITY && seen.way().abs() > allowed).then_some(Reason::FeedbackJump)
}
