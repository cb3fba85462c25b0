//! A motor that a DBC file describes, as it sees itself.
//!
//! The settings name the signals as they do for its drive. It hears the messages that hold `enable`
//! and the set-points, a multiplexed signal only while its switch has the signal's value, and
//! follows them in its mode, with gains of its own where the mode takes none. Power comes when
//! `enable` changes to `enable_value` and goes when it has another one. Each message with `enable`
//! is answered by all messages that hold something measured, once for each value of a switch; their
//! other signals are raw 0. A DBC file has no watchdog: it counts as set with the maker's tool.
//!
//! Of the file it reads `BO_` (identifier with bit 31 for an extended one, name, length), `SG_`
//! (start, length, order 1 Intel or 0 Motorola, sign, factor, offset) and `SIG_VALTYPE_` (1 single,
//! 2 double). An Intel signal begins with its lowest bit; a Motorola signal with its highest one.
//! Source: Vector, *DBC File Format Documentation* 1.0.5.

use super::{Firmware, Plant};
use sarrus_can_core::drive::{Mode, Setpoint};
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// Stiffness and damping of its own position and speed loops `[N m/rad, N m s/rad]`.
const OWN_GAINS: [f64; 2] = [40.0, 2.0];
/// Set-points and their units, by the names of the settings.
const DESIRED: [(&str, &str); 5] = [
    ("position", "position_unit"),
    ("velocity", "velocity_unit"),
    ("torque", "torque_unit"),
    ("stiffness", "stiffness_unit"),
    ("damping", "damping_unit"),
];
/// Reported signals and their units, in the order of [`Dbc::measures`].
const REPORTED: [(&str, &str); 6] = [
    ("measured_position", "position_unit"),
    ("measured_velocity", "velocity_unit"),
    ("measured_torque", "torque_unit"),
    ("temperature", ""),
    ("fault", ""),
    ("enabled", ""),
];

/// How the bits of a signal are a number.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    Whole,
    Signed,
    Single,
    Double,
}

/// Bits of a payload, and their physical value = number × factor + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bits {
    is_intel: bool,
    /// How far the lowest bit is from the end of the payload, as one number of 64 bits in its byte
    /// order.
    shift: u32,
    length: u32,
    number: Number,
    factor: f64,
    offset: f64,
}

/// A signal of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Signal {
    id: Id,
    len: usize,
    /// The switch, and its value while this signal is there.
    switch: Option<(Bits, u64)>,
    bits: Bits,
    /// SI units for 1 of the file.
    unit: f64,
}

#[derive(Debug)]
pub(super) struct Dbc {
    mode: Mode,
    enable: Signal,
    enable_value: f64,
    is_asked: bool,
    desired: [Option<Signal>; 5],
    setpoint: [f64; 5],
    reported: [Option<Signal>; 6],
    enabled_value: f64,
}

impl Dbc {
    /// `None` where the file lacks a signal of the settings.
    pub(super) fn new(settings: &Settings, common: Common, plant: &mut Plant) -> Option<Dbc> {
        let text = settings.text("file");
        let signal = |(key, unit): (&str, &str)| {
            let unit = if unit.is_empty() { 1.0 } else { settings.number(unit) };
            settings.has(key).then(|| Signal::find(text, settings.text(key).trim(), unit)).flatten()
        };
        // set with the maker's tool, as this motor cannot be asked
        plant.watchdog_ns = u64::from(common.watchdog_ms) * 1_000_000;
        Some(Dbc {
            mode: common.mode,
            enable: signal(("enable", ""))?,
            enable_value: settings.number("enable_value"),
            is_asked: false,
            desired: DESIRED.map(signal),
            setpoint: [0.0; 5],
            reported: REPORTED.map(signal),
            enabled_value: settings.number("enabled_value"),
        })
    }

    fn law(&self) -> Setpoint {
        let [position, velocity, torque, stiffness, damping] = self.setpoint;
        let [stiffness, damping] = match self.mode {
            Mode::Impedance => [stiffness, damping],
            _ => OWN_GAINS,
        };
        match self.mode {
            Mode::Impedance | Mode::Position => {
                Setpoint { position, velocity, torque, stiffness, damping }
            }
            Mode::Velocity => Setpoint { velocity, torque, damping, ..Setpoint::default() },
            Mode::Torque => Setpoint { torque, ..Setpoint::default() },
        }
    }

    /// Present values of [`REPORTED`].
    fn measures(&self, plant: &Plant) -> [f64; 6] {
        let otherwise = if self.enabled_value == 0.0 { 1.0 } else { 0.0 };
        let enabled = if plant.power { self.enabled_value } else { otherwise };
        [
            plant.measured(),
            plant.velocity,
            plant.torque,
            plant.temperature,
            f64::from(plant.fault),
            enabled,
        ]
    }

    fn answer(&self, plant: &Plant, out: &mut FrameQueue) {
        let measures = self.measures(plant);
        for (place, first) in self.reported.iter().enumerate() {
            let Some(first) = first else { continue };
            // one frame for all signals that stand together, sent with the first of them
            if self.reported.iter().take(place).flatten().any(|earlier| earlier.is_beside(first)) {
                continue;
            }
            let mut bytes = [0; 8];
            if let Some((switch, value)) = first.switch {
                switch.put(value, &mut bytes);
            }
            for (signal, value) in self.reported.iter().zip(measures) {
                if let Some(signal) = signal.filter(|signal| signal.is_beside(first)) {
                    signal.bits.put(signal.bits.raw(value / signal.unit), &mut bytes);
                }
            }
            out.push_some(bytes.get(..first.len).and_then(|bytes| Frame::classic(first.id, bytes)));
        }
    }
}

impl Firmware for Dbc {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        let desired = || self.desired.iter().flatten().chain([&self.enable]);
        if !desired().any(|signal| signal.id == frame.id) {
            return false;
        }
        for (slot, signal) in self.setpoint.iter_mut().zip(self.desired) {
            signal
                .and_then(|signal| signal.read(frame))
                .into_iter()
                .for_each(|value| *slot = value);
        }
        let enable = self.enable.read(frame);
        if let Some(value) = enable {
            let is_asked = (value - self.enable_value).abs() < 0.5 * self.enable.bits.factor.abs();
            match (self.is_asked, is_asked) {
                (false, true) => plant.start(),
                (_, false) => plant.stop(),
                _ => {}
            }
            self.is_asked = is_asked;
        }
        plant.follow(self.law());
        if enable.is_some() {
            self.answer(plant, out);
        }
        true
    }
}

impl Signal {
    /// The signal `Message.Signal` of a file.
    fn find(text: &str, name: &str, unit: f64) -> Option<Signal> {
        let (message, name) = name.split_once('.')?;
        let head = |line: &str| {
            let mut words = words(line);
            let (Some("BO_"), Some(id), Some(found), Some(len)) =
                (words.next(), words.next(), words.next(), words.next())
            else {
                return None;
            };
            (found == message).then_some((id.parse::<u32>().ok()?, len.parse::<usize>().ok()?))
        };
        let mut rest = text.lines().skip_while(|line| head(line).is_none());
        let (number, len) = head(rest.next()?)?;
        let described =
            rest.take_while(|line| words(line).next() != Some("BO_")).filter_map(describe);
        let described: Vec<(&str, &str, Bits)> = described.collect();
        let (_, mark, mut bits) = *described.iter().find(|(found, ..)| *found == name)?;
        let switch = match mark.strip_prefix('m') {
            Some(value) => {
                Some((described.iter().find(|(_, mark, _)| *mark == "M")?.2, value.parse().ok()?))
            }
            None => None,
        };
        // SIG_VALTYPE_ identifier signal : kind ;
        let is_float = |line: &&str| {
            words(line).take(3).eq(["SIG_VALTYPE_", number.to_string().as_str(), name])
        };
        match text.lines().find(is_float).and_then(|line| words(line).nth(3)) {
            Some("1") => bits.number = Number::Single,
            Some("2") => bits.number = Number::Double,
            _ => {}
        }
        let id = if number >> 31 == 1 {
            Id::extended(number & 0x1FFF_FFFF)?
        } else {
            Id::standard(number)?
        };
        Some(Signal { id, len, switch, bits, unit })
    }

    /// Whether a frame that holds one signal holds the other.
    fn is_beside(&self, other: &Signal) -> bool {
        (self.id, self.switch) == (other.id, other.switch)
    }

    /// The value in SI units, where a frame holds it.
    fn read(&self, frame: &Frame) -> Option<f64> {
        let is_mine = frame.id == self.id && !frame.is_fd() && frame.data().len() == self.len;
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(frame.data()).for_each(|(place, byte)| *place = *byte);
        let is_there = self.switch.is_none_or(|(switch, value)| switch.get(&bytes) == value);
        (is_mine && is_there).then(|| self.bits.physical(self.bits.get(&bytes)) * self.unit)
    }
}

/// The words of a line, with every mark of punctuation between two of them left out.
fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|letter: char| letter.is_whitespace() || ":;|@(,)".contains(letter))
        .filter(|word| !word.is_empty())
}

/// A line `SG_ name [M or m1] : start|length@order sign (factor,offset) …`: name, mark of the
/// multiplexing or nothing, bits.
fn describe(line: &str) -> Option<(&str, &str, Bits)> {
    let mut words = words(line);
    let (Some("SG_"), Some(name), Some(next)) = (words.next(), words.next(), words.next()) else {
        return None;
    };
    let (mark, start) =
        if next.starts_with(['m', 'M']) { (next, words.next()?) } else { ("", next) };
    let start: u32 = start.parse().ok()?;
    let length: u32 = words.next()?.parse().ok()?;
    let order = words.next()?;
    let factor = words.next()?.parse().ok()?;
    let offset = words.next()?.parse().ok()?;
    let is_intel = order.starts_with('1');
    // of a Motorola signal the start is the highest bit, counted from the lowest one of its byte
    let before = if is_intel { start } else { start / 8 * 8 + 7 - start % 8 };
    let shift = if is_intel { before } else { 64_u32.checked_sub(before + length)? };
    let number = if order.ends_with('-') { Number::Signed } else { Number::Whole };
    let fits = (1..=64).contains(&length) && shift + length <= 64;
    fits.then_some((name, mark, Bits { is_intel, shift, length, number, factor, offset }))
}

impl Bits {
    fn mask(self) -> u64 {
        u64::MAX >> (64 - self.length)
    }

    fn get(self, bytes: &[u8; 8]) -> u64 {
        let payload =
            if self.is_intel { u64::from_le_bytes(*bytes) } else { u64::from_be_bytes(*bytes) };
        payload >> self.shift & self.mask()
    }

    fn put(self, raw: u64, bytes: &mut [u8; 8]) {
        let payload =
            if self.is_intel { u64::from_le_bytes(*bytes) } else { u64::from_be_bytes(*bytes) };
        let payload = payload & !(self.mask() << self.shift) | (raw & self.mask()) << self.shift;
        *bytes = if self.is_intel { payload.to_le_bytes() } else { payload.to_be_bytes() };
    }

    fn physical(self, raw: u64) -> f64 {
        let negative = raw >> (self.length - 1) == 1;
        let number = match self.number {
            Number::Whole => raw as f64,
            Number::Signed if negative => -((self.mask() - raw) as f64) - 1.0,
            Number::Signed => raw as f64,
            Number::Single => f64::from(f32::from_bits(raw as u32)),
            Number::Double => f64::from_bits(raw),
        };
        number * self.factor + self.offset
    }

    /// The nearest number; beyond the ends the end.
    fn raw(self, physical: f64) -> u64 {
        let number = (physical - self.offset) / self.factor;
        let most = self.mask();
        match self.number {
            // casts go to the end
            Number::Whole => (number.round() as u64).min(most),
            Number::Signed => {
                (number.round() as i64).clamp(-((most >> 1) as i64) - 1, (most >> 1) as i64) as u64
            }
            Number::Single => u64::from((number as f32).to_bits()),
            Number::Double => number.to_bits(),
        }
    }
}
