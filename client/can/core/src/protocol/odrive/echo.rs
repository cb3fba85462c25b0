//! Measures the round trip of an ODrive before it gets power.
//!
//! Heartbeats and estimates are cyclic and have no time stamp. A read endpoint is answered at once:
//! while the motor has no power both endpoints of the watchdog are read in turn, one question at a
//! time. An answer names its endpoint, so a late one is not mistaken for the answer to the next
//! question. After a lost answer the next question waits twice as long, and the round trip is the
//! longer of both endpoints since then, so that no delay is underestimated.

use crate::state::state;

/// Time for the first answer, after which it counts as lost `[ns]`.
const LOST_NS: u64 = 300_000_000;

/// One question at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    /// The parameter that was read last, and when `[ns]`; `None` once it was answered.
    asked: Option<(usize, u64)>,
    /// The parameter of the next question.
    next: usize,
    /// Time for the answer `[ns]`.
    lost_ns: u64,
    /// Time of the last answer of each parameter since one was lost `[ns]`.
    taken_ns: [Option<u64>; 2],
}

impl Default for Echo {
    fn default() -> Echo {
        Echo { asked: None, next: 0, lost_ns: LOST_NS, taken_ns: [None; 2] }
    }
}

impl Echo {
    /// The parameter to read now, if another question is due.
    pub(super) fn ask(&mut self, now_ns: u64) -> Option<usize> {
        if let Some((_, asked_ns)) = self.asked {
            if now_ns.saturating_sub(asked_ns) < self.lost_ns {
                return None;
            }
            (self.lost_ns, self.taken_ns) = (self.lost_ns.saturating_mul(2), [None; 2]);
        }
        self.asked = Some((self.next, now_ns));
        self.next = 1 - self.next;
        self.asked.map(|(parameter, _)| parameter)
    }

    /// A parameter was answered.
    pub(super) fn answered(&mut self, now_ns: u64, parameter: usize) {
        if let Some((_, asked_ns)) = self.asked.filter(|(asked, _)| *asked == parameter) {
            let taken_ns = now_ns.saturating_sub(asked_ns);
            if let Some(of_parameter) = self.taken_ns.get_mut(parameter) {
                *of_parameter = Some(taken_ns);
            }
            (self.asked, self.lost_ns) = (None, LOST_NS);
        }
    }

    /// The time that an answer takes, as far as it is known at a time `[ns]`.
    pub(super) fn round_trip_ns(&self, now_ns: u64) -> u64 {
        let waiting_ns = self.asked.map_or(0, |(_, asked_ns)| now_ns.saturating_sub(asked_ns));
        let longest = self.taken_ns.map(|taken_ns| taken_ns.unwrap_or(u64::MAX)).into_iter().max();
        longest.unwrap_or(u64::MAX).max(waiting_ns)
    }
}

state!(Echo { asked, next, lost_ns, taken_ns });

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// The shortest round trip that was believed in ten seconds of a delay.
    fn shortest(delay_ns: u64) -> u64 {
        let mut echo = Echo::default();
        let mut answers = Vec::new();
        let mut shortest = u64::MAX;
        for now_ns in (0..10_000 * MS).step_by(4_000_000) {
            answers.retain(|(at_ns, parameter)| {
                let is_due = *at_ns <= now_ns;
                if is_due {
                    echo.answered(now_ns, *parameter);
                }
                !is_due
            });
            answers.extend(echo.ask(now_ns).map(|parameter| (now_ns + delay_ns, parameter)));
            shortest = shortest.min(echo.round_trip_ns(now_ns));
        }
        shortest
    }

    #[test]
    fn a_delay_is_never_taken_for_a_shorter_one() {
        assert!(shortest(0) <= 4 * MS);
        for delay_ms in 20..3000 {
            let found_ns = shortest(delay_ms * MS);
            assert!(found_ns >= 20 * MS, "{delay_ms} ms looked like {found_ns} ns");
        }
    }
}
