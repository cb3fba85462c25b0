//! What is counted, for those who watch.

use super::{BusEvent, Verdict};

/// How a bus is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusState {
    /// No trouble.
    Active,
    /// Many errors.
    Warning,
    /// Error-passive: nothing is armed.
    Passive,
    /// Off the bus: its mechanisms are in fault.
    Off,
}

impl BusState {
    /// The name that people see.
    pub const fn name(self) -> &'static str {
        match self {
            BusState::Active => "active",
            BusState::Warning => "warning",
            BusState::Passive => "passive",
            BusState::Off => "off",
        }
    }
}

/// Counts of the bridge since its start, and the newest times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Cycles.
    pub cycles: u64,
    /// Commands that were taken.
    pub accepted: u64,
    /// Commands with NaN or infinity.
    pub not_finite: u64,
    /// Commands with a negative gain.
    pub negative: u64,
    /// Commands that were not newer than the one before.
    pub old: u64,
    /// Commands from the future.
    pub ahead: u64,
    /// Commands for another model.
    pub wrong_model: u64,
    /// Commands for another number of actuators.
    pub wrong_size: u64,
    /// Answers of motors to the frames of a cycle.
    pub replies: u64,
    /// From the last cycle to the newest of them `[ns]`.
    pub reply_ns: u64,
    /// Age of the command in the last cycle `[ns]`.
    pub age_ns: u64,
}

/// Counts of one bus since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCounters {
    /// Frames received.
    pub received: u64,
    /// Frames of nobody's.
    pub unknown: u64,
    /// Frames of a motor that cannot be what they claim to be.
    pub malformed: u64,
    /// Frames that were not sent.
    pub dropped: u64,
    /// Frames that were lost on the way in.
    pub overrun: u64,
    /// Times that the bus became error-passive.
    pub passive: u64,
    /// Times that it went off.
    pub off: u64,
    /// Times that it came back.
    pub restarted: u64,
}

impl Counters {
    pub(super) fn add(&mut self, verdict: Verdict) {
        let counter = match verdict {
            Verdict::Accepted => &mut self.accepted,
            Verdict::NotFinite => &mut self.not_finite,
            Verdict::Negative => &mut self.negative,
            Verdict::Old => &mut self.old,
            Verdict::Ahead => &mut self.ahead,
            Verdict::WrongModel => &mut self.wrong_model,
            Verdict::WrongSize => &mut self.wrong_size,
        };
        *counter += 1;
    }
}

impl BusCounters {
    pub(super) fn add(&mut self, event: BusEvent) {
        match event {
            BusEvent::ErrorActive | BusEvent::ErrorWarning | BusEvent::Backlog(_) => {}
            BusEvent::ErrorPassive => self.passive += 1,
            BusEvent::BusOff => self.off += 1,
            BusEvent::Restarted => self.restarted += 1,
            BusEvent::Dropped(frames) => self.dropped += u64::from(frames),
            BusEvent::Overrun(frames) => self.overrun += u64::from(frames),
        }
    }
}
