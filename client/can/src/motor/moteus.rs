//! moteus as the motor sees it: registers, read and written in sub-frames of CAN FD.
//!
//! Identifier: source 8 bits (highest bit: wants an answer), destination 8 bits; the answer goes back with both exchanged. A sub-frame is
//! one byte of what and how many, the first register, and values for that and the following ones:
//!
//! | byte | what |
//! |---|---|
//! | 00, 04, 08, 0C | write int8, int16, int32, f32; the lower two bits are how many, 0: a byte with it follows |
//! | 10, 14, 18, 1C | read in these types; answered by 20, 24, 28, 2C |
//! | 30, 31 | a write or a read failed: register, error |
//! | 50 | nothing: fills up frames |
//!
//! Registers and counter values have seven bits in a byte and go on while the eighth is set. Whole numbers have a unit each (a position
//! .01, .0001 or .00001 turns in int8, int16, int32), and their lowest value is NaN. Modes: 0 stopped, 1 fault, 10 position, 11 timeout,
//! 12 zero velocity, 15 brake. A timeout holds against turning until it is stopped. Source: mjbots, *moteus reference*.

use core::f64::consts::TAU;

use super::{Body, Firmware};
use crate::drive::Setpoint;
use crate::frame::{Frame, FrameQueue, Id, MAX_DATA};
use crate::protocol::Common;
use crate::settings::Settings;

const STOPPED: u8 = 0;
const FAULT: u8 = 1;
const POSITION: u8 = 10;
const TIMEOUT: u8 = 11;
const ZERO_VELOCITY: u8 = 12;
const BRAKE: u8 = 15;
/// `servo.default_timeout_s`.
const DEFAULT_TIMEOUT_NS: u64 = 100_000_000;
/// Damping of the timeout and of the brake `[N m s/rad]`.
const HOLD: f64 = 0.5;
/// Stiffness and damping at scale 1, `servo.pid_position`, unless the settings say `[N m/turn, N m s/turn]`.
const GAINS: [f64; 2] = [4.0, 0.05];

#[derive(Debug)]
pub(super) struct Moteus {
    id: u8,
    mode: u8,
    stiffness: f64,
    damping: f64,
    command: Command,
}

/// The registers 20 to 27 (hexadecimal), in their own units; NaN where they stand for something else.
#[derive(Clone, Copy, Debug)]
struct Command {
    position: f64,
    velocity: f64,
    torque: f64,
    stiffness_scale: f64,
    damping_scale: f64,
    max_torque: f64,
    timeout: f64,
}

impl Command {
    /// What the registers are at the begin of each frame that sets the mode.
    const NEW: Command = Command {
        position: 0.0,
        velocity: 0.0,
        torque: 0.0,
        stiffness_scale: 1.0,
        damping_scale: 1.0,
        max_torque: f64::NAN,
        timeout: f64::NAN,
    };
}

/// A type of values, and its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Int8,
    Int16,
    Int32,
    Float,
}

/// Units of one count in int8, int16 and int32.
type Units = [f64; 3];
const TURNS: Units = [0.01, 0.0001, 0.00001];
const SPEEDS: Units = [0.1, 0.00025, 0.00001];
const TORQUES: Units = [0.5, 0.01, 0.001];
const SCALES: Units = [1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2_147_483_647.0];
const TEMPERATURES: Units = [1.0, 0.1, 0.001];
const VOLTAGES: Units = [0.5, 0.1, 0.001];
const CURRENTS: Units = [1.0, 0.1, 0.001];
const TIMES: Units = [0.01, 0.001, 0.000001];
const COUNTS: Units = [1.0; 3];

/// The units of a register.
fn units(register: u32) -> Option<Units> {
    Some(match register {
        0x000 | 0x00B | 0x00C | 0x00F | 0x100 | 0x101 | 0x102 | 0x110 | 0x130 | 0x131 | 0x132 => COUNTS,
        0x001 | 0x006 | 0x020 | 0x026 | 0x038 | 0x040 | 0x041 => TURNS,
        0x002 | 0x021 | 0x028 | 0x029 | 0x039 => SPEEDS,
        0x003 | 0x022 | 0x025 | 0x030..=0x034 | 0x03A => TORQUES,
        0x004 | 0x005 => CURRENTS,
        0x023 | 0x024 => SCALES,
        0x027 => TIMES,
        0x00A | 0x00E => TEMPERATURES,
        0x00D => VOLTAGES,
        _ => return None,
    })
}

impl Kind {
    fn of(bits: u8) -> Kind {
        match bits & 3 {
            0 => Kind::Int8,
            1 => Kind::Int16,
            2 => Kind::Int32,
            _ => Kind::Float,
        }
    }

    fn take(self, rest: &mut &[u8], units: Units) -> Option<f64> {
        let [small, middle, large] = units;
        let whole = |number: i64, least: i64, unit: f64| if number == least { f64::NAN } else { number as f64 * unit };
        Some(match self {
            Kind::Int8 => whole(i64::from(i8::from_le_bytes(chunk(rest)?)), i64::from(i8::MIN), small),
            Kind::Int16 => whole(i64::from(i16::from_le_bytes(chunk(rest)?)), i64::from(i16::MIN), middle),
            Kind::Int32 => whole(i64::from(i32::from_le_bytes(chunk(rest)?)), i64::from(i32::MIN), large),
            Kind::Float => f64::from(f32::from_le_bytes(chunk(rest)?)),
        })
    }

    fn put(self, number: f64, units: Units, answer: &mut Answer) {
        let [small, middle, large] = units;
        let whole = |unit: f64, least: i64, most: i64| {
            if number.is_nan() { least } else { ((number / unit).round() as i64).clamp(least + 1, most) }
        };
        match self {
            Kind::Int8 => answer.put(&(whole(small, i64::from(i8::MIN), i64::from(i8::MAX)) as i8).to_le_bytes()),
            Kind::Int16 => answer.put(&(whole(middle, i64::from(i16::MIN), i64::from(i16::MAX)) as i16).to_le_bytes()),
            Kind::Int32 => answer.put(&(whole(large, i64::from(i32::MIN), i64::from(i32::MAX)) as i32).to_le_bytes()),
            Kind::Float => answer.put(&(number as f32).to_le_bytes()),
        }
    }
}

/// Bytes of an answer.
struct Answer {
    bytes: [u8; MAX_DATA],
    used: usize,
}

impl Answer {
    fn put(&mut self, bytes: &[u8]) {
        if let Some(place) = self.bytes.get_mut(self.used..self.used + bytes.len()) {
            place.copy_from_slice(bytes);
            self.used += bytes.len();
        }
    }

    fn put_varuint(&mut self, mut number: u32) {
        while number > 0x7F {
            self.put(&[number as u8 | 0x80]);
            number >>= 7;
        }
        self.put(&[number as u8]);
    }

    /// Filled up to a length that FD has, with sub-frames of nothing.
    fn frame(&mut self, id: Id) -> Option<Frame> {
        let length = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].into_iter().find(|&length| length >= self.used)?;
        let bytes = self.bytes.get_mut(..length)?;
        bytes.iter_mut().skip(self.used).for_each(|byte| *byte = 0x50);
        Frame::fd(id, true, bytes)
    }
}

fn chunk<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = rest.split_first_chunk::<N>()?;
    *rest = tail;
    Some(*head)
}

fn varuint(rest: &mut &[u8]) -> Option<u32> {
    let mut number = 0;
    for shift in [0, 7, 14, 21] {
        let [byte] = chunk(rest)?;
        number |= u32::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

impl Moteus {
    pub(super) fn new(settings: &Settings, _common: Common, body: &mut Body) -> Moteus {
        let [stiffness, damping] = GAINS;
        let known = |key: &str, usual: f64| Some(settings.number(key)).filter(|gain| gain.is_finite()).unwrap_or(usual) / TAU;
        body.watchdog_ns = DEFAULT_TIMEOUT_NS;
        Moteus {
            id: settings.integer("id") as u8,
            mode: STOPPED,
            stiffness: known("kp", stiffness),
            damping: known("kd", damping),
            command: Command::NEW,
        }
    }

    /// All sub-frames of a frame; nothing more after one that makes no sense, as in the firmware.
    fn sub_frames(&mut self, now_ns: u64, mut rest: &[u8], body: &mut Body, answer: &mut Answer) {
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
                        let Some(value) = kind.take(&mut rest, units(register).unwrap_or(COUNTS)) else { return };
                        commanded |= self.write(now_ns, register, value, body, answer);
                    }
                }
                0x10 => {
                    let Some((count, first)) = parse() else { return };
                    self.read(kind, first, count, body, answer);
                }
                _ => return,
            }
        }
        if commanded {
            self.act(now_ns, body);
        }
    }

    /// Writes a register; whether it is part of a command.
    fn write(&mut self, now_ns: u64, register: u32, value: f64, body: &mut Body, answer: &mut Answer) -> bool {
        match register {
            0x000 => {
                self.command = Command::NEW;
                match value as u8 {
                    STOPPED => {
                        self.mode = STOPPED;
                        body.fault = 0;
                        body.stop();
                    }
                    // a fault or a timeout is left by stopping only
                    mode @ (POSITION | ZERO_VELOCITY | BRAKE) if !matches!(self.mode, FAULT | TIMEOUT) => {
                        self.mode = mode;
                        body.start(now_ns);
                    }
                    _ => {}
                }
                return true;
            }
            0x020 => self.command.position = value,
            0x021 => self.command.velocity = value,
            0x022 => self.command.torque = value,
            0x023 => self.command.stiffness_scale = value,
            0x024 => self.command.damping_scale = value,
            0x025 => self.command.max_torque = value,
            0x027 => self.command.timeout = value,
            0x026 | 0x028..=0x02F => {}
            0x130 => {
                // the whole turn nearest to the value stays
                let turn = (body.measured() / TAU - value).round();
                body.zero = body.position - (value + turn) * TAU;
            }
            0x131 => body.zero = body.position - value * TAU,
            _ => {
                answer.put(&[0x30]);
                answer.put_varuint(register);
                answer.put(&[1]);
                return false;
            }
        }
        (0x020..0x030).contains(&register)
    }

    /// Follows the registers of the command.
    fn act(&mut self, now_ns: u64, body: &mut Body) {
        let command = self.command;
        let or = |number: f64, usual: f64| if number.is_nan() { usual } else { number };
        body.watchdog_ns = if command.timeout.is_nan() { DEFAULT_TIMEOUT_NS } else { (command.timeout * 1e9) as u64 };
        body.physics.torque_limit = or(command.max_torque, f64::INFINITY);
        let law = match self.mode {
            POSITION => Setpoint {
                // no position: where it is
                position: or(command.position * TAU, body.measured()),
                velocity: or(command.velocity, 0.0) * TAU,
                torque: or(command.torque, 0.0),
                stiffness: self.stiffness * or(command.stiffness_scale, 1.0).clamp(0.0, 1.0),
                damping: self.damping * or(command.damping_scale, 1.0).clamp(0.0, 1.0),
            },
            ZERO_VELOCITY | BRAKE => Setpoint { damping: HOLD, ..Setpoint::default() },
            _ => return,
        };
        body.follow(now_ns, law);
    }

    fn read(&self, kind: Kind, first: u32, count: u32, body: &Body, answer: &mut Answer) {
        let known = (first..).take(count.min(32) as usize);
        if let Some(unknown) = known.clone().find(|&register| units(register).is_none()) {
            answer.put(&[0x31]);
            answer.put_varuint(unknown);
            answer.put(&[1]);
            return;
        }
        let type_bits = match kind {
            Kind::Int8 => 0x20,
            Kind::Int16 => 0x24,
            Kind::Int32 => 0x28,
            Kind::Float => 0x2C,
        };
        if count < 4 {
            answer.put(&[type_bits | count as u8]);
        } else {
            answer.put(&[type_bits]);
            answer.put_varuint(count);
        }
        answer.put_varuint(first);
        for register in known {
            kind.put(self.value(register, body), units(register).unwrap_or(COUNTS), answer);
        }
    }

    fn value(&self, register: u32, body: &Body) -> f64 {
        match register {
            0x000 => f64::from(if body.fault != 0 { FAULT } else { self.mode }),
            0x001 | 0x006 => body.measured() / TAU,
            0x002 => body.velocity / TAU,
            0x003 => body.torque,
            0x00A | 0x00E => body.temperature,
            0x00D => 24.0,
            0x00F => f64::from(body.fault),
            0x020 => self.command.position,
            0x021 => self.command.velocity,
            0x022 => self.command.torque,
            0x023 => self.command.stiffness_scale,
            0x024 => self.command.damping_scale,
            0x025 => self.command.max_torque,
            0x027 => body.watchdog_ns as f64 * 1e-9,
            0x038 => {
                if body.power {
                    body.law.position / TAU
                } else {
                    f64::NAN
                }
            }
            _ => 0.0,
        }
    }
}

impl Firmware for Moteus {
    fn receive(&mut self, now_ns: u64, frame: &Frame, body: &mut Body, out: &mut FrameQueue) -> bool {
        let [_, _, source, destination] = frame.id.number().to_be_bytes();
        if frame.id.number() >> 16 != 0 || destination & 0x7F != self.id {
            return false;
        }
        if body.fault != 0 {
            self.mode = FAULT;
        }
        let mut answer = Answer { bytes: [0; MAX_DATA], used: 0 };
        self.sub_frames(now_ns, frame.data(), body, &mut answer);
        if source & 0x80 != 0 {
            let id = u32::from(self.id) << 8 | u32::from(source & 0x7F);
            let id = Id::standard(id).or(Id::extended(id));
            out.push_some(id.and_then(|id| answer.frame(id)));
        }
        true
    }

    fn step(&mut self, now_ns: u64, body: &mut Body, _out: &mut FrameQueue) {
        if body.trips(now_ns) {
            self.mode = TIMEOUT;
            body.law = Setpoint { damping: HOLD, ..Setpoint::default() };
        }
    }
}
