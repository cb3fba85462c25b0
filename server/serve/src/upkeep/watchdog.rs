//! The watchdog of the answering thread.

use std::io;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

use sarrus_proto::heartbeat::HeartbeatReader;

/// Without a heartbeat for this long, the answering thread counts as hanging.
pub(crate) const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest time of one step of this thread while it runs.
const STEP: Duration = Duration::from_millis(40);

/// Measures the time without a heartbeat while this thread runs: a stop of the whole process, such
/// as SIGSTOP, does not count.
pub(crate) struct Watchdog {
    heartbeat: HeartbeatReader,
    beats: u64,
    /// Running time of this thread since the last heartbeat.
    lost: Duration,
    polled: Instant,
}

impl Watchdog {
    pub(crate) fn new(heartbeat: &OwnedFd) -> io::Result<Watchdog> {
        let heartbeat = HeartbeatReader::new(heartbeat)?;
        Ok(Watchdog { heartbeat, beats: 0, lost: Duration::ZERO, polled: Instant::now() })
    }

    /// Updates the watchdog; call it often.
    pub(crate) fn poll(&mut self) {
        let beats = self.heartbeat.read().beats;
        let now = Instant::now();
        // a step that took longer was interrupted
        self.lost += (now - self.polled).min(STEP);
        self.polled = now;
        if beats != self.beats {
            (self.beats, self.lost) = (beats, Duration::ZERO);
        }
    }

    pub(crate) fn is_lost(&self) -> bool {
        self.lost > HEARTBEAT_TIMEOUT
    }
}
