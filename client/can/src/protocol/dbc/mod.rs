//! Any motor whose frames a DBC file describes.
//!
//! The settings say which of the file's signals, written `Message.Signal`, is what: set-points that are sent, and what the motor tells.
//! Every message with a signal that is sent goes out in each cycle, once for each value of its switch that those signals need; its other
//! signals are raw 0 unless `constants` says otherwise. Intel and Motorola, signed, scaled and IEEE 754 signals; values saturate.
//! Units: `position_unit` and so on are how many rad, rad/s, N m, N m/rad and N m s/rad are 1 of the file.
//!
//! The motor has power while `enable` has the value `enable_value`. A DBC file says nothing of a watchdog: it cannot be read.

mod file;

use super::number::limited;
use super::{Common, Key, KeyKind, Protocol, Settings, fault};
use crate::drive::{Drive, DriveState, Measurement, Mode, Power, Receipt, Reply, Setpoint, Watchdog, Wish};
use crate::frame::{Frame, FrameKind, FrameQueue, Id};
use file::{Message, Multiplexing, Signal};
use sarrus_models::Findings;

/// Any DBC file.
pub(super) const DBC: Protocol = Protocol {
    name: "dbc",
    about: "any motor, by a DBC file and a mapping of its signals",
    modes: &[Mode::Torque, Mode::Impedance, Mode::Position, Mode::Velocity],
    fd: false,
    keys: &[
        Key { name: "file", kind: KeyKind::File, default: None, about: "the DBC file" },
        signal("enable", None, "signal that gives power, Message.Signal"),
        number("enable_value", "1", "its value for power"),
        number("disable_value", "0", "its value without power"),
        signal("position", Some(""), "signal of the wanted position"),
        signal("velocity", Some(""), "signal of the wanted velocity"),
        signal("torque", Some(""), "signal of the wanted torque"),
        signal("stiffness", Some(""), "signal of the wanted stiffness"),
        signal("damping", Some(""), "signal of the wanted damping"),
        signal("constants", Some(""), "values of other signals that are sent: Message.Signal=1, Message.Other=2"),
        signal("measured_position", None, "signal of the measured position"),
        signal("measured_velocity", Some(""), "signal of the measured velocity"),
        signal("measured_torque", Some(""), "signal of the measured torque"),
        signal("temperature", Some(""), "signal of the temperature [°C]"),
        signal("fault", Some(""), "signal of the motor's fault, 0 without one"),
        signal("enabled", Some(""), "signal that tells whether the motor has power"),
        number("enabled_value", "1", "its value with power"),
        number("position_unit", "1", "rad for 1 of the file's positions"),
        number("velocity_unit", "1", "rad/s for 1 of the file's velocities"),
        number("torque_unit", "1", "N m for 1 of the file's torques"),
        number("stiffness_unit", "1", "N m/rad for 1 of the file's stiffnesses"),
        number("damping_unit", "1", "N m s/rad for 1 of the file's dampings"),
    ],
    make,
};

const fn signal(name: &'static str, default: Option<&'static str>, about: &'static str) -> Key {
    Key { name, kind: KeyKind::Text, default, about }
}

const fn number(name: &'static str, default: &'static str, about: &'static str) -> Key {
    Key { name, kind: KeyKind::Number(-1e12, 1e12), default: Some(default), about }
}

/// What a signal that is sent holds.
#[derive(Clone, Copy, Debug)]
enum Role {
    Enable,
    /// Place in position, velocity, torque, stiffness, damping.
    Setpoint(usize),
    Constant(f64),
}

/// A frame that is sent: its message, and the signals in it.
#[derive(Clone, Debug)]
struct Sent {
    id: Id,
    len: usize,
    /// The switch and its value.
    switch: Option<(Signal, u64)>,
    signals: Vec<(Signal, Role)>,
}

/// A signal that the motor sends.
#[derive(Clone, Debug)]
struct Told {
    id: Id,
    len: usize,
    switch: Option<(Signal, u64)>,
    signal: Signal,
}

#[derive(Debug)]
struct Dbc {
    torque_limit: f64,
    sent: Vec<Sent>,
    enable: [f64; 2],
    units: [f64; 5],
    position: Told,
    velocity: Option<Told>,
    torque: Option<Told>,
    temperature: Option<Told>,
    fault: Option<Told>,
    enabled: Option<Told>,
    enabled_value: f64,
    /// Velocity, torque, temperature as last told.
    last: [f64; 3],
    code: u32,
    not_finite: bool,
    power: Power,
    asked: bool,
    lost: bool,
}

const SETPOINTS: [&str; 5] = ["position", "velocity", "torque", "stiffness", "damping"];
const UNITS: [&str; 5] = ["position_unit", "velocity_unit", "torque_unit", "stiffness_unit", "damping_unit"];

/// Finds the signals that settings name.
struct Finder<'a> {
    messages: &'a [Message],
    settings: &'a Settings,
    findings: &'a mut Findings,
    good: bool,
}

impl Finder<'_> {
    /// The signal of a setting: nothing where there is none.
    fn told(&mut self, key: &str) -> Option<Told> {
        if !self.settings.has(key) {
            return None;
        }
        self.named(key, self.settings.text(key).trim())
    }

    fn named(&mut self, key: &str, name: &str) -> Option<Told> {
        let found = name.split_once('.').and_then(|(message, signal)| {
            let message = self.messages.iter().find(|known| known.name == message)?;
            let signal = message.signals.iter().find(|known| known.name == signal)?;
            let switch = message.signals.iter().find(|known| known.multiplexing == Multiplexing::Switch);
            let switch = match signal.multiplexing {
                Multiplexing::While(value) => Some((switch?.clone(), value)),
                Multiplexing::Always | Multiplexing::Switch => None,
            };
            let id = if message.id >> 31 == 1 { Id::Extended(message.id & 0x1FFF_FFFF) } else { Id::Standard(message.id as u16) };
            Some(Told { id, len: message.len, switch, signal: signal.clone() })
        });
        match found {
            Some(told) if told.len <= 8 => Some(told),
            _ => {
                let found = format!("`{key}` names {}, which the DBC file has not", sarrus_models::yaml::quoted(name));
                self.wrong(key, found, "Message.Signal of a message with at most 8 bytes", "correct the name");
                None
            }
        }
    }

    fn wrong(&mut self, key: &str, found: String, expected: &str, help: &str) {
        self.findings.error(self.settings.place(key), found, expected, help);
        self.good = false;
    }
}

fn make(settings: &Settings, common: Common, findings: &mut Findings) -> Option<Box<dyn Drive>> {
    let messages = match file::parse(settings.text("file")) {
        Ok(messages) => messages,
        Err((line, what)) => {
            findings.error(settings.place("file"), format!("line {line} of the DBC file: {what}"), "a DBC file", "mend it there");
            return None;
        }
    };
    let mut finder = Finder { messages: &messages, settings, findings, good: true };
    let mut wanted: Vec<(Told, Role)> = Vec::new();
    wanted.extend(finder.told("enable").map(|told| (told, Role::Enable)));
    for (i, key) in SETPOINTS.iter().enumerate() {
        wanted.extend(finder.told(key).map(|told| (told, Role::Setpoint(i))));
    }
    for constant in settings.text("constants").split(',').filter(|text| !text.trim().is_empty()) {
        match constant.split_once('=').map(|(name, value)| (name.trim(), value.trim().parse::<f64>())) {
            Some((name, Ok(value))) if value.is_finite() => {
                wanted.extend(finder.named("constants", name).map(|told| (told, Role::Constant(value))));
            }
            _ => finder.wrong("constants", format!("`{constant}` is no constant"), "Message.Signal=number", "correct it"),
        }
    }
    let needed: &[usize] = match common.mode {
        Mode::Impedance => &[0, 1, 2, 3, 4],
        Mode::Position => &[0],
        Mode::Velocity => &[1],
        Mode::Torque => &[2],
    };
    for key in needed.iter().filter_map(|i| SETPOINTS.get(*i)) {
        if !settings.has(key) {
            let found = format!("the mode {} has no signal `{key}`", common.mode.name());
            finder.wrong(key, found, "the signal that takes it", "add it, or choose another mode");
        }
    }
    let position = finder.told("measured_position");
    let [velocity, torque, temperature, fault, enabled] =
        ["measured_velocity", "measured_torque", "temperature", "fault", "enabled"].map(|key| finder.told(key));
    let units = UNITS.map(|key| settings.number(key));
    if let Some(key) = UNITS.iter().zip(units).find_map(|(key, unit)| (unit == 0.0).then_some(*key)) {
        finder.wrong(key, format!("`{key}` is 0"), "what 1 of the file is", "correct it");
    }
    if !finder.good {
        return None;
    }
    let mut sent: Vec<Sent> = Vec::new();
    for (told, role) in wanted {
        let value = told.switch.as_ref().map(|(_, value)| *value);
        let place = sent.iter().position(|sent| sent.id == told.id && sent.switch.as_ref().map(|(_, value)| *value) == value);
        match place.and_then(|place| sent.get_mut(place)) {
            Some(sent) => sent.signals.push((told.signal, role)),
            None => sent.push(Sent { id: told.id, len: told.len, switch: told.switch, signals: vec![(told.signal, role)] }),
        }
    }
    Some(Box::new(Dbc {
        torque_limit: common.torque_limit,
        sent,
        enable: [settings.number("disable_value"), settings.number("enable_value")],
        units,
        position: position?,
        velocity,
        torque,
        temperature,
        fault,
        enabled,
        enabled_value: settings.number("enabled_value"),
        last: [f64::NAN; 3],
        code: 0,
        not_finite: false,
        power: Power::Unknown,
        asked: false,
        lost: false,
    }))
}

impl Dbc {
    fn send(&self, power: bool, wanted: &Setpoint, out: &mut FrameQueue) {
        let Setpoint { position, velocity, torque, stiffness, damping } = *wanted;
        let setpoint = [position, velocity, limited(torque, self.torque_limit), stiffness, damping];
        let [off, on] = self.enable;
        for sent in &self.sent {
            let mut bytes = [0; 8];
            sent.switch.iter().for_each(|(switch, value)| switch.set_raw(*value, &mut bytes));
            for (signal, role) in &sent.signals {
                let value = match role {
                    Role::Enable => {
                        if power {
                            on
                        } else {
                            off
                        }
                    }
                    Role::Setpoint(i) => match (setpoint.get(*i), self.units.get(*i)) {
                        (Some(value), Some(unit)) => value / unit,
                        _ => 0.0,
                    },
                    Role::Constant(value) => *value,
                };
                signal.set_value(value, &mut bytes);
            }
            out.push_some(bytes.get(..sent.len).and_then(|bytes| Frame::classic(sent.id, bytes)));
        }
    }

    fn told(&self) -> impl Iterator<Item = &Told> {
        [&self.velocity, &self.torque, &self.temperature, &self.fault, &self.enabled].into_iter().flatten().chain([&self.position])
    }

    fn powered(&mut self, is_on: bool) {
        self.lost |= self.power == Power::On && self.asked && !is_on;
        self.power = if is_on { Power::On } else { Power::Off };
    }
}

impl Told {
    /// The value, if this frame holds it.
    fn read(&self, frame: &Frame) -> Option<f64> {
        let is_there = self.switch.as_ref().is_none_or(|(switch, value)| switch.raw(frame.data()) == *value);
        (frame.id == self.id && is_there).then(|| self.signal.value(frame.data()))
    }
}

/// The value of a signal that may not exist, if this frame holds it.
fn read(told: &Option<Told>, frame: &Frame) -> Option<f64> {
    told.as_ref()?.read(frame)
}

impl Drive for Dbc {
    fn cycle(&mut self, _now_ns: u64, wish: Wish, out: &mut FrameQueue) {
        match wish {
            Wish::On(wanted) if !self.lost && (self.asked || (self.power != Power::Unknown && self.state().fault == 0)) => {
                self.asked = true;
                self.send(true, &wanted, out);
            }
            Wish::On(_) => self.send(false, &Setpoint::default(), out),
            Wish::Off | Wish::Reset => {
                (self.asked, self.lost) = (false, false);
                self.send(false, &Setpoint::default(), out);
            }
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        self.send(true, setpoint, out);
    }

    fn disable(&self, out: &mut FrameQueue) {
        self.send(false, &Setpoint::default(), out);
    }

    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        let Some(len) = self.told().find(|told| told.id == frame.id).map(|told| told.len) else { return Receipt::NotMine };
        if frame.is_fd() || frame.data().len() != len {
            return Receipt::Malformed;
        }
        let [_, velocity_unit, torque_unit, ..] = self.units;
        let [velocity, torque, temperature] = [(&self.velocity, velocity_unit), (&self.torque, torque_unit), (&self.temperature, 1.0)]
            .map(|(told, unit)| read(told, frame).map(|value| value * unit));
        for (slot, value) in self.last.iter_mut().zip([velocity, torque, temperature]) {
            value.filter(|value| value.is_finite()).into_iter().for_each(|value| *slot = value);
        }
        if let Some(value) = read(&self.fault, frame) {
            self.code = if value == 0.0 { 0 } else { (value.abs() as u32).max(1) };
        }
        if let Some(value) = read(&self.enabled, frame) {
            let is_on = value == self.enabled_value;
            self.powered(is_on);
        }
        let Some(position) = self.position.read(frame) else { return Receipt::Noted };
        self.not_finite = !position.is_finite();
        if self.not_finite {
            return Receipt::Malformed;
        }
        if self.enabled.is_none() {
            self.power = if self.asked { Power::On } else { Power::Off };
        }
        let [unit, ..] = self.units;
        let [velocity, torque, temperature] = self.last;
        Receipt::Measured(Measurement { position: position * unit, velocity, torque, temperature })
    }

    fn state(&self) -> DriveState {
        let power = if self.power == Power::Off && self.asked && !self.lost { Power::Starting } else { self.power };
        let fault = match self.code {
            0 if self.not_finite => fault::NOT_FINITE,
            0 if self.lost => fault::POWER_LOST,
            code => code,
        };
        DriveState { power, fault, watchdog: Watchdog::Unreadable }
    }

    fn forget(&mut self) {
        (self.last, self.code, self.not_finite) = ([f64::NAN; 3], 0, false);
        (self.power, self.asked, self.lost) = (Power::Unknown, false, false);
    }

    fn identifiers(&self) -> Vec<Id> {
        let mut ids: Vec<Id> = self.sent.iter().map(|sent| sent.id).chain(self.told().map(|told| told.id)).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    fn replies(&self) -> Vec<Reply> {
        let mut replies: Vec<Reply> = Vec::new();
        for told in self.told() {
            if !replies.iter().any(|reply| reply.id == told.id) {
                replies.push(Reply { id: told.id, kind: FrameKind::Classic, len: told.len });
            }
        }
        replies
    }

    /// Nothing: what a motor answers to is not in a DBC file.
    fn probe(&mut self, _out: &mut FrameQueue) {}
}
