//! The verdict: one mechanical rule for every case.

use sarrus_dynamics::{Status, Warnings};

use crate::report::Verdict;

/// Error by size up to which an answer counts as right.
pub(super) const HELD: f64 = 1e-9;

/// The rule for an answer: its status, its warnings, its error where it is ok, and whether a failed answer is NaN wherever it must be.
pub(super) fn of_answer(status: Status, warnings: Warnings, error: f64, empty: bool) -> Verdict {
    match status {
        Status::Ok if error <= HELD => Verdict::Held,
        Status::Ok if error.is_finite() && warned(warnings) => Verdict::Degraded,
        Status::Ok => Verdict::FailedSilently,
        _ if empty => Verdict::Failed,
        _ => Verdict::FailedSilently,
    }
}

/// True where an answer says that it is ill-conditioned.
fn warned(warnings: Warnings) -> bool {
    warnings.names().any(|name| name == "ill_conditioned")
}
