//! Statistics of a running CAN bridge.

use crate::actuators::MAX_ACTUATORS;
use crate::counts::{BusCounts, CommandCounts};

/// Most buses of a bridge.
pub const MAX_BUSES: usize = 16;
/// Longest published name of an actuator or a bus `[byte]`; longer ones are cut.
pub const MAX_LABEL: usize = 32;

/// A name on the wire: UTF-8, padded with zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Label(pub [u8; MAX_LABEL]);

impl Label {
    /// A name, cut if it is too long.
    pub fn new(name: &str) -> Label {
        let mut label = Label::default();
        let end = (0..=name.len().min(MAX_LABEL))
            .rev()
            .find(|end| name.is_char_boundary(*end))
            .unwrap_or(0);
        if let (Some(into), Some(from)) = (label.0.get_mut(..end), name.as_bytes().get(..end)) {
            into.copy_from_slice(from);
        }
        label
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap_or(MAX_LABEL);
        self.0.get(..end).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or_default()
    }
}

/// A distribution of times since the start `[ns]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Times {
    /// Number of times.
    pub count: u64,
    /// Half of them were at most this.
    pub p50: u64,
    /// 99 % of them were at most this.
    pub p99: u64,
    /// 99.9 % of them were at most this.
    pub p999: u64,
    /// The longest.
    pub max: u64,
}

/// Counts of one bus since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct BusStatistics {
    /// Name in the configuration.
    pub name: Label,
    /// 0 active, 1 warning, 2 passive, 3 off.
    pub state: u64,
    /// Its worst-case load, as a fraction.
    pub load: f64,
    /// Frames sent.
    pub sent: u64,
    /// Counts of the bus.
    pub counts: BusCounts,
}

/// Counts and times of a bridge since its start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct BridgeStatistics {
    /// Time of publication, by the monotonic clock of this machine `[ns]`.
    pub stamp_ns: u64,
    /// When the bridge started `[ns]`.
    pub started_ns: u64,
    /// Process id of the bridge.
    pub process: u64,
    /// Cycles.
    pub cycles: u64,
    /// Commands, by verdict.
    pub commands: CommandCounts,
    /// From the scheduled time of a cycle to its start.
    pub wake: Times,
    /// From the start of a cycle to its last frame.
    pub work: Times,
    /// Age of the command in a cycle.
    pub age: Times,
    /// From a frame to a motor's answer.
    pub reply: Times,
    /// Number of entries used in `buses`.
    pub n_buses: u64,
    /// Number of entries used in `actuators`.
    pub n_u: u64,
    /// The buses.
    pub buses: [BusStatistics; MAX_BUSES],
    /// Names of the actuators, in the order of u.
    pub actuators: [Label; MAX_ACTUATORS],
}

impl Default for BridgeStatistics {
    fn default() -> BridgeStatistics {
        BridgeStatistics {
            stamp_ns: 0,
            started_ns: 0,
            process: 0,
            cycles: 0,
            commands: CommandCounts::default(),
            wake: Times::default(),
            work: Times::default(),
            age: Times::default(),
            reply: Times::default(),
            n_buses: 0,
            n_u: 0,
            buses: [BusStatistics::default(); MAX_BUSES],
            actuators: [Label::default(); MAX_ACTUATORS],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_cut_between_letters() {
        for name in ["", "elbow", &"x".repeat(40), &format!("{}ä", "x".repeat(31))] {
            let label = Label::new(name);
            assert!(
                name.starts_with(label.as_str())
                    && label.as_str().len() + 1 >= name.len().min(MAX_LABEL),
                "{name}"
            );
        }
    }
}
