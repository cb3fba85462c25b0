//! Measurement: the machine's name, times, progress.

pub mod machine;
pub mod progress;
pub mod timing;

use std::time::Duration;

/// The effort of a section for one robot.
#[derive(Clone, Copy)]
pub(crate) struct Amount {
    pub(crate) states: usize,
    /// Duration of its alternating batches.
    pub(crate) rounds: Duration,
    /// Seconds in which a peer times each of its methods.
    pub(crate) of_peer: f64,
}

/// The effort of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// The whole report within three minutes on two slow cores, with every peer.
    pub quick: bool,
}
