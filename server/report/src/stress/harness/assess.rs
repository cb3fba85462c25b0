//! The assessment: one mechanical rule for every case.

use sarrus_dynamics::{Status, Warnings};

use crate::page::Assessment;

/// Error by size up to which an answer counts as right.
pub(crate) const HELD: f64 = 1e-9;

/// Assesses an answer by its status, its warnings, its error if it is ok, and the NaN of a failed
/// answer.
pub(crate) fn assess(status: Status, warnings: Warnings, error: f64, empty: bool) -> Assessment {
    match status {
        Status::Ok if error <= HELD => Assessment::Held,
        Status::Ok if error.is_finite() && warned(warnings, "ill_conditioned") => {
            Assessment::Degraded
        }
        Status::Ok => Assessment::FailedSilently,
        _ if empty => Assessment::Failed,
        _ => Assessment::FailedSilently,
    }
}

/// True if an answer has the warning of this name.
pub(crate) fn warned(warnings: Warnings, name: &str) -> bool {
    warnings.names().any(|of| of == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_answer_without_a_warning_has_failed_silently() {
        let none = Warnings::NONE;
        let limits = Warnings::LIMITS_EXCEEDED;
        let warned = Warnings::ILL_CONDITIONED;
        for (status, warnings, error, empty, assessment) in [
            (Status::Ok, none, 1e-10, false, Assessment::Held),
            (Status::Ok, warned, 1e-10, false, Assessment::Held),
            (Status::Ok, warned, 1e-3, false, Assessment::Degraded),
            (Status::Ok, none, 1e-8, false, Assessment::FailedSilently),
            (Status::Ok, limits, 1e-8, false, Assessment::FailedSilently),
            (Status::Ok, warned, f64::INFINITY, false, Assessment::FailedSilently),
            (Status::Ok, none, f64::NAN, false, Assessment::FailedSilently),
            (Status::Unreachable, none, f64::INFINITY, true, Assessment::Failed),
            (Status::Unreachable, none, f64::INFINITY, false, Assessment::FailedSilently),
        ] {
            assert_eq!(assess(status, warnings, error, empty), assessment, "{status} {error}");
        }
    }
}
