//! Whether the answering thread lives, as seen from the thread beside it.

use std::io;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

use sarrus_proto::heartbeat::HeartbeatReader;

/// Without a heartbeat for this long, the answering thread hangs.
pub(crate) const PULSE: Duration = Duration::from_secs(10);

/// Time that a step of this thread takes at most where nothing keeps it from running.
const STEP: Duration = Duration::from_millis(40);

/// Whether the answering thread lives, as far as this thread does: what keeps the whole process
/// from running, such as SIGSTOP, is no fault of that one.
pub(crate) struct Pulse {
    heartbeat: HeartbeatReader,
    beats: u64,
    /// How long this thread has run and felt none.
    lost: Duration,
    felt: Instant,
}

impl Pulse {
    pub(crate) fn new(heartbeat: &OwnedFd) -> io::Result<Pulse> {
        let heartbeat = HeartbeatReader::new(heartbeat)?;
        Ok(Pulse { heartbeat, beats: 0, lost: Duration::ZERO, felt: Instant::now() })
    }

    /// Call it often.
    pub(crate) fn feel(&mut self) {
        let (beats, now) = (self.heartbeat.read().beats, Instant::now());
        // a step that took longer did not run all the time
        self.lost += (now - self.felt).min(STEP);
        self.felt = now;
        if beats != self.beats {
            (self.beats, self.lost) = (beats, Duration::ZERO);
        }
    }

    pub(crate) fn is_lost(&self) -> bool {
        self.lost > PULSE
    }
}
