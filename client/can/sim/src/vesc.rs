//! VESC as the motor sees it.
//!
//! Extended identifiers: command << 8 | number; big-endian. It hears 1 (current i32 in mA), 2
//! (brake current), 3 (speed i32 in electrical rpm), 4 (position i32 in 1e-6 °) and 21 (least and
//! largest current, i32 each in mA), and sends by itself, every 2 ms here, 9 (electrical rpm i32,
//! current i16 in .1 A, positive where it takes power, duty i16), 16 (temperatures i16 of bridge
//! and motor in .1 °C, input current i16, position i16 in .02 ° of one turn) and 27 (tachometer i32
//! in sixths of an electrical turn, voltage i16 in .1 V). It has power while it has a command that
//! is not a current of 0. Without one for its timeout its torque is off. Source: B. Vedder, *bldc*,
//! documentation/comm_can.md, comm_can.c, and mcpwm_foc.c for the sign of the current.

use core::f64::consts::TAU;

use super::{Firmware, Plant, extended};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// Time between two sets of status messages `[ns]`.
const STATUS_NS: u64 = 2_000_000;
/// Stiffness and damping of its own loops `[N m/rad, N m s/rad]`.
const OWN_GAINS: [f64; 2] = [20.0, 0.5];
/// Voltage of the supply `[V]`, and resistance of the motor `[Ω]`.
const SUPPLY: f64 = 24.0;
const RESISTANCE: f64 = 0.2;

#[derive(Debug)]
pub(super) struct Vesc {
    id: u32,
    constant: f64,
    pole_pairs: f64,
    status_ns: u64,
}

impl Vesc {
    pub(super) fn new(settings: &Settings, common: Common, plant: &mut Plant) -> Vesc {
        // set with VESC Tool
        plant.watchdog_ns = u64::from(common.watchdog_ms) * 1_000_000;
        Vesc {
            id: settings.integer("id") as u32,
            constant: settings.number("motor_torque_constant"),
            pole_pairs: settings.number("pole_pairs"),
            status_ns: 0,
        }
    }

    fn tell(&self, what: u32, bytes: &[u8], out: &mut FrameQueue) {
        out.push_some(extended(what << 8 | self.id, bytes));
    }
}

impl Firmware for Vesc {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, _out: &mut FrameQueue) -> bool {
        let Id::Extended(id) = frame.id else { return false };
        if id & 0xFF != self.id {
            return false;
        }
        let number = |at: usize| {
            let bytes = frame.data().get(at..).and_then(|rest| rest.first_chunk::<4>());
            f64::from(bytes.map_or(0, |bytes| i32::from_be_bytes(*bytes)))
        };
        let [stiffness, damping] = OWN_GAINS;
        let law = match id >> 8 {
            1 if number(0) == 0.0 => {
                plant.feed();
                plant.stop();
                return true;
            }
            1 => Setpoint { torque: number(0) * 1e-3 * self.constant, ..Setpoint::default() },
            2 => Setpoint { damping, ..Setpoint::default() },
            3 => {
                let velocity = number(0) / self.pole_pairs * TAU / 60.0;
                Setpoint { velocity, damping, ..Setpoint::default() }
            }
            4 => {
                // the shorter way round
                let turn = plant.measured().rem_euclid(TAU);
                let way = (number(0) * 1e-6).to_radians() - turn;
                let way = (way + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
                let position = plant.measured() + way;
                Setpoint { position, stiffness, damping, ..Setpoint::default() }
            }
            21 => {
                plant.physics.torque_limit = number(4) * 1e-3 * self.constant;
                return true;
            }
            _ => return false,
        };
        plant.start();
        plant.follow(law);
        true
    }

    fn step(&mut self, plant: &mut Plant, out: &mut FrameQueue) {
        if plant.trips() {
            plant.stop();
        }
        if plant.now_ns < self.status_ns {
            return;
        }
        self.status_ns = plant.now_ns + STATUS_NS;
        let rpm = plant.velocity * 60.0 / TAU * self.pole_pairs;
        let [a, b, c, d] = (rpm as i32).to_be_bytes();
        // the firmware tells the current that takes power, and the voltage's part of the supply's
        let current = plant.torque / self.constant;
        let volts = RESISTANCE * current + self.constant * plant.velocity;
        let [e, f] = ((current.copysign(current * volts) * 10.0) as i16).to_be_bytes();
        let [g, h] = ((volts / SUPPLY * 1000.0) as i16).to_be_bytes();
        self.tell(9, &[a, b, c, d, e, f, g, h], out);
        let [t, u] = ((plant.temperature * 10.0) as i16).to_be_bytes();
        let place = plant.measured().rem_euclid(TAU).to_degrees();
        let [p, q] = ((place * 50.0) as i16).to_be_bytes();
        self.tell(16, &[t, u, t, u, 0, 0, p, q], out);
        let sixths = plant.measured() / TAU * self.pole_pairs * 6.0;
        let [a, b, c, d] = (sixths as i32).to_be_bytes();
        let [v, w] = ((SUPPLY * 10.0) as i16).to_be_bytes();
        self.tell(27, &[a, b, c, d, v, w, 0, 0], out);
    }
}
