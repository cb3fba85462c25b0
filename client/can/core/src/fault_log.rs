//! What a bridge was given before a fault, as a log that replays: the last two seconds, and before
//! them what brought its motors to power.
//!
//! ```text
//! while mechanisms armed   gap   resume   the last two seconds   fault
//! ├──────────────────────┤ ─ ─ ─ ┤├──────────────────────────────┤
//! ```
//!
//! The bridge's own state is not in the log. What was given while some mechanism armed is kept from
//! the first one that got power on, and brings a new bridge and its drives to where they were; the
//! line `resume` goes over the time that is left out ([`Bridge::resume`]). So a replay stops for
//! the same reason; set-points may differ at its beginning, as those after late commands do. No
//! I/O; it allocates, and belongs into another thread than the bridge.

use std::collections::VecDeque;

#[cfg(doc)]
use crate::bridge::Bridge;
use crate::bridge::Progress;
use crate::log::{Line, What};

/// The time before a fault that is kept in full `[ns]`.
pub const WINDOW_NS: u64 = 2_000_000_000;
/// Lines of arming that are kept at most; what comes after them is left out.
const ARMING: usize = 400_000;

/// The lines that are kept.
#[derive(Debug)]
pub struct FaultLog {
    /// Lines of arming, with `resume` where something was left out.
    arming: Vec<Line>,
    /// The newest lines, and whether each is of arming.
    recent: VecDeque<(Line, bool)>,
    /// The last command that was left out since the newest line of arming.
    left_out: Option<Line>,
    has_gap: bool,
    progress: Progress,
}

impl Default for FaultLog {
    fn default() -> FaultLog {
        FaultLog {
            arming: Vec::new(),
            recent: VecDeque::new(),
            left_out: None,
            has_gap: false,
            progress: Progress::Idle,
        }
    }
}

impl FaultLog {
    /// Adds a line. Allocates.
    pub fn push(&mut self, line: Line) {
        let t = line.t;
        let is_arming = self.progress == Progress::Arming || matches!(line.what, What::Operate(..));
        self.recent.push_back((line, is_arming));
        while self.recent.front().is_some_and(|(line, _)| t.saturating_sub(line.t) > WINDOW_NS) {
            if let Some((line, is_arming)) = self.recent.pop_front() {
                self.leave(line, is_arming);
            }
        }
    }

    /// How far the bridge was after its last cycle.
    pub fn progress(&mut self, progress: Progress) {
        if progress == Progress::Idle && self.progress != Progress::Idle {
            // all that follows begins anew
            self.arming.clear();
            (self.left_out, self.has_gap) = (None, false);
            self.recent.iter_mut().for_each(|(_, is_arming)| *is_arming = false);
        }
        self.progress = progress;
    }

    /// All lines that are kept, in the order in which they came.
    pub fn lines(&self) -> impl Iterator<Item = Line> {
        let first = self.recent.front().map_or(0, |(line, _)| line.t);
        let gap = self.gap(first);
        self.arming
            .iter()
            .cloned()
            .chain(gap)
            .chain(self.recent.iter().map(|(line, _)| line.clone()))
    }

    /// What stands for what was left out before a time.
    fn gap(&self, t: u64) -> impl Iterator<Item = Line> + use<> {
        let is_gap = self.has_gap && !self.arming.is_empty();
        let command = self.left_out.clone().filter(|_| is_gap);
        command.into_iter().chain(is_gap.then_some(Line { t, what: What::Resume }))
    }

    /// A line is older than the window.
    fn leave(&mut self, line: Line, is_arming: bool) {
        if is_arming && self.arming.len() < ARMING {
            let gap = self.gap(line.t);
            self.arming.extend(gap);
            self.arming.push(line);
            (self.left_out, self.has_gap) = (None, false);
        } else {
            if matches!(line.what, What::Command(_)) {
                self.left_out = Some(line);
            }
            self.has_gap = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sarrus_proto::actuators::Operation;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_last_two_seconds_and_all_arming_are_kept() {
        let mut log = FaultLog::default();
        let cycle = |t: u64| Line { t: t * MS, what: What::Cycle };
        (0..1000).for_each(|t| log.push(cycle(t)));
        log.push(Line { t: 1000 * MS, what: What::Operate(Operation::Arm, None) });
        log.progress(Progress::Arming);
        (1001..1100).for_each(|t| log.push(cycle(t)));
        log.progress(Progress::Powered);
        (1100..10_000).for_each(|t| log.push(cycle(t)));
        let lines: Vec<Line> = log.lines().collect();
        assert!(matches!(lines[0].what, What::Operate(Operation::Arm, None)));
        assert_eq!(lines[1..100], (1001..1100).map(cycle).collect::<Vec<_>>());
        assert_eq!(lines[100], Line { t: 7999 * MS, what: What::Resume });
        assert_eq!(lines[101..], (7999..10_000).map(cycle).collect::<Vec<_>>());
        // without power all of it begins anew
        log.progress(Progress::Idle);
        (10_000..20_000).for_each(|t| log.push(cycle(t)));
        assert_eq!(log.lines().next(), Some(cycle(17_999)));
    }
}
