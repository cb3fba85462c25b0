//! Measurement: the machine's name, times, progress, temporary folders.

pub mod machine;
pub mod progress;
pub mod timing;

use std::path::PathBuf;
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

/// A temporary folder, gone when dropped; its first user makes it.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Folder {
        let process = std::process::id();
        Folder(std::env::temp_dir().join(format!("sarrus-report-{process}-{name}")))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
