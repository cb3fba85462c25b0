//! T-Motor AK in servo mode as the motor sees it.
//!
//! Extended identifiers: control mode << 8 | number; big-endian. It hears 1 (current i32 in mA), 2
//! (brake current) and 5 (zero here), and uploads, every 2 ms here, position i16 in .1°, speed i16
//! in 10 electrical rpm, current i16 in .01 A, temperature i8, error u8. It has power while its
//! current is not 0. Without a command for its timeout its torque is off. Source: CubeMars, *AK
//! series actuator driver manual* V1.0.8, chapters 5.1 and 5.2.

use core::f64::consts::TAU;

use super::{Firmware, Plant, extended};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// Time between two uploads `[ns]`.
const UPLOAD_NS: u64 = 2_000_000;

#[derive(Debug)]
pub(super) struct AkServo {
    id: u32,
    upload: u32,
    constant: f64,
    electrical: f64,
    upload_ns: u64,
}

impl AkServo {
    pub(super) fn new(settings: &Settings, common: Common, plant: &mut Plant) -> AkServo {
        // set with the maker's tool
        plant.watchdog_ns = u64::from(common.watchdog_ms) * 1_000_000;
        AkServo {
            id: settings.integer("id") as u32,
            upload: settings.integer("upload") as u32,
            constant: settings.number("motor_torque_constant"),
            electrical: settings.number("pole_pairs") * settings.number("reduction"),
            upload_ns: 0,
        }
    }
}

impl Firmware for AkServo {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, _out: &mut FrameQueue) -> bool {
        let Id::Extended(id) = frame.id else { return false };
        if id & 0xFF != self.id {
            return false;
        }
        let number = frame.data().first_chunk::<4>().map_or(0, |bytes| i32::from_be_bytes(*bytes));
        match id >> 8 {
            1 if number == 0 => {
                plant.feed();
                plant.stop();
            }
            1 => {
                plant.start();
                let torque = f64::from(number) * 1e-3 * self.constant;
                plant.follow(Setpoint { torque, ..Setpoint::default() });
            }
            5 => plant.zero = plant.position,
            _ => return false,
        }
        true
    }

    fn step(&mut self, plant: &mut Plant, out: &mut FrameQueue) {
        if plant.trips() {
            plant.stop();
        }
        if plant.now_ns < self.upload_ns {
            return;
        }
        self.upload_ns = plant.now_ns + UPLOAD_NS;
        let [p, q] = ((plant.measured().to_degrees() * 10.0) as i16).to_be_bytes();
        let rpm = plant.velocity * 60.0 / TAU * self.electrical;
        let [v, w] = ((rpm / 10.0) as i16).to_be_bytes();
        let [i, j] = ((plant.torque / self.constant * 100.0) as i16).to_be_bytes();
        let temperature = plant.temperature as i8 as u8;
        let bytes = [p, q, v, w, i, j, temperature, plant.fault as u8];
        out.push_some(extended(self.upload << 8 | self.id, &bytes));
    }
}
