//! MIT mode as motors see it.
//!
//! A command is a standard frame of 8 bytes on the motor's identifier, big-endian: p 16 bits, v 12,
//! kp 12, kd 12, t 12, each offset binary over its range; a motor answers every one, with power or
//! without. FF ×7 and FC power, FD no power, FE zero here; FB (`damiao`, `robstride`) forget the
//! fault. A RobStride looks at the first six bytes and the last: with another seventh byte FC sets
//! its mode, FB asks for the fault word, FA changes its identifier. Measurements are cut to codes,
//! not rounded, and wrap around.
//!
//! | variant | reply | without commands |
//! |---|---|---|
//! | `mini_cheetah` | id, p, v, t, voltage of the supply 0 … 40 V | no torque until the next command |
//! | `t_motor` | id, p, v, t, temperature + 40 °C, error | the same |
//! | `damiao` | state in the high, id in the low half of the first byte, p, v, t, temperatures of bridge and winding | no power, state D |
//! | `robstride` | id, p, v, t, temperature ×10 in 16 bits | no power |
//!
//! A Damiao has registers at 7FF: `id low, id high, 33 (read) or 55 (write), register, four bytes`,
//! little-endian, answered on the reply's identifier. Register 9 is its watchdog in 50 µs, off when
//! new; 15 to 17 (hexadecimal) are its ranges, 0 the voltage at which it turns its torque off, 7
//! and 8 its identifiers (a written one counts at once), AA 01 stores them, A its mode, E its
//! firmware, 14 the reduction of its gear.
//!
//! Sources: B. Katz, firmware of the mini cheetah's motor controller, as of July 2023 (can.c);
//! CubeMars, *AK series manual*; Damiao, *DM-J4310 manual* and its list of registers; RobStride,
//! *RS00 manual*, chapter on the MIT protocol.

use super::{Firmware, Plant, standard};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, MitVariant as Variant, Settings};

/// Identifier of a Damiao's registers.
const REGISTERS: u16 = 0x7FF;
/// Nanoseconds of one count of a Damiao's watchdog.
const COUNT_NS: u64 = 50_000;
/// Voltage that turns the torque of a Damiao off `[V]`, the version of its firmware and the
/// reduction of its gear, of a DM-J4310.
const UNDER_VOLTAGE: f32 = 15.0;
const SOFTWARE: u32 = 5013;
const REDUCTION: f32 = 10.0;
/// Voltage of the supply `[V]`.
const SUPPLY: f64 = 24.0;
/// A Damiao's state after its watchdog.
const COMMUNICATION_LOST: u32 = 0xD;

#[derive(Debug)]
pub(super) struct Mit {
    variant: Variant,
    id: u16,
    reply_id: u32,
    /// Ends of the ranges of position, velocity, torque, stiffness, damping.
    ranges: [f64; 5],
}

impl Mit {
    pub(super) fn new(settings: &Settings, common: Common, plant: &mut Plant) -> Mit {
        let is_named = |of: &Variant| of.name() == settings.text("variant");
        let variant = Variant::ALL.into_iter().find(is_named).unwrap_or(Variant::MiniCheetah);
        if variant != Variant::Damiao {
            // set with the maker's tool, as these motors cannot be asked
            plant.watchdog_ns = u64::from(common.watchdog_ms) * 1_000_000;
        }
        Mit {
            variant,
            id: settings.integer("id") as u16,
            reply_id: settings.integer("reply_id") as u32,
            ranges: ["position", "velocity", "torque", "stiffness", "damping"]
                .map(|what| settings.number(&format!("{what}_range"))),
        }
    }

    fn setpoint(&self, code: u64) -> Setpoint {
        let field = |shift: u32, bits: u32| {
            (code >> shift & ((1 << bits) - 1)) as f64 / ((1u32 << bits) - 1) as f64
        };
        let [position, velocity, torque, stiffness, damping] = self.ranges;
        let around_zero = |part: f64, range: f64| (2.0 * part - 1.0) * range;
        Setpoint {
            position: around_zero(field(48, 16), position),
            velocity: around_zero(field(36, 12), velocity),
            stiffness: field(24, 12) * stiffness,
            damping: field(12, 12) * damping,
            torque: around_zero(field(0, 12), torque),
        }
    }

    /// The special command in a frame: its last byte, and whether the byte before it is FF too.
    fn special(&self, bytes: [u8; 8]) -> Option<(u8, bool)> {
        let [a, b, c, d, e, f, seventh, last] = bytes;
        let full = seventh == 0xFF;
        let known = match self.variant {
            Variant::MiniCheetah | Variant::TMotor => full && (0xFC..=0xFE).contains(&last),
            Variant::Damiao => full && (0xFB..=0xFE).contains(&last),
            Variant::RobStride => (0xFA..=0xFE).contains(&last),
        };
        ([a, b, c, d, e, f] == [0xFF; 6] && known).then_some((last, full))
    }

    fn obey(&mut self, command: (u8, bool), plant: &mut Plant, out: &mut FrameQueue) {
        match command {
            (0xFC, true) => plant.start(),
            (0xFD, true) => plant.stop(),
            (0xFE, true) => {
                plant.zero = plant.position;
                plant.law.position = 0.0;
            }
            (0xFB, true) => plant.fault = 0,
            (0xFB, false) => {
                let [a, b, c, d] = plant.fault.to_le_bytes();
                out.push_some(standard(self.reply_id, &[self.id as u8, a, b, c, d, 0, 0, 0]));
                return;
            }
            (0xFA, _) => self.id = 0xFFFF,
            _ => {}
        }
        self.reply(plant, out);
    }

    fn reply(&self, plant: &Plant, out: &mut FrameQueue) {
        let [position, velocity, torque, ..] = self.ranges;
        let position = code(plant.measured(), position, 16);
        let velocity = code(plant.velocity, velocity, 12);
        let torque = code(plant.torque, torque, 12);
        let [p, q] = (position as u16).to_be_bytes();
        let [v, w, t] =
            [(velocity >> 4) as u8, ((velocity & 0xF) << 4 | torque >> 8) as u8, torque as u8];
        let temperature = plant.temperature;
        let id = self.id as u8;
        let (first, [g, h], len) = match self.variant {
            Variant::MiniCheetah => (id, [(SUPPLY / 40.0 * 255.0) as u8, 0], 7),
            Variant::TMotor => (id, [(temperature + 40.0) as u8, plant.fault as u8], 8),
            Variant::Damiao => {
                let is_on = u8::from(plant.power);
                let state = if plant.fault != 0 { plant.fault as u8 } else { is_on };
                (state << 4 | id & 0xF, [temperature as u8; 2], 8)
            }
            Variant::RobStride => (id, ((temperature * 10.0) as u16).to_be_bytes(), 8),
        };
        let bytes = [first, p, q, v, w, t, g, h];
        out.push_some(bytes.get(..len).and_then(|bytes| standard(self.reply_id, bytes)));
    }

    /// Registers of a Damiao.
    fn register(&mut self, bytes: &[u8], plant: &mut Plant, out: &mut FrameQueue) -> bool {
        let &[low, high, access, register, ref value @ ..] = bytes else { return false };
        if u16::from_le_bytes([low, high]) != self.id {
            return false;
        }
        if access == 0xCC {
            self.reply(plant, out);
            return true;
        }
        let value = value.first_chunk::<4>().copied();
        if let (0x55, 9, Some(value)) = (access, register, value) {
            plant.watchdog_ns = u64::from(u32::from_le_bytes(value)) * COUNT_NS;
        }
        if let (0x55, 8, Some(value)) = (access, register, value) {
            self.id = u32::from_le_bytes(value) as u16;
        }
        if access == 0xAA {
            out.push_some(standard(self.reply_id, &[low, high, access, register, 0, 0, 0, 0]));
            return true;
        }
        let [position, velocity, torque, ..] = self.ranges;
        let content = match register {
            0x00 => UNDER_VOLTAGE.to_le_bytes(),
            0x07 => self.reply_id.to_le_bytes(),
            0x08 => u32::from(self.id).to_le_bytes(),
            0x09 => ((plant.watchdog_ns / COUNT_NS) as u32).to_le_bytes(),
            0x0A => 1u32.to_le_bytes(),
            0x0E => SOFTWARE.to_le_bytes(),
            0x14 => REDUCTION.to_le_bytes(),
            0x15 => (position as f32).to_le_bytes(),
            0x16 => (velocity as f32).to_le_bytes(),
            0x17 => (torque as f32).to_le_bytes(),
            _ => return true,
        };
        if matches!(access, 0x33 | 0x55) {
            let [a, b, c, d] = content;
            out.push_some(standard(self.reply_id, &[low, high, access, register, a, b, c, d]));
        }
        true
    }
}

impl Firmware for Mit {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        if self.variant == Variant::Damiao && frame.id == Id::Standard(REGISTERS) {
            return self.register(frame.data(), plant, out);
        }
        if frame.id != Id::Standard(self.id) {
            return false;
        }
        let Some(bytes) = frame.exactly::<8>() else { return true };
        match self.special(bytes) {
            Some(command) => self.obey(command, plant, out),
            None => {
                plant.follow(self.setpoint(u64::from_be_bytes(bytes)));
                self.reply(plant, out);
            }
        }
        true
    }

    fn step(&mut self, plant: &mut Plant, _out: &mut FrameQueue) {
        if plant.trips() {
            match self.variant {
                Variant::MiniCheetah | Variant::TMotor => plant.law = Setpoint::default(),
                Variant::Damiao => {
                    plant.fault = COMMUNICATION_LOST;
                    plant.stop();
                }
                Variant::RobStride => plant.stop(),
            }
        }
    }
}

/// A number as offset binary over ± `range`, cut, and with its higher bits lost.
pub(super) fn code(number: f64, range: f64, bits: u32) -> u32 {
    let most = ((1u32 << bits) - 1) as f64;
    ((number + range) / (2.0 * range) * most) as i64 as u32 & ((1 << bits) - 1)
}
