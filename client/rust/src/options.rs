use std::time::Duration;

/// Which way requests go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transport {
    /// A lane of one's own: the fastest way; a server has a bounded number of them.
    #[default]
    Lane,
    /// The service, shared by all clients.
    Service,
}

/// How a client waits for an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitStrategy {
    /// Polls without pause: the lowest latency for a whole processor while waiting.
    Busy,
    /// Polls for some microseconds, then lets others run: for computers with few processors.
    Polite,
}

impl WaitStrategy {
    /// Busy where at least three processors are there.
    pub fn auto() -> WaitStrategy {
        match std::thread::available_parallelism() {
            Ok(n) if n.get() >= 3 => WaitStrategy::Busy,
            _ => WaitStrategy::Polite,
        }
    }
}

/// How to connect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectOptions {
    /// Which way requests go.
    pub transport: Transport,
    /// How long one call waits at most, for a server that is gone to come back included.
    pub timeout: Duration,
    /// How to wait.
    pub wait_strategy: WaitStrategy,
    /// How long an answer may take, from the question to its publication by the server; a later one
    /// is [`crate::Status::Late`], without numbers. Late arrivals are counted by
    /// [`crate::Robot::late`] and in the server's [`crate::Statistics`]. Beyond 8 s none is late.
    /// Costs a few readings of the clock for each request; any time when `None`.
    pub deadline: Option<Duration>,
    /// The model that must be served; any when `None`.
    pub fingerprint: Option<u64>,
}

impl Default for ConnectOptions {
    /// A lane, one second, waiting as fits the number of processors, no deadline, any model.
    fn default() -> ConnectOptions {
        ConnectOptions {
            transport: Transport::Lane,
            timeout: Duration::from_secs(1),
            wait_strategy: WaitStrategy::auto(),
            deadline: None,
            fingerprint: None,
        }
    }
}
