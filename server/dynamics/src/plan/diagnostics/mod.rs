//! Rare outputs: conditions of a closed state, and outputs of a failure.

mod conditions;
pub(super) mod digits;
mod failure;
mod nearest;
pub(super) mod singular;
