//! Waiting of the answering thread between requests.

use std::time::Duration;

/// How the answering thread waits for requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// Polls without pause: the lowest latency for a whole processor.
    Busy,
    /// Polls while requests come; after 0.2 ms without one sleeps 50 µs at a time, after 0.2 s
    /// without one 1 ms at a time. The first request after a pause waits that long plus the wake-up
    /// time of the kernel: on a two-core virtual machine 60 µs (p50) at 1 kHz. Costs about an
    /// eighth of a processor between requests and a twenty-fifth when quiet.
    Sleep,
}

impl Wait {
    /// Busy if there are at least three processors: one for the server, one for a client, one for
    /// everything else.
    pub fn auto() -> Wait {
        match std::thread::available_parallelism() {
            Ok(n) if n.get() >= 3 => Wait::Busy,
            _ => Wait::Sleep,
        }
    }
}

/// In sleeping mode: the length of one sleep while requests arrive occasionally.
pub(crate) const NAP: Duration = Duration::from_micros(50);

/// In sleeping mode: without a request for this long, sleeps are long.
pub(crate) const QUIET: Duration = Duration::from_millis(200);

/// In sleeping mode: the length of one long sleep.
pub(crate) const LONG_NAP: Duration = Duration::from_millis(1);
