//! The verdict: one mechanical rule for every case.

use sarrus_dynamics::{Status, Warnings};

/// Error by size up to which an answer counts as right.
pub(crate) const HELD: f64 = 1e-9;

/// What became of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Status ok and an error of at most 1e-9 by size.
    Held,
    /// Status ok, a larger error, and the answer says that it is ill-conditioned.
    Degraded,
    /// Any other status with no number beside it, an error at load, a simulation that stops with a status.
    Failed,
    /// Everything else.
    Silent,
}

impl Verdict {
    /// Every verdict, best first.
    pub const ALL: [Verdict; 4] = [Verdict::Held, Verdict::Degraded, Verdict::Failed, Verdict::Silent];

    /// The name that readers see.
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::Held => "held",
            Verdict::Degraded => "degraded and said so",
            Verdict::Failed => "failed and said so",
            Verdict::Silent => "failed silently",
        }
    }
}

/// The rule for an answer: its status, its warnings, its error where it is ok, and whether a failed answer is NaN wherever it must be.
pub(crate) fn of_answer(status: Status, warnings: Warnings, error: f64, empty: bool) -> Verdict {
    match status {
        Status::Ok if error <= HELD => Verdict::Held,
        Status::Ok if error.is_finite() && warned(warnings) => Verdict::Degraded,
        Status::Ok => Verdict::Silent,
        _ if empty => Verdict::Failed,
        _ => Verdict::Silent,
    }
}

/// True where an answer says that it is ill-conditioned.
fn warned(warnings: Warnings) -> bool {
    warnings.names().any(|name| name == "ill_conditioned")
}
