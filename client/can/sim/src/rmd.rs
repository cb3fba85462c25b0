//! MyActuator RMD as the motor sees it.
//!
//! It hears 140 + number and answers each command on 240 + number by 8 bytes, the first one the
//! same. Little-endian.
//!
//! | command | content | answer |
//! |---|---|---|
//! | 80, 81 | output off, stop | the same bytes |
//! | 77, 78 | holding brake open, closed | the same bytes |
//! | 92 | | angle i32 at 4 in .01° |
//! | 9A | | temperature i8, 0, brake (1 open), voltage u16 in .1 V, errors u16 |
//! | 9C | | temperature i8, current i16 in .01 A, speed i16 in °/s, angle i16 in ° |
//! | A1 | current i16 at 4 in .01 A | as 9C |
//! | B3 | time u32 at 4 in ms, 0 none | the same bytes |
//!
//! A1 does not open the brake, and with a closed one nothing turns: here the torque is none then.
//! Without commands for the time of B3 the output is cut off and the brake closes; the first A1
//! after that is answered by the same bytes and not followed. Source: MyActuator, *Motor Motion
//! Protocol V4.2*; the behaviour after a timeout is from users' reports.

use super::{Firmware, Plant, standard};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::Settings;

#[derive(Debug)]
pub(super) struct Rmd {
    id: u16,
    /// `[N m/A]`
    constant: f64,
    is_brake_open: bool,
    has_timed_out: bool,
}

impl Rmd {
    pub(super) fn new(settings: &Settings) -> Rmd {
        Rmd {
            id: settings.integer("id") as u16,
            constant: settings.number("motor_torque_constant"),
            is_brake_open: false,
            has_timed_out: false,
        }
    }

    fn state(&self, what: u8, plant: &Plant) -> [u8; 8] {
        let [i, j] = ((plant.torque / self.constant * 100.0) as i16).to_le_bytes();
        let [v, w] = (plant.velocity.to_degrees() as i16).to_le_bytes();
        let [p, q] = (plant.measured().to_degrees() as i16).to_le_bytes();
        [what, plant.temperature as i8 as u8, i, j, v, w, p, q]
    }
}

impl Firmware for Rmd {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        if frame.id != Id::Standard(0x140 + self.id) {
            return false;
        }
        let Some(bytes) = frame.exactly::<8>() else { return true };
        let [what, _, _, _, a, b, c, d] = bytes;
        let was_late = std::mem::take(&mut self.has_timed_out);
        plant.feed();
        let answer = match what {
            0x80 | 0x81 => {
                plant.stop();
                bytes
            }
            0x77 | 0x78 => {
                self.is_brake_open = what == 0x77;
                if !self.is_brake_open {
                    plant.stop();
                }
                bytes
            }
            0x92 => {
                let [e, f, g, h] =
                    ((plant.measured().to_degrees() * 100.0).round() as i32).to_le_bytes();
                [what, 0, 0, 0, e, f, g, h]
            }
            0x9A => {
                let [e, f] =
                    plant.fault.to_le_bytes().first_chunk::<2>().copied().unwrap_or([0; 2]);
                let [u, v] = 240_u16.to_le_bytes();
                [what, plant.temperature as i8 as u8, 0, self.is_brake_open.into(), u, v, e, f]
            }
            0x9C => self.state(what, plant),
            0xA1 if was_late => bytes,
            0xA1 => {
                if plant.fault == 0 && self.is_brake_open {
                    plant.start();
                    let current = f64::from(i16::from_le_bytes([a, b])) * 0.01;
                    let torque = current * self.constant;
                    plant.follow(Setpoint { torque, ..Setpoint::default() });
                }
                self.state(what, plant)
            }
            0xB3 => {
                plant.watchdog_ns = u64::from(u32::from_le_bytes([a, b, c, d])) * 1_000_000;
                bytes
            }
            _ => return true,
        };
        out.push_some(standard(0x240 + u32::from(self.id), &answer));
        true
    }

    fn step(&mut self, plant: &mut Plant, _out: &mut FrameQueue) {
        if plant.trips() {
            (self.is_brake_open, self.has_timed_out) = (false, true);
            plant.stop();
        }
    }
}
