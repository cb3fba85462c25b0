//! CyberGear as the motor sees it: everything is in 29-bit identifiers.
//!
//! Identifier: type 5 bits, content 16 bits, the receiver's number 8 bits. The motor's answers have
//! the host's number as receiver and its own in the lower half of the content. Data are
//! little-endian but for type 1 and 2, which are big-endian offset binary.
//!
//! | type | from | content | data |
//! |---|---|---|---|
//! | 0 | host | host | asks who is there; the answer is type 0 to FE with the chip's 64-bit number |
//! | 1 | host | torque ±12 N m | position ±4π rad, velocity ±30 rad/s, kp 0 to 500, kd 0 to 5 (other ranges in the settings) |
//! | 2 | motor | mode 2 bits, faults 6 bits, own number | position, velocity, torque, temperature ×10 °C |
//! | 3 | host | host | power |
//! | 4 | host | host | no power; first byte 1 forgets the fault |
//! | 6 | host | host | first byte 1: zero here |
//! | 7 | host | new number, host | the motor has that number from now on, and answers as to type 0 |
//! | 22 | host | host | 1 to 8: stores its zero (RobStride) |
//! | 17 | host | host | reads a parameter: index 16 bits, zero, then in the answer the value in bytes 4 to 7 |
//! | 18 | host | host | writes one; answered by type 2 |
//!
//! Parameters: 7005 run mode (0 operation, 1 position, 2 speed, 3 current), 7006 current, 700A
//! speed, 700B torque limit, 7016 position, 7017 speed limit, 7019 position, 701B velocity
//! (measured), 7028 and 200C time without commands in 50 µs after which it turns its torque off, 0
//! when new. Source: Xiaomi, *CyberGear user manual*, chapter 4.

use super::mit::code;
use super::{Firmware, Plant, extended};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// Ranges of the manual, for those that the settings leave out: position ±4π rad, velocity
/// `[rad/s]`, torque `[N m]`, stiffness `[N m/rad]`, damping `[N m s/rad]`.
const RANGES: [(&str, f64); 5] = [
    ("position_range", 4.0 * core::f64::consts::PI),
    ("velocity_range", 30.0),
    ("torque_range", 12.0),
    ("stiffness_range", 500.0),
    ("damping_range", 5.0),
];
/// Torque for current `[N m/A]`.
const TORQUE_CONSTANT: f64 = 0.87;
/// Nanoseconds of one count of the watchdog.
const COUNT_NS: u64 = 50_000;
/// Stiffness and damping of its own position and speed loops `[N m/rad, N m s/rad]`.
const OWN_GAINS: [f64; 2] = [30.0, 1.0];

#[derive(Debug)]
pub(super) struct CyberGear {
    id: u8,
    /// Receiver of the answers to set-points: the last sender.
    host: u8,
    /// Position, velocity, torque, stiffness, damping.
    ranges: [f64; 5],
    watchdog_index: u16,
    run_mode: u8,
    torque_limit: f32,
}

impl CyberGear {
    pub(super) fn new(settings: &Settings, _common: Common, plant: &mut Plant) -> CyberGear {
        let ranges = RANGES.map(|(key, usual)| settings.number_or(key, usual));
        let [_, _, torque, ..] = ranges;
        plant.physics.torque_limit = plant.physics.torque_limit.min(torque);
        CyberGear {
            id: settings.integer("id") as u8,
            host: settings.integer("host_id") as u8,
            ranges,
            watchdog_index: settings.integer("watchdog_index") as u16,
            run_mode: 0,
            torque_limit: torque as f32,
        }
    }

    fn is_watchdog(&self, index: u16) -> bool {
        index != 0 && index == self.watchdog_index || matches!(index, 0x7028 | 0x200C)
    }

    /// The answer of type 0.
    fn presence(&self) -> Option<Frame> {
        extended(u32::from(self.id) << 8 | 0xFE, &[self.id, 1, 2, 3, 4, 5, 6, 7])
    }

    /// Type 2.
    fn tell(&self, plant: &Plant, out: &mut FrameQueue) {
        let mode = if plant.power { 2 } else { 0 };
        let id = 2 << 24
            | mode << 22
            | (plant.fault & 0x3F) << 16
            | u32::from(self.id) << 8
            | u32::from(self.host);
        let [position, velocity, torque, ..] = self.ranges;
        let measured = [
            code(plant.measured(), position, 16) as u16,
            code(plant.velocity, velocity, 16) as u16,
            code(plant.torque, torque, 16) as u16,
            (plant.temperature * 10.0) as u16,
        ];
        out.push_some(extended(id, measured.map(u16::to_be_bytes).as_flattened()));
    }

    fn read(&self, index: u16, plant: &Plant, out: &mut FrameQueue) {
        let float = |number: f64| (number as f32).to_le_bytes();
        let value = match index {
            0x7005 => u32::from(self.run_mode).to_le_bytes(),
            0x7006 => float(plant.law.torque / TORQUE_CONSTANT),
            0x700A => float(plant.law.velocity),
            0x700B => self.torque_limit.to_le_bytes(),
            0x7016 => float(plant.law.position),
            0x7019 => float(plant.measured()),
            0x701A => float(plant.torque / TORQUE_CONSTANT),
            0x701B => float(plant.velocity),
            0x701C => float(24.0),
            index if self.is_watchdog(index) => {
                ((plant.watchdog_ns / COUNT_NS) as u32).to_le_bytes()
            }
            _ => return,
        };
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value);
        let id = 17 << 24 | u32::from(self.id) << 8 | u32::from(self.host);
        out.push_some(extended(id, &[low, high, 0, 0, a, b, c, d]));
    }

    fn write(&mut self, index: u16, value: [u8; 4], plant: &mut Plant) {
        let number = f64::from(f32::from_le_bytes(value));
        let [stiffness, damping] = OWN_GAINS;
        match (index, self.run_mode) {
            // the manual: switching the mode needs the motor off
            (0x7005, _) if !plant.power => [self.run_mode, ..] = value,
            (0x7005, _) => {}
            (index, _) if self.is_watchdog(index) => {
                plant.watchdog_ns = u64::from(u32::from_le_bytes(value)) * COUNT_NS;
            }
            (0x700B, _) => {
                self.torque_limit = f32::from_le_bytes(value);
                let [_, _, torque, ..] = self.ranges;
                plant.physics.torque_limit = number.clamp(0.0, torque);
            }
            (0x7006, 3) => {
                let torque = number * TORQUE_CONSTANT;
                plant.follow(Setpoint { torque, ..Setpoint::default() });
            }
            (0x700A, 2) => {
                plant.follow(Setpoint { velocity: number, damping, ..Setpoint::default() });
            }
            (0x7016, 1) => {
                let law = Setpoint { position: number, stiffness, ..Setpoint::default() };
                plant.follow(Setpoint { damping, ..law });
            }
            _ => {}
        }
    }
}

impl Firmware for CyberGear {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        let Id::Extended(id) = frame.id else { return false };
        let [kind, high, host, receiver] = id.to_be_bytes();
        if receiver != self.id {
            return false;
        }
        let Some(bytes) = frame.exactly::<8>() else { return true };
        let [a, b, c, d, e, f, g, h] = bytes;
        let index = u16::from_le_bytes([a, b]);
        if kind != 1 {
            self.host = host;
        }
        match kind {
            1 => {
                // in this type the whole content is the torque, and the host goes without a number
                let [p, v, t, k, s] = self.ranges;
                let torque = value([high, host], t);
                let position = value([a, b], p);
                let velocity = value([c, d], v);
                let stiffness = (value([e, f], k) + k) / 2.0;
                let damping = (value([g, h], s) + s) / 2.0;
                if self.run_mode == 0 {
                    plant.follow(Setpoint { position, velocity, torque, stiffness, damping });
                }
            }
            3 => plant.start(),
            4 => {
                plant.stop();
                if a == 1 {
                    plant.fault = 0;
                }
            }
            6 if a == 1 => {
                plant.zero = plant.position;
                plant.law.position = 0.0;
            }
            // the upper half of the content is the new number, the lower one the host's
            7 => self.id = high,
            18 => self.write(index, [e, f, g, h], plant),
            0 | 6 | 17 | 22 => {}
            _ => return false,
        }
        match kind {
            0 | 7 => out.push_some(self.presence()),
            17 => self.read(index, plant, out),
            _ => self.tell(plant, out),
        }
        true
    }
}

/// A number of 16 bits over ± `range`.
fn value(bytes: [u8; 2], range: f64) -> f64 {
    f64::from(u16::from_be_bytes(bytes)) / 65535.0 * 2.0 * range - range
}
