//! When a server that died is started again; time is an argument.

use std::time::Duration;

/// So many deaths soon after a start …
const DEATHS: usize = 5;
/// … within this time are too many.
const WINDOW: Duration = Duration::from_secs(60);
/// The second of them waits this long, each further one twice as long as the one before.
const FIRST_DELAY: Duration = Duration::from_millis(100);
/// No start waits longer.
const LONGEST_DELAY: Duration = Duration::from_secs(5);

/// When the next start is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// After this time.
    After(Duration),
    /// Never: too many died too soon.
    Never,
}

/// Deaths so far.
pub(super) struct Backoff {
    short_life: Duration,
    /// Deaths soon after a start, one after the other.
    in_a_row: u32,
    /// When those within the window happened.
    times: Vec<Duration>,
}

impl Backoff {
    /// A life of this length or longer is no reason to wait.
    pub(super) fn new(short_life: Duration) -> Backoff {
        Backoff { short_life, in_a_row: 0, times: Vec::new() }
    }

    /// A server died at a time, so long after it was ready; `None` if it never was.
    pub(super) fn died(&mut self, now: Duration, life: Option<Duration>) -> Next {
        if life.is_some_and(|life| life >= self.short_life) {
            self.in_a_row = 0;
            return Next::After(Duration::ZERO);
        }
        self.in_a_row += 1;
        self.times.retain(|time| now.saturating_sub(*time) <= WINDOW);
        self.times.push(now);
        if self.times.len() >= DEATHS { Next::Never } else { Next::After(delay(self.in_a_row)) }
    }
}

/// Before the start that follows so many failures in a row.
pub(super) fn delay(failures: u32) -> Duration {
    match failures {
        0 | 1 => Duration::ZERO,
        n => FIRST_DELAY.saturating_mul(1 << (n - 2).min(16)).min(LONGEST_DELAY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Duration = Duration::from_secs(10);

    fn seconds(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    #[test]
    fn the_fifth_quick_death_within_a_minute_is_the_last() {
        let mut backoff = Backoff::new(LIMIT);
        for (now, delay) in [(1.0, 0.0), (2.0, 0.1), (3.0, 0.2), (4.0, 0.4)] {
            let next = backoff.died(seconds(now), Some(seconds(0.5)));
            assert_eq!(next, Next::After(seconds(delay)));
        }
        assert_eq!(backoff.died(seconds(5.0), None), Next::Never);
    }

    #[test]
    fn deaths_that_are_far_apart_go_on_for_ever_at_the_longest_delay() {
        let mut backoff = Backoff::new(LIMIT);
        let mut next = Next::Never;
        for k in 0..100 {
            next = backoff.died(seconds(20.0 * f64::from(k)), Some(seconds(9.9)));
            assert_ne!(next, Next::Never, "{k}");
        }
        assert_eq!(next, Next::After(seconds(5.0)));
    }

    #[test]
    fn after_a_long_life_the_next_starts_at_once() {
        let mut backoff = Backoff::new(LIMIT);
        for k in 0..1000 {
            let next = backoff.died(seconds(f64::from(k)), Some(LIMIT));
            assert_eq!(next, Next::After(Duration::ZERO));
        }
        // and begins the row anew
        assert_eq!(backoff.died(seconds(1e4), None), Next::After(Duration::ZERO));
        assert_eq!(backoff.died(seconds(1e4), None), Next::After(seconds(0.1)));
        backoff.died(seconds(1e4), Some(LIMIT));
        assert_eq!(backoff.died(seconds(1e4), None), Next::After(Duration::ZERO));
    }
}
