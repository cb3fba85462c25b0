//! The verdict: one mechanical rule for every case.

use sarrus_dynamics::{Status, Warnings};

use crate::page::Verdict;

/// Error by size up to which an answer counts as right.
pub(crate) const HELD: f64 = 1e-9;

/// The rule for an answer: its status, its warnings, its error where it is ok, and whether a failed
/// answer is NaN wherever it must be.
pub(crate) fn of_answer(status: Status, warnings: Warnings, error: f64, empty: bool) -> Verdict {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_that_is_wrong_without_a_word_has_failed_silently() {
        let (none, limits) = (Warnings::NONE, Warnings::LIMITS_EXCEEDED);
        let warned = Warnings::ILL_CONDITIONED;
        for (status, warnings, error, empty, verdict) in [
            (Status::Ok, none, 1e-10, false, Verdict::Held),
            (Status::Ok, warned, 1e-10, false, Verdict::Held),
            (Status::Ok, warned, 1e-3, false, Verdict::Degraded),
            (Status::Ok, none, 1e-8, false, Verdict::FailedSilently),
            (Status::Ok, limits, 1e-8, false, Verdict::FailedSilently),
            (Status::Ok, warned, f64::INFINITY, false, Verdict::FailedSilently),
            (Status::Ok, none, f64::NAN, false, Verdict::FailedSilently),
            (Status::Unreachable, none, f64::INFINITY, true, Verdict::Failed),
            (Status::Unreachable, none, f64::INFINITY, false, Verdict::FailedSilently),
        ] {
            assert_eq!(of_answer(status, warnings, error, empty), verdict, "{status} {error}");
        }
    }
}
