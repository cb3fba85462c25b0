use std::time::Duration;

/// Which way requests go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Door {
    /// A lane of one's own: the fastest way; a server has a bounded number of them.
    #[default]
    Lane,
    /// The requests door, shared by all clients.
    Requests,
}

/// How a client waits for an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// Polls without pause: the lowest latency for a whole processor while waiting.
    Busy,
    /// Polls for some microseconds, then lets others run: for computers with few processors.
    Polite,
}

impl Patience {
    /// Busy where at least three processors are there.
    pub fn fitting() -> Patience {
        match std::thread::available_parallelism() {
            Ok(n) if n.get() >= 3 => Patience::Busy,
            _ => Patience::Polite,
        }
    }
}

/// How to connect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectOptions {
    /// Which way requests go.
    pub door: Door,
    /// How long one call waits at most, for a server that is gone to come back included.
    pub timeout: Duration,
    /// How to wait.
    pub patience: Patience,
    /// The model that must be served; any when `None`.
    pub fingerprint: Option<u64>,
}

impl Default for ConnectOptions {
    /// A lane, one second, waiting as fits the number of processors, any model.
    fn default() -> ConnectOptions {
        ConnectOptions {
            door: Door::Lane,
            timeout: Duration::from_secs(1),
            patience: Patience::fitting(),
            fingerprint: None,
        }
    }
}
