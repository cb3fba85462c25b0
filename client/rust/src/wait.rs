//! Waiting for an answer: polling first, with rare clock reads.

use std::time::{Duration, Instant};

use crate::WaitStrategy;

/// Polls between two readings of the clock.
const POLLS_BETWEEN_LOOKS: u32 = 256;
/// A polite client polls for this long before it yields.
const POLITE: Duration = Duration::from_micros(20);
/// After this time microseconds no longer matter.
const LONG: Duration = Duration::from_millis(5);
/// Time between two checks of the server's heartbeat.
const LIFE: Duration = Duration::from_millis(1);

/// One wait, from its start.
pub(crate) struct Waiter {
    wait_strategy: WaitStrategy,
    polls: u32,
    start: Option<Instant>,
    yielding: bool,
    next_look: Duration,
}

impl Waiter {
    pub(crate) fn new(wait_strategy: WaitStrategy) -> Waiter {
        Waiter { wait_strategy, polls: 0, start: None, yielding: false, next_look: LIFE }
    }

    /// Pauses between two polls; returns the time waited when a check of the server's heartbeat is
    /// due.
    #[inline]
    pub(crate) fn pause(&mut self) -> Option<Duration> {
        std::hint::spin_loop();
        self.polls += 1;
        if !self.yielding && self.polls < POLLS_BETWEEN_LOOKS {
            return None;
        }
        self.polls = 0;
        self.look()
    }

    #[cold]
    fn look(&mut self) -> Option<Duration> {
        let waited = self.start.get_or_insert_with(Instant::now).elapsed();
        if waited > LONG {
            std::thread::sleep(Duration::from_micros(50));
        } else if self.wait_strategy == WaitStrategy::Polite && waited > POLITE {
            self.yielding = true;
            std::thread::yield_now();
        }
        if waited < self.next_look {
            return None;
        }
        self.next_look = waited + LIFE;
        Some(waited)
    }
}
