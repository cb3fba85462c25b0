//! Damaged and hostile inputs for everything of sarrus that reads: files, lines, messages.
//!
//! A target ([`Target`]) is a reader with the laws that hold for every input: it reads or it says
//! what is wrong and where, the same each time, and what it writes it reads again. Inputs are its
//! seeds with random changes ([`mutate`]); one whose outcome is new becomes a seed itself
//! ([`run()`]). The same seed number gives the same inputs.

pub mod mutate;
mod run;
pub mod targets;

pub use run::{Failure, Limits, Outcome, Progress, hash, replay, run};
pub use targets::{TARGETS, Target};
