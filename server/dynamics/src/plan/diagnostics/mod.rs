//! What is asked rarely: conditions of a closed state, and what a failure can still report.

mod conditions;
pub(super) mod digits;
mod failure;
mod nearest;
pub(super) mod singular;
