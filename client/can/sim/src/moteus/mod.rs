//! moteus as the motor sees it: registers, read and written in sub-frames of CAN FD.
//!
//! Identifier: source 8 bits (highest bit: wants an answer), destination 8 bits; the answer goes
//! back with both exchanged. A sub-frame is one byte of operation and count, the first register,
//! and values for that and the following ones:
//!
//! | byte | operation |
//! |---|---|
//! | 00, 04, 08, 0C | write int8, int16, int32, f32; the lower two bits are how many, 0: a byte with it follows |
//! | 10, 14, 18, 1C | read in these types; answered by 20, 24, 28, 2C |
//! | 30, 31 | a write or a read failed: register, error |
//! | 50 | nothing: fills up frames |
//!
//! Registers and counter values have seven bits in a byte and go on while the eighth is set. Whole
//! numbers have a unit each (a position .01, .0001 or .00001 turns in int8, int16, int32), and
//! their lowest value is NaN. Modes: 0 stopped, 1 fault, 3 starting, 10 position, 11 timeout, 12
//! zero velocity, 15 brake. A command counts if its frame sets the mode, after the answer. A
//! timeout holds against turning until it is stopped. With a limit of velocity or acceleration,
//! that of the command or the configured one, the position that is followed goes to the commanded
//! one within the limit. Source: mjbots, *moteus reference*; its firmware of 2026
//! (moteus_controller.cc, bldc_servo_control.h).

mod registers;

use core::f64::consts::TAU;

use self::registers::{Answer, COUNTS, Kind, chunk, units, varuint};
use super::{Firmware, Plant};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id, MAX_DATA};
use sarrus_can_core::protocol::{Common, Settings};

const STOPPED: u8 = 0;
const FAULT: u8 = 1;
const STARTING: u8 = 3;
const POSITION: u8 = 10;
const TIMEOUT: u8 = 11;
const ZERO_VELOCITY: u8 = 12;
const BRAKE: u8 = 15;
/// `servo.default_timeout_s`.
const DEFAULT_TIMEOUT: f64 = 0.1;
/// `servo.default_accel_limit` as it is delivered `[turns/s²]`; `servo.default_velocity_limit` is
/// none, and `servo.max_velocity` far away.
const DEFAULT_ACCELERATION: f64 = 50.0;
/// Damping of the timeout and of the brake `[N m s/rad]`.
const HOLD: f64 = 0.5;
/// Stiffness and damping at scale 1, `servo.pid_position`, unless the settings have them
/// `[N m/turn, N m s/turn]`.
const GAINS: [f64; 2] = [4.0, 0.05];

#[derive(Debug)]
pub(super) struct Moteus {
    id: u8,
    mode: u8,
    stiffness: f64,
    damping: f64,
    /// The commanded mode, and the registers of its command as [`NEW`].
    commanded: u8,
    command: [f64; 12],
    /// Its own set-point on the way to the commanded one, where there is a limit `[turns,
    /// turns/s]`.
    way: Option<(f64, f64)>,
    stepped_ns: u64,
}

/// Registers 020 to 02B (hexadecimal) at the start of each frame that sets the mode, in their own
/// units; NaN where they stand for something else: position, velocity, torque, scales of stiffness
/// and damping, largest torque, stop position, timeout, limits of velocity and acceleration,
/// voltage, scale of the integrator's limit.
const NEW: [f64; 12] = {
    const NONE: f64 = f64::NAN;
    [0.0, 0.0, 0.0, 1.0, 1.0, NONE, NONE, 0.0, NONE, NONE, NONE, 1.0]
};

impl Moteus {
    pub(super) fn new(settings: &Settings, _common: Common, plant: &mut Plant) -> Moteus {
        let [stiffness, damping] = GAINS;
        plant.watchdog_ns = (DEFAULT_TIMEOUT * 1e9) as u64;
        Moteus {
            id: settings.integer("id") as u8,
            mode: STOPPED,
            stiffness: settings.number_or("kp", stiffness) / TAU,
            damping: settings.number_or("kd", damping) / TAU,
            commanded: STOPPED,
            command: NEW,
            way: None,
            stepped_ns: 0,
        }
    }

    /// All sub-frames of a frame; nothing more after one that makes no sense, as in the firmware.
    fn sub_frames(&mut self, mut rest: &[u8], plant: &mut Plant, answer: &mut Answer) {
        let mut commanded = false;
        while let Some(what) = chunk::<1>(&mut rest).map(|[what]| what) {
            if what == 0x50 {
                continue;
            }
            let kind = Kind::of(what >> 2);
            let mut parse = || {
                let count = if what & 3 == 0 { varuint(&mut rest)? } else { u32::from(what & 3) };
                Some((count, varuint(&mut rest)?))
            };
            match what & 0xF0 {
                0x00 => {
                    let Some((count, first)) = parse() else { return };
                    for register in (first..).take(count as usize) {
                        let Some(value) = kind.take(&mut rest, units(register).unwrap_or(COUNTS))
                        else {
                            return;
                        };
                        commanded |= self.write(register, value, plant, answer);
                    }
                }
                0x10 => {
                    let Some((count, first)) = parse() else { return };
                    self.read(kind, first, count, plant, answer);
                }
                _ => return,
            }
        }
        if commanded {
            self.act(plant);
        }
    }

    /// Writes a register; whether it makes a command of the frame.
    fn write(&mut self, register: u32, value: f64, plant: &mut Plant, answer: &mut Answer) -> bool {
        if let Some(place) = self.command.get_mut(register.wrapping_sub(0x020) as usize) {
            *place = value;
            return false;
        }
        match register {
            0x000 => {
                (self.commanded, self.command) = (value as u8, NEW);
                return true;
            }
            0x02C..=0x02F => {}
            0x130 => {
                // the whole turn nearest to the value stays
                let turn = (plant.measured() / TAU - value).round();
                plant.zero = plant.position - (value + turn) * TAU;
            }
            0x131 => plant.zero = plant.position - value * TAU,
            _ => {
                answer.put(&[0x30]);
                answer.put_varuint(register);
                answer.put(&[1]);
            }
        }
        false
    }

    /// Takes a whole command.
    fn act(&mut self, plant: &mut Plant) {
        match self.commanded {
            STOPPED => {
                self.mode = STOPPED;
                plant.fault = 0;
                plant.stop();
            }
            // a fault or a timeout is left by stopping only
            mode @ (POSITION | ZERO_VELOCITY | BRAKE) if !matches!(self.mode, FAULT | TIMEOUT) => {
                self.mode = if matches!(self.mode, STOPPED | STARTING) { STARTING } else { mode };
                // 0 is the configured one, NaN is none
                let [.., timeout, _, _, _, _] = self.command;
                let timeout = if timeout == 0.0 { DEFAULT_TIMEOUT } else { timeout };
                plant.watchdog_ns = (timeout * 1e9) as u64;
                let law = self.law(plant);
                plant.follow(law);
            }
            _ => {}
        }
    }

    /// The law of the command.
    fn law(&mut self, plant: &mut Plant) -> Setpoint {
        let [position, velocity, torque, stiffness, damping, most, ..] = self.command;
        let or = |number: f64, usual: f64| if number.is_nan() { usual } else { number };
        plant.physics.torque_limit = or(most, f64::INFINITY);
        if self.commanded != POSITION {
            return Setpoint { damping: HOLD, ..Setpoint::default() };
        }
        // no position: where it is
        let position = or(position, plant.measured() / TAU);
        let (position, velocity) = self.way.unwrap_or((position, or(velocity, 0.0)));
        Setpoint {
            position: position * TAU,
            velocity: velocity * TAU,
            torque: or(torque, 0.0),
            stiffness: self.stiffness * or(stiffness, 1.0).clamp(0.0, 1.0),
            damping: self.damping * or(damping, 1.0).clamp(0.0, 1.0),
        }
    }

    /// Goes on towards the commanded position within the limits, if there are any.
    fn advance(&mut self, elapsed: f64, plant: &Plant) {
        let limit = |number: f64, usual: f64| {
            let number = if number.is_nan() { usual } else { number };
            if number < 0.0 { f64::INFINITY } else { number }
        };
        let [target, .., velocity, acceleration, _, _] = self.command;
        let most = limit(velocity, f64::INFINITY);
        let acceleration = limit(acceleration, DEFAULT_ACCELERATION);
        if most.is_infinite() && acceleration.is_infinite() {
            self.way = None;
            return;
        }
        let (position, velocity) =
            self.way.unwrap_or((plant.measured() / TAU, plant.velocity / TAU));
        let rest = if target.is_nan() { 0.0 } else { target - position };
        let desired = (2.0 * acceleration * rest.abs())
            .sqrt()
            .min(most)
            .min(rest.abs() / elapsed)
            .copysign(rest);
        let change = acceleration * elapsed;
        let velocity = desired.clamp(velocity - change, velocity + change);
        self.way = Some((position + velocity * elapsed, velocity));
    }

    fn read(&self, kind: Kind, first: u32, count: u32, plant: &Plant, answer: &mut Answer) {
        let known = (first..).take(count.min(32) as usize);
        if let Some(unknown) = known.clone().find(|&register| units(register).is_none()) {
            answer.put(&[0x31]);
            answer.put_varuint(unknown);
            answer.put(&[1]);
            return;
        }
        let type_bits = 0x20 | (kind as u8) << 2;
        if count < 4 {
            answer.put(&[type_bits | count as u8]);
        } else {
            answer.put(&[type_bits]);
            answer.put_varuint(count);
        }
        answer.put_varuint(first);
        for register in known {
            kind.put(self.value(register, plant), units(register).unwrap_or(COUNTS), answer);
        }
    }

    fn value(&self, register: u32, plant: &Plant) -> f64 {
        match register {
            0x000 => f64::from(if plant.fault != 0 { FAULT } else { self.mode }),
            0x001 | 0x006 => plant.measured() / TAU,
            0x002 => plant.velocity / TAU,
            0x003 => plant.torque,
            0x00A | 0x00E => plant.temperature,
            0x00D => 24.0,
            0x00F => f64::from(plant.fault),
            0x038 => {
                if plant.power {
                    plant.law.position / TAU
                } else {
                    f64::NAN
                }
            }
            _ => {
                let place = register.wrapping_sub(0x020) as usize;
                self.command.get(place).copied().unwrap_or(0.0)
            }
        }
    }
}

impl Firmware for Moteus {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        let [_, _, source, destination] = frame.id.number().to_be_bytes();
        if frame.id.number() >> 16 != 0 || destination & 0x7F != self.id {
            return false;
        }
        if plant.fault != 0 {
            self.mode = FAULT;
        }
        let mut answer = Answer { bytes: [0; MAX_DATA], used: 0 };
        self.sub_frames(frame.data(), plant, &mut answer);
        if source & 0x80 != 0 {
            let id = u32::from(self.id) << 8 | u32::from(source & 0x7F);
            let id = Id::standard(id).or(Id::extended(id));
            out.push_some(id.and_then(|id| answer.frame(id)));
        }
        true
    }

    fn step(&mut self, plant: &mut Plant, _out: &mut FrameQueue) {
        let elapsed = plant.now_ns.saturating_sub(self.stepped_ns) as f64 * 1e-9;
        self.stepped_ns = plant.now_ns;
        if self.mode == STARTING {
            (self.mode, self.way) = (self.commanded, None);
            plant.start();
        }
        if plant.power && self.mode == POSITION && elapsed > 0.0 {
            self.advance(elapsed, plant);
            plant.law = self.law(plant);
        }
        if plant.trips() {
            self.mode = TIMEOUT;
            plant.law = Setpoint { damping: HOLD, ..Setpoint::default() };
        }
    }
}
