//! How a report is measured: processors, the machine's name, times, progress.

pub mod cores;
pub mod machine;
pub mod progress;
pub mod timing;

use std::time::Duration;

/// How much of one robot a section measures.
#[derive(Clone, Copy)]
pub(crate) struct Amount {
    pub(crate) states: usize,
    /// How long its batches take turns.
    pub(crate) rounds: Duration,
    /// How long a peer times each of its methods, in seconds.
    pub(crate) of_peer: f64,
}

/// How much a report measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// The whole report within two minutes on two slow cores.
    pub quick: bool,
}
