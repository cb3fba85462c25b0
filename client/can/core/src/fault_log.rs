//! Inputs of a bridge before a fault, as a log that replays: the bridge's state some seconds before
//! the fault, and every input since then.
//!
//! ```text
//! state   inputs   the last two seconds at least   fault
//! ├───────────────┼────────────────────────────────┤
//! ```
//!
//! The state is complete ([`Bridge::save`](crate::bridge::Bridge::save)): a replay makes the same
//! frames and ends in the same fault at the same cycle. A log of a bridge that is younger begins
//! with the bridge and has no state. No I/O. Allocates, so it belongs in another thread than the
//! bridge.

use std::collections::VecDeque;

use crate::log::{Line, What};

/// The time before a fault for which all inputs are kept `[ns]`.
pub const WINDOW_NS: u64 = 2_000_000_000;

/// Time between two states of the bridge `[ns]`.
pub const STATE_NS: u64 = 1_000_000_000;

/// A state, and the inputs after it.
#[derive(Debug, Default)]
struct Part {
    /// `None` where the bridge begins.
    state: Option<(u64, Vec<u64>)>,
    lines: Vec<Line>,
}

/// The lines that are kept.
#[derive(Debug)]
pub struct FaultLog {
    /// From the newest state that is older than the window on.
    parts: VecDeque<Part>,
    /// Inputs were lost, and no state came since then.
    is_broken: bool,
}

impl Default for FaultLog {
    fn default() -> FaultLog {
        FaultLog { parts: VecDeque::from([Part::default()]), is_broken: false }
    }
}

impl FaultLog {
    /// Adds a line. Allocates.
    pub fn push(&mut self, line: Line) {
        if let (Some(part), false) = (self.parts.back_mut(), self.is_broken) {
            part.lines.push(line);
        }
    }

    /// Takes the state after the last line, at `t`; gives the room of one that is not kept any
    /// more.
    pub fn state(&mut self, t: u64, words: Vec<u64>) -> Option<Vec<u64>> {
        self.is_broken = false;
        self.parts.push_back(Part { state: Some((t, words)), lines: Vec::new() });
        let next = self.parts.get(1).and_then(|part| part.state.as_ref());
        if next.is_some_and(|(begin, _)| t.saturating_sub(*begin) >= WINDOW_NS) {
            return self.parts.pop_front().and_then(|part| part.state).map(|(_, words)| words);
        }
        None
    }

    /// Inputs were lost: the log begins again with the next state. Gives the rooms of the states.
    pub fn lose(&mut self) -> impl Iterator<Item = Vec<u64>> + use<> {
        self.is_broken = true;
        std::mem::take(&mut self.parts).into_iter().filter_map(|part| Some(part.state?.1))
    }

    /// All lines that are kept, in the order in which they came.
    pub fn lines(&self) -> impl Iterator<Item = Line> {
        let first = self.parts.front().and_then(|part| part.state.as_ref());
        let state = first.map(|(t, words)| Line { t: *t, what: What::State(words[..].into()) });
        state.into_iter().chain(self.parts.iter().flat_map(|part| part.lines.iter().cloned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_last_two_seconds_and_the_state_before_them_are_kept() {
        let mut log = FaultLog::default();
        let cycle = |t: u64| Line { t: t * MS, what: What::Cycle };
        let state = |t: u64| Line { t: t * MS, what: What::State([t].into()) };
        let mut rooms = 0;
        for t in 0..10_000 {
            log.push(cycle(t));
            if t == 900 {
                // the bridge began here
                assert_eq!(
                    log.lines().collect::<Vec<_>>(),
                    (0..901).map(cycle).collect::<Vec<_>>()
                );
            }
            if t % 1000 == 999 {
                rooms += usize::from(log.state(t * MS, vec![t]).is_some());
            }
        }
        let lines: Vec<Line> = log.lines().collect();
        assert_eq!(lines[0], state(7999));
        assert_eq!(lines[1..], (8000..10_000).map(cycle).collect::<Vec<_>>());
        assert_eq!(rooms, 7, "no room is lost");
        // a loss breaks the log until the next state
        assert_eq!(log.lose().count(), 3);
        log.push(cycle(10_000));
        assert_eq!(log.lines().count(), 0);
        log.state(10_001 * MS, vec![10_001]);
        log.push(cycle(10_002));
        assert_eq!(log.lines().collect::<Vec<_>>(), [state(10_001), cycle(10_002)]);
    }
}
