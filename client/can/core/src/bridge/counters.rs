//! Counters for monitoring.

use sarrus_proto::counts::{BusCounts, CommandCounts};

use crate::event::BusEvent;

/// Counts of the bridge since its start, and the newest times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Cycles.
    pub cycles: u64,
    /// Commands, by verdict.
    pub commands: CommandCounts,
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
    /// Its frames and troubles.
    pub counts: BusCounts,
    /// Times that it came back.
    pub restarted: u64,
    /// Frames with identifiers that only this bridge sends on, its own echo among them.
    pub foreign: u64,
}

impl BusCounters {
    pub(super) fn add(&mut self, event: BusEvent) {
        match event {
            BusEvent::ErrorActive
            | BusEvent::ErrorWarning
            | BusEvent::Backlog(_)
            | BusEvent::Late => {}
            BusEvent::ErrorPassive => self.counts.passive += 1,
            BusEvent::BusOff => self.counts.off += 1,
            BusEvent::Restarted => self.restarted += 1,
            BusEvent::Dropped(frames) => self.counts.dropped += u64::from(frames),
            BusEvent::Overrun(frames) => self.counts.overrun += u64::from(frames),
        }
    }
}
