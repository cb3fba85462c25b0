//! Inputs of a bridge before a fault, as a log that replays: the last two seconds, and before them
//! the arming of its motors.
//!
//! ```text
//! resume   while mechanisms armed   gap   resume   the last two seconds   fault
//!         ├────────────────────────┤ ─ ─ ─ ┤      ├──────────────────────┤
//! ```
//!
//! The bridge's own state is not in the log. Inputs during arming are kept from the first mechanism
//! that got power, and bring a new bridge and its drives to the same state: drives set and read all
//! their settings at arming. The line `resume` skips a gap, also one before the first line that is
//! kept ([`Bridge::resume`]), and names the actuators whose mechanisms have power at that time,
//! whose mechanisms failed, and whose motors are known to answer in time. So a replay stops for the
//! same reason; set-points may differ at its beginning, as they do after late commands. No I/O.
//! Allocates, so it belongs in another thread than the bridge.

use std::collections::VecDeque;

use crate::bridge::{Bookmark, Bridge, Progress};
use crate::log::{Line, What};

/// The time before a fault for which all inputs are kept `[ns]`.
pub const WINDOW_NS: u64 = 2_000_000_000;
/// Time that is kept before an operation and after a mechanism has armed `[ns]`: drives
/// of a new bridge may be some frames behind those of the run.
const AROUND_NS: u64 = 200_000_000;
/// Most lines of arming that are kept; later ones are omitted.
const ARMING: usize = 400_000;

/// The state of a bridge after a cycle, as far as a fault log needs it.
#[derive(Clone, Copy, Debug)]
pub struct After {
    /// The stage of the bridge.
    pub progress: Progress,
    /// The state of its actuators.
    pub bookmark: Bookmark,
}

impl After {
    /// After the last cycle of a bridge.
    pub fn cycle_of(bridge: &Bridge) -> After {
        After { progress: bridge.progress(), bookmark: bridge.bookmark() }
    }
}

/// A line that is kept.
#[derive(Debug)]
struct Kept {
    line: Line,
    is_arming: bool,
    /// How the bridge was after it, where it was a cycle.
    bookmark: Option<Bookmark>,
}

/// The lines that are kept.
#[derive(Debug, Default)]
pub struct FaultLog {
    /// Lines of arming, with `resume` where something was left out.
    arming: Vec<Line>,
    /// The newest lines.
    recent: VecDeque<Kept>,
    /// The last command that was left out since the newest line of arming.
    left_out: Option<Line>,
    has_gap: bool,
    /// How the bridge was after the last line that is older than the newest ones.
    bookmark: Bookmark,
    progress: Progress,
    /// Time of the last operation, or when a mechanism was last arming `[ns]`.
    arming_ns: Option<u64>,
    /// Nothing has power any more: all that follows begins anew.
    is_over: bool,
}

impl FaultLog {
    /// Adds a line. Allocates.
    pub fn push(&mut self, line: Line) {
        // not before: a fault that leaves nothing with power is written first
        if std::mem::take(&mut self.is_over) {
            self.has_gap |= !self.arming.is_empty();
            self.arming.clear();
            (self.left_out, self.arming_ns) = (None, None);
            self.recent.iter_mut().for_each(|kept| kept.is_arming = false);
        }
        let t = line.t;
        if matches!(line.what, What::Operate(..)) {
            let recent = self.recent.iter_mut().rev();
            recent
                .take_while(|kept| t.saturating_sub(kept.line.t) <= AROUND_NS)
                .for_each(|kept| kept.is_arming = true);
            self.arming_ns = Some(t);
        } else if self.progress == Progress::Arming {
            self.arming_ns = Some(t);
        }
        let is_arming = self.arming_ns.is_some_and(|armed| t.saturating_sub(armed) <= AROUND_NS);
        self.recent.push_back(Kept { line, is_arming, bookmark: None });
        while self.recent.front().is_some_and(|kept| t.saturating_sub(kept.line.t) > WINDOW_NS) {
            if let Some(kept) = self.recent.pop_front() {
                self.leave(kept);
            }
        }
    }

    /// How the bridge was after the cycle that was the last line.
    pub fn after(&mut self, after: After) {
        self.is_over = after.progress == Progress::Idle && self.progress != Progress::Idle;
        self.progress = after.progress;
        if let Some(kept) = self.recent.back_mut() {
            kept.bookmark = Some(after.bookmark);
        }
    }

    /// All lines that are kept, in the order in which they came.
    pub fn lines(&self) -> impl Iterator<Item = Line> {
        let first = self.recent.front().map_or(0, |kept| kept.line.t);
        let gap = self.gap(first);
        self.arming
            .iter()
            .cloned()
            .chain(gap)
            .chain(self.recent.iter().map(|kept| kept.line.clone()))
    }

    /// Lines in place of a gap before a time.
    fn gap(&self, t: u64) -> impl Iterator<Item = Line> + use<> {
        let resume = Line { t, what: What::Resume(self.bookmark) };
        let command = self.left_out.clone().map(|command| Line { t, ..command });
        self.has_gap.then_some(resume).into_iter().chain(command.filter(|_| self.has_gap))
    }

    /// A line is older than the window.
    fn leave(&mut self, kept: Kept) {
        let Kept { line, is_arming, bookmark } = kept;
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
        self.bookmark = bookmark.unwrap_or(self.bookmark);
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
        let bookmark = Bookmark { live: 1, fault: 0, in_time: 1 };
        log.after(After { progress: Progress::Arming, bookmark });
        (1001..1100).for_each(|t| log.push(cycle(t)));
        log.after(After { progress: Progress::Powered, bookmark });
        (1100..10_000).for_each(|t| log.push(cycle(t)));
        let lines: Vec<Line> = log.lines().collect();
        let resume = |t: u64, mark| Line { t: t * MS, what: What::Resume(mark) };
        // the bridge had begun before
        assert_eq!(lines[0], resume(800, Bookmark::default()));
        assert_eq!(lines[1..201], (800..1000).map(cycle).collect::<Vec<_>>());
        assert!(matches!(lines[201].what, What::Operate(Operation::Arm, None)));
        assert_eq!(lines[202..501], (1001..1300).map(cycle).collect::<Vec<_>>());
        assert_eq!(lines[501], resume(7999, bookmark));
        assert_eq!(lines[502..], (7999..10_000).map(cycle).collect::<Vec<_>>());
        // a fault that takes all power is written with its history, and then the log starts again
        let off = Bookmark { live: 0, fault: 1, in_time: 1 };
        log.after(After { progress: Progress::Idle, bookmark: off });
        assert_eq!(log.lines().count(), lines.len());
        (10_000..20_000).for_each(|t| log.push(cycle(t)));
        assert_eq!(log.lines().next(), Some(resume(17_999, off)));
        assert_eq!(log.lines().nth(1), Some(cycle(17_999)));
    }
}
