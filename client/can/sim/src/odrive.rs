//! ODrive with CANSimple as the motor sees it.
//!
//! Standard identifier: node 6 bits, command 5 bits; data little-endian; positions in turns,
//! velocities in turns per second, at the motor's shaft.
//!
//! | command | from | data |
//! |---|---|---|
//! | 01 heartbeat, each 100 ms | motor | errors u32, state u8, result u8, done u8 |
//! | 02 emergency stop | host | |
//! | 03 errors | motor | active u32, reason of disarming u32 |
//! | 04, 05 endpoint | both | 0 read or 1 write, endpoint u16, 0, value as long as its type; the answer to a read has 0 first |
//! | 07 state | host | u32: 1 idle, 8 closed loop |
//! | 09 estimates, cyclic | motor | position f32, velocity f32 |
//! | 0B modes | host | control u32 (1 torque, 2 velocity, 3 position), input u32 (1 passed through) |
//! | 0C position | host | f32, velocity i16 × `velocity_scale`, torque i16 × `torque_scale` |
//! | 0D velocity | host | f32, torque f32 |
//! | 0E torque | host | f32 |
//! | 0F limits | host | velocity f32, current f32 in A |
//! | 15 temperatures, 1C torques, cyclic | motor | f32, f32 |
//! | 18 forget errors | host | |
//! | 19 position is now | host | f32 |
//!
//! Without set-points for the time of the endpoint `watchdog_timeout` (f32, s), if
//! `enable_watchdog` is set, it goes to idle with the error 0x01000000. Source: ODrive Robotics,
//! documentation of the firmware 0.6, *CAN protocol* and *watchdog*.

use core::f64::consts::TAU;

use super::{Firmware, Plant, standard};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// Time between two heartbeats `[ns]`.
const HEARTBEAT_NS: u64 = 100_000_000;
/// Time between two cyclic measurements, `encoder_msg_rate_ms` and `torques_msg_rate_ms` `[ns]`.
const FEEDBACK_NS: u64 = 2_000_000;
/// `WATCHDOG_TIMER_EXPIRED`.
const WATCHDOG_EXPIRED: u32 = 0x0100_0000;
const IDLE: u8 = 1;
const CLOSED_LOOP: u8 = 8;
/// Torque at its limit of current as delivered `[N m]`.
const OWN_LIMIT: f64 = 20.0;
/// Gains of its own loops: torque for position `[N m/rad]`, for velocity `[N m s/rad]`.
const OWN_GAINS: [f64; 2] = [40.0, 2.0];

#[derive(Debug)]
pub(super) struct Odrive {
    node: u16,
    control_mode: u32,
    velocity_scale: f64,
    torque_scale: f64,
    torque_constant: f64,
    /// Torque at the limit of current `[N m]`.
    torque_limit: f64,
    physical_limit: f64,
    tells_torque: bool,
    enable_watchdog: bool,
    timeout_s: f32,
    enable_endpoint: i64,
    timeout_endpoint: i64,
    heartbeat_ns: u64,
    feedback_ns: u64,
}

impl Odrive {
    pub(super) fn new(settings: &Settings, _common: Common, plant: &Plant) -> Odrive {
        Odrive {
            node: settings.integer("node") as u16,
            control_mode: 3,
            velocity_scale: settings.number("velocity_scale"),
            torque_scale: settings.number("torque_scale"),
            torque_constant: settings.number_or("motor_torque_constant", 1.0),
            torque_limit: OWN_LIMIT,
            physical_limit: plant.physics.torque_limit,
            tells_torque: settings.flag("torque_feedback"),
            enable_watchdog: false,
            timeout_s: 0.0,
            enable_endpoint: settings.integer("enable_watchdog_endpoint"),
            timeout_endpoint: settings.integer("watchdog_timeout_endpoint"),
            heartbeat_ns: 0,
            feedback_ns: 0,
        }
    }

    fn tell(&self, command: u16, bytes: [[u8; 4]; 2], out: &mut FrameQueue) {
        out.push_some(standard(u32::from(self.node << 5 | command), bytes.as_flattened()));
    }

    fn follow(&self, law: Setpoint, plant: &mut Plant) {
        plant.physics.torque_limit = self.physical_limit.min(self.torque_limit);
        plant.follow(law);
    }

    fn endpoint(
        &mut self,
        write: bool,
        endpoint: u16,
        value: [u8; 4],
        plant: &mut Plant,
        out: &mut FrameQueue,
    ) {
        let [first, ..] = value;
        let content = match i64::from(endpoint) {
            0 => return,
            known if known == self.enable_endpoint => {
                if write {
                    self.enable_watchdog = first != 0;
                }
                [u8::from(self.enable_watchdog), 0, 0, 0]
            }
            known if known == self.timeout_endpoint => {
                if write {
                    self.timeout_s = f32::from_le_bytes(value);
                }
                self.timeout_s.to_le_bytes()
            }
            _ => return,
        };
        plant.watchdog_ns =
            if self.enable_watchdog { (f64::from(self.timeout_s) * 1e9) as u64 } else { 0 };
        if !write {
            let [low, high] = endpoint.to_le_bytes();
            self.tell(0x05, [[0, low, high, 0], content], out);
        }
    }
}

impl Firmware for Odrive {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        let Id::Standard(id) = frame.id else { return false };
        if id >> 5 != self.node {
            return false;
        }
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(frame.data()).for_each(|(byte, given)| *byte = *given);
        let [a, b, c, d, e, f, g, h] = bytes;
        let first = f32::from_le_bytes([a, b, c, d]);
        let second = f32::from_le_bytes([e, f, g, h]);
        let fine = |low, high| f64::from(i16::from_le_bytes([low, high]));
        let [stiffness, damping] = OWN_GAINS;
        match (id & 0x1F, frame.data().len()) {
            (0x02, _) => plant.stop(),
            (0x04, 4..=8) => {
                self.endpoint(a == 1, u16::from_le_bytes([b, c]), [e, f, g, h], plant, out);
            }
            (0x07, 4 | 8) if a == CLOSED_LOOP => plant.start(),
            (0x07, 4 | 8) if a == IDLE => plant.stop(),
            (0x0B, 8) => self.control_mode = u32::from(a),
            (0x0F, 8) => self.torque_limit = f64::from(second) * self.torque_constant,
            (0x18, _) => plant.fault = 0,
            (0x19, 4 | 8) => plant.zero = plant.position - f64::from(first) * TAU,
            (0x0C, 8) if self.control_mode == 3 => {
                let position = f64::from(first) * TAU;
                let velocity = fine(e, f) * self.velocity_scale * TAU;
                let torque = fine(g, h) * self.torque_scale;
                self.follow(Setpoint { position, velocity, torque, stiffness, damping }, plant);
            }
            (0x0D, 8) if self.control_mode == 2 => {
                let velocity = f64::from(first) * TAU;
                let torque = f64::from(second);
                self.follow(Setpoint { velocity, torque, damping, ..Setpoint::default() }, plant);
            }
            (0x0E, 4 | 8) if self.control_mode == 1 => {
                let torque = f64::from(first);
                self.follow(Setpoint { torque, ..Setpoint::default() }, plant);
            }
            // set-points of another mode feed the watchdog and drive nothing
            (0x0C..=0x0E, _) => plant.feed(),
            (0x01 | 0x03 | 0x05 | 0x09 | 0x15 | 0x1C, _) => return false,
            _ => {}
        }
        true
    }

    fn step(&mut self, plant: &mut Plant, out: &mut FrameQueue) {
        if plant.trips() {
            plant.fault = WATCHDOG_EXPIRED;
            plant.stop();
        }
        let float = |number: f64| (number as f32).to_le_bytes();
        if plant.now_ns >= self.heartbeat_ns {
            self.heartbeat_ns = plant.now_ns + HEARTBEAT_NS;
            let state = if plant.power { CLOSED_LOOP } else { IDLE };
            self.tell(0x01, [plant.fault.to_le_bytes(), [state, 0, 1, 0]], out);
            self.tell(0x15, [float(plant.temperature), float(plant.temperature)], out);
        }
        if plant.now_ns >= self.feedback_ns {
            self.feedback_ns = plant.now_ns + FEEDBACK_NS;
            self.tell(0x09, [float(plant.measured() / TAU), float(plant.velocity / TAU)], out);
            if self.tells_torque {
                self.tell(0x1C, [float(plant.law.torque), float(plant.torque)], out);
            }
        }
    }
}
