//! Encoders, monitor bounds and stops of a configuration.

use crate::frame::Id;

/// An encoder that reports by itself: a signed number, least byte first, in frames of one
/// identifier.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderConfig {
    /// The joint that it measures.
    pub joint: String,
    /// Place of the bus.
    pub bus: usize,
    /// Identifier of its frames.
    pub id: Id,
    /// First byte and count of bytes of the number.
    pub bytes: [usize; 2],
    /// Size of one step `[rad, m]`.
    pub scale: f64,
    /// The joint's position at the number 0 `[rad, m]`.
    pub offset: f64,
    /// Allowed deviation from the motors' encoders `[rad, m]`.
    pub margin: f64,
}

impl EncoderConfig {
    /// The joint's position in a frame; `None` for a frame that is too short `[rad, m]`.
    pub fn position(&self, data: &[u8]) -> Option<f64> {
        let [first, n] = self.bytes;
        let bytes = data.get(first..first + n)?;
        let number = bytes.iter().rev().fold(0_i64, |number, byte| number << 8 | i64::from(*byte));
        let unused = 64 - 8 * n as u32;
        Some((number << unused >> unused) as f64 * self.scale + self.offset)
    }
}

/// Bounds beyond which the bridge doubts measurements; infinite where a monitor is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorBounds {
    /// Distance beyond a position limit, as part of the range between the two.
    pub position: f64,
    /// Speed beyond its limit, as part of it.
    pub velocity: f64,
    /// Time far behind the set-point `[s]`.
    pub following: f64,
    /// Difference between reported and asked effort, as part of the effort's limit.
    pub effort: f64,
    /// Change of the effort under one code of the position, as part of the effort's limit.
    pub frozen: f64,
    /// Speed between two measurements, as multiple of the limit of the velocity.
    pub jump: f64,
    /// Age of a measurement `[s]`.
    pub late: f64,
    /// Answers more than asked for.
    pub second_answer: f64,
    /// Whether frames with the bridge's own identifiers are a fault.
    pub second_master: bool,
    /// Temperature from which the effort is reduced `[°C]`.
    pub derate: f64,
    /// Temperature that is a fault `[°C]`.
    pub temperature: f64,
    /// Whether an error-passive bus is a fault.
    pub bus_passive: bool,
}

impl MonitorBounds {
    /// Defaults.
    pub const USUAL: MonitorBounds = MonitorBounds {
        position: 0.01,
        velocity: 0.05,
        following: 0.5,
        effort: 0.25,
        frozen: 0.25,
        jump: 1.2,
        late: 8e-3,
        second_answer: 3.0,
        second_master: true,
        derate: 90.0,
        temperature: 110.0,
        bus_passive: true,
    };
}

/// How a mechanism is stopped, in the words of IEC 61800-5-2 where it has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopFunction {
    /// SS1: to a standstill within a time, then no torque.
    Ss1,
    /// SS2: to a standstill within a time, and held for another time, then no torque.
    Ss2,
    /// The drives' own quick stop, then no torque.
    QuickStop,
    /// To a standstill within a time, then down with gravity at a capped speed until it stands
    /// still, then no torque.
    Lower,
    /// STO: no torque at once.
    Sto,
}

impl StopFunction {
    /// The names in configurations.
    pub(super) const NAMES: &[&str] = &["ss1", "ss2", "quick_stop", "lower", "sto"];

    pub(super) fn named(name: &str) -> StopFunction {
        use StopFunction::{Lower, QuickStop, Ss1, Ss2, Sto};
        let mut all = Self::NAMES.iter().zip([Ss1, Ss2, QuickStop, Lower, Sto]);
        all.find(|(known, _)| **known == name).map_or(Ss1, |(_, function)| function)
    }
}

/// The stop of one mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MechanismStop {
    /// Its function.
    pub function: StopFunction,
    /// Time to come to a standstill `[ns]`.
    pub stop_ns: u64,
    /// Longest time after that, in which it is held or lowered; 0 for the other functions `[ns]`.
    pub hold_ns: u64,
    /// Greatest speed of an actuator that is lowered `[rad/s, m/s]`.
    pub lower_velocity: f64,
}

impl Default for MechanismStop {
    fn default() -> MechanismStop {
        MechanismStop {
            function: StopFunction::Ss1,
            stop_ns: 500_000_000,
            hold_ns: 0,
            lower_velocity: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_signed_and_begin_with_the_least_byte() {
        let encoder = EncoderConfig {
            joint: String::new(),
            bus: 0,
            id: Id::Standard(1),
            bytes: [1, 3],
            scale: 0.5,
            offset: 10.0,
            margin: 1.0,
        };
        assert_eq!(encoder.position(&[9, 1, 1, 0]), Some(0.5 * 257.0 + 10.0));
        assert_eq!(encoder.position(&[9, 0xFE, 0xFF, 0xFF, 7]), Some(9.0));
        assert_eq!(encoder.position(&[9, 0xFE, 0xFF]), None);
    }
}
