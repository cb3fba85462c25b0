//! Damaged and hostile inputs for every reader of the project: files, lines, messages.
//!
//! A target ([`Target`]) is a reader with the laws that hold for every input: it accepts the input
//! or reports the fault and its place, it gives the same outcome each time, and it reads back
//! everything that it writes. Inputs are the target's seeds with random changes ([`mutate`]); an
//! input with a new outcome becomes a seed itself ([`run()`]). A seed number fixes all inputs.

pub mod mutate;
mod run;
pub mod targets;

pub use run::{Failure, Limits, Outcome, Progress, hash, replay, run};
pub use targets::{TARGETS, Target};
