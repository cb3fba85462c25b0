//! How a report is measured: processors, the machine's name, times, progress.

pub mod cores;
pub mod machine;
pub mod progress;
pub mod timing;

/// How much a report measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// The whole report within two minutes on two slow cores.
    pub quick: bool,
}
