//! The age of a measurement, from requests and answers that pauses pair.
//!
//! A motor whose replies wait in a queue answers once a cycle like any other. The bridge therefore
//! pauses its requests and listens: a punctual motor falls silent, a late one continues to answer
//! earlier requests, and an answer later than `late_ms` after the last request is at least that
//! old. Without losses the open requests bound the age, so a pause is made when answers begin,
//! without power, and afterwards only when more requests are open than `late_ms` holds. With power
//! the pause begins in a cycle whose request was answered; one cycle without an answer ends it, and
//! open requests count as lost. A motor is armed only after such a pause.
//!
//! The monitor cannot see the age of measurements that the motor itself sends late, nor that of
//! motors that measure without being asked. If a drive has another question that is answered
//! (`Drive::round_trip_ns`), that answer must be in time before power; in all other cases a delay
//! shows as a contradiction of the set-points (`effort`, `frozen`).

use super::answers::Answers;
use crate::state::{state, state_of_enum};

/// More open requests than this are lost in any case.
const MOST_OPEN: u32 = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing is known yet.
    Unknown,
    /// Sends no requests and listens.
    Pause,
    /// In time.
    Good,
}

#[derive(Clone, Copy, Debug)]
pub(in crate::bridge) struct Age {
    phase: Phase,
    late_ns: u64,
    /// More open requests than this cause a pause.
    most_open: u32,
    /// When the motor was last asked, and whether it answered since.
    asked_ns: u64,
    answered_ns: u64,
    is_answered: bool,
    is_late: bool,
}

impl Age {
    pub(super) fn new(late: f64, period_ns: u64, feedback_ns: u64) -> Age {
        let late_ns = ((late * 1e9) as u64).max(period_ns * 5 / 2);
        // a pause must not look like a motor that fell silent
        let is_off = late == f64::INFINITY || late_ns + 2 * period_ns > feedback_ns;
        Age {
            phase: if is_off { Phase::Good } else { Phase::Unknown },
            late_ns: if is_off { u64::MAX } else { late_ns },
            most_open: (late_ns / period_ns.max(1)).saturating_add(2).min(u64::from(u32::MAX))
                as u32,
            asked_ns: 0,
            answered_ns: 0,
            is_answered: false,
            is_late: false,
        }
    }

    /// Whether the motor goes without a request in this cycle.
    pub(in crate::bridge) fn pauses(
        &mut self,
        now_ns: u64,
        has_power: bool,
        answers: &mut Answers,
    ) -> bool {
        if self.late_ns == u64::MAX {
            return false;
        }
        match self.phase {
            Phase::Pause if has_power => {
                if !self.is_answered {
                    self.phase = Phase::Good;
                    answers.forgive();
                }
            }
            Phase::Pause => {
                // one lost answer is no silence
                let last_ns = self.asked_ns.max(self.answered_ns);
                if now_ns.saturating_sub(last_ns) > self.late_ns {
                    self.phase = if self.is_late { Phase::Unknown } else { Phase::Good };
                    answers.forgive();
                }
            }
            Phase::Unknown | Phase::Good => {
                let is_doubtful =
                    self.phase == Phase::Unknown && !has_power || answers.open > self.most_open;
                if self.is_answered && is_doubtful {
                    self.phase = Phase::Pause;
                    self.is_late = false;
                }
            }
        }
        self.is_answered = false;
        if self.phase != Phase::Pause {
            self.asked_ns = now_ns;
        }
        self.phase == Phase::Pause
    }

    /// A measurement came.
    pub(in crate::bridge) fn take(&mut self, now_ns: u64) {
        (self.is_answered, self.answered_ns) = (true, now_ns);
        self.is_late |=
            self.phase == Phase::Pause && now_ns.saturating_sub(self.asked_ns) > self.late_ns;
    }

    /// The bridge could not hear its answers until now.
    pub(in crate::bridge) fn excuse(&mut self, now_ns: u64) {
        if self.phase == Phase::Pause {
            self.asked_ns = now_ns;
        }
    }

    /// The motor may be another one when it answers again.
    pub(in crate::bridge) fn forget(&mut self) {
        if self.late_ns != u64::MAX {
            self.phase = Phase::Unknown;
        }
    }

    /// Whether it is not known to be in time.
    pub(in crate::bridge) fn is_unknown(&self) -> bool {
        self.phase != Phase::Good
    }

    /// Whether an answer that took this long is late `[ns]`.
    pub(in crate::bridge) fn is_beyond(&self, round_trip_ns: u64) -> bool {
        self.late_ns < u64::MAX && round_trip_ns > self.late_ns
    }

    /// Whether so many open requests may all still be answered.
    pub(super) fn explains(&self, open: u32) -> bool {
        open <= self.most_open.min(MOST_OPEN)
    }

    pub(super) fn is_late(&self) -> bool {
        self.is_late
    }
}

state_of_enum!(Phase { Unknown, Pause, Good });
state!(Age { phase, asked_ns, answered_ns, is_answered, is_late; late_ns, most_open });
