//! The delay before a server that died is started again; time is an argument.

use std::time::Duration;

/// Number of early deaths within [`WINDOW`] after which the supervisor gives up.
const DEATHS: usize = 5;
const WINDOW: Duration = Duration::from_secs(60);
/// The delay after the second such death in a row; each further one doubles it.
const FIRST_DELAY: Duration = Duration::from_millis(100);
const LONGEST_DELAY: Duration = Duration::from_secs(5);

/// The deaths so far.
pub(super) struct Backoff {
    short_life: Duration,
    /// Consecutive deaths soon after a start.
    in_a_row: u32,
    /// Times of those within the window.
    times: Vec<Duration>,
}

impl Backoff {
    /// A server that lived for `short_life` or longer is started again without delay.
    pub(super) fn new(short_life: Duration) -> Backoff {
        Backoff { short_life, in_a_row: 0, times: Vec::new() }
    }

    /// Counts a death at time `now`, `life` after the server was ready (`None` if it never was);
    /// the delay of the next start, `None` after too many early deaths.
    pub(super) fn died(&mut self, now: Duration, life: Option<Duration>) -> Option<Duration> {
        if life.is_some_and(|life| life >= self.short_life) {
            self.in_a_row = 0;
            return Some(Duration::ZERO);
        }
        self.in_a_row += 1;
        self.times.retain(|time| now.saturating_sub(*time) <= WINDOW);
        self.times.push(now);
        (self.times.len() < DEATHS).then(|| delay(self.in_a_row))
    }
}

/// The delay after a number of failures in a row.
fn delay(failures: u32) -> Duration {
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
            assert_eq!(next, Some(seconds(delay)));
        }
        assert_eq!(backoff.died(seconds(5.0), None), None);
    }

    #[test]
    fn deaths_that_are_far_apart_go_on_for_ever_at_the_longest_delay() {
        let mut backoff = Backoff::new(LIMIT);
        let mut next = None;
        for k in 0..100 {
            next = backoff.died(seconds(20.0 * f64::from(k)), Some(seconds(9.9)));
            assert_ne!(next, None, "{k}");
        }
        assert_eq!(next, Some(seconds(5.0)));
    }

    #[test]
    fn after_a_long_life_the_next_starts_at_once() {
        let mut backoff = Backoff::new(LIMIT);
        for k in 0..1000 {
            let next = backoff.died(seconds(f64::from(k)), Some(LIMIT));
            assert_eq!(next, Some(Duration::ZERO));
        }
        // and a new series begins
        assert_eq!(backoff.died(seconds(1e4), None), Some(Duration::ZERO));
        assert_eq!(backoff.died(seconds(1e4), None), Some(seconds(0.1)));
        backoff.died(seconds(1e4), Some(LIMIT));
        assert_eq!(backoff.died(seconds(1e4), None), Some(Duration::ZERO));
    }
}
