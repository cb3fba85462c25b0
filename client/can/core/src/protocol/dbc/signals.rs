//! The signals that the settings name: sent signals, frame by frame, and the motor's reports with
//! their times.

use super::super::Settings;
use super::file::{Kind, Message, Multiplexing, Signal};
use crate::frame::{Frame, Id};
use crate::state::{State, Words, state};
use sarrus_models::Diagnostics;

/// Content of a signal that is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    Enable,
    /// Span in position, velocity, torque, stiffness, damping.
    Setpoint(usize),
    Constant(f64),
    /// The largest torque, in the file's unit.
    Limit(f64),
}

impl Role {
    /// Numbers that rounding must not enlarge: torque, gains and the limit.
    fn is_toward_zero(self) -> bool {
        matches!(self, Role::Setpoint(2..) | Role::Limit(_))
    }
}

/// A frame that is sent: its message, and the signals in it.
#[derive(Clone, Debug)]
pub(super) struct Sent {
    pub(super) id: Id,
    len: usize,
    /// The switch and its value.
    switch: Option<(Signal, u64)>,
    signals: Vec<(Signal, Role)>,
}

/// A signal of a message, by its name.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub(super) id: Id,
    pub(super) len: usize,
    switch: Option<(Signal, u64)>,
    signal: Signal,
}

/// A signal that the motor sends, as last reported.
#[derive(Clone, Debug)]
pub(super) struct Reported {
    pub(super) named: Named,
    value: f64,
    at_ns: Option<u64>,
}

impl Sent {
    /// Whether it gives and takes power.
    pub(super) fn has_power(&self) -> bool {
        self.signals.iter().any(|(_, role)| *role == Role::Enable)
    }

    /// The frame with these values.
    pub(super) fn frame(&self, value: impl Fn(Role) -> f64) -> Option<Frame> {
        let mut bytes = [0; 8];
        self.switch.iter().for_each(|(switch, value)| switch.set_raw(*value, &mut bytes));
        for (signal, role) in &self.signals {
            match role.is_toward_zero() {
                true => signal.set_toward_zero(value(*role), &mut bytes),
                false => signal.set_value(value(*role), &mut bytes),
            }
        }
        Frame::classic(self.id, bytes.get(..self.len)?)
    }
}

/// The frames that hold all these signals: one for each value of a message's switch that they need.
/// Signals that do not depend on the switch go into each of them. The error is the name of a signal
/// that is a message's switch and cannot have a value of its own.
pub(super) fn frames(desired: Vec<(Named, Role)>) -> Result<Vec<Sent>, String> {
    let switched: Vec<Id> = desired
        .iter()
        .filter(|(named, _)| named.switch.is_some())
        .map(|(named, _)| named.id)
        .collect();
    let is_switched = |named: &Named| switched.contains(&named.id);
    let (everywhere, others): (Vec<_>, Vec<_>) =
        desired.into_iter().partition(|(named, _)| named.switch.is_none() && is_switched(named));
    if let Some((switch, _)) =
        everywhere.iter().find(|(named, _)| named.signal.multiplexing == Multiplexing::Switch)
    {
        return Err(switch.signal.name.clone());
    }
    let mut sent: Vec<Sent> = Vec::new();
    for (named, role) in others {
        let value = |switch: &Option<(Signal, u64)>| switch.as_ref().map(|(_, value)| *value);
        match sent
            .iter_mut()
            .find(|sent| sent.id == named.id && value(&sent.switch) == value(&named.switch))
        {
            Some(sent) => sent.signals.push((named.signal, role)),
            None => sent.push(Sent {
                id: named.id,
                len: named.len,
                switch: named.switch,
                signals: vec![(named.signal, role)],
            }),
        }
    }
    for (named, role) in everywhere {
        for sent in sent.iter_mut().filter(|sent| sent.id == named.id) {
            sent.signals.push((named.signal.clone(), role));
        }
    }
    Ok(sent)
}

impl Named {
    /// Size of one code; 0 for floating-point numbers.
    pub(super) fn step(&self) -> f64 {
        match self.signal.kind {
            Kind::Unsigned | Kind::Signed => self.signal.factor.abs(),
            Kind::Single | Kind::Double => 0.0,
        }
    }
}

impl Reported {
    /// Takes the value times a unit, if this frame holds it. A number that is not finite is none.
    pub(super) fn take(&mut self, now_ns: u64, frame: &Frame, unit: f64) -> Option<f64> {
        let Named { id, switch, signal, .. } = &self.named;
        let is_there =
            switch.as_ref().is_none_or(|(switch, value)| switch.raw(frame.data()) == *value);
        if frame.id != *id || !is_there {
            return None;
        }
        let value = signal.value(frame.data()) * unit;
        self.value = if value.is_finite() { value } else { f64::NAN };
        self.at_ns = Some(now_ns);
        Some(self.value)
    }

    /// Whether it was reported once.
    pub(super) fn is_known(&self) -> bool {
        self.at_ns.is_some()
    }

    /// Whether it was reported, and not for longer than this time any more.
    pub(super) fn is_old(&self, now_ns: u64, most_ns: u64) -> bool {
        self.at_ns.is_some_and(|at_ns| now_ns.saturating_sub(at_ns) > most_ns)
    }

    pub(super) fn forget(&mut self) {
        (self.value, self.at_ns) = (f64::NAN, None);
    }
}

/// The last value of a signal that may not exist; NaN where it is unknown or older than this time.
pub(super) fn value(reported: Option<&Reported>, now_ns: u64, most_ns: u64) -> f64 {
    reported
        .filter(|reported| !reported.is_old(now_ns, most_ns))
        .map_or(f64::NAN, |reported| reported.value)
}

/// Finds the signals that settings name.
pub(super) struct Finder<'a> {
    pub(super) messages: &'a [Message],
    pub(super) settings: &'a Settings,
    pub(super) diagnostics: &'a mut Diagnostics,
    pub(super) good: bool,
}

impl Finder<'_> {
    /// The signal of a setting: nothing where there is none.
    pub(super) fn of(&mut self, key: &str) -> Option<Named> {
        if !self.settings.has(key) {
            return None;
        }
        self.named(key, self.settings.text(key).trim())
    }

    /// A signal of the motor, by its setting.
    pub(super) fn reported(&mut self, key: &str) -> Option<Reported> {
        self.of(key).map(|named| Reported { named, value: f64::NAN, at_ns: None })
    }

    pub(super) fn named(&mut self, key: &str, name: &str) -> Option<Named> {
        let found = name.split_once('.').and_then(|(message, signal)| {
            let message = self.messages.iter().find(|known| known.name == message)?;
            let signal = message.signals.iter().find(|known| known.name == signal)?;
            let switch =
                message.signals.iter().find(|known| known.multiplexing == Multiplexing::Switch);
            let switch = match signal.multiplexing {
                Multiplexing::While(value) => Some((switch?.clone(), value)),
                Multiplexing::Always | Multiplexing::Switch => None,
            };
            let id = if message.id >> 31 == 1 {
                Id::Extended(message.id & 0x1FFF_FFFF)
            } else {
                Id::Standard(message.id as u16)
            };
            Some(Named { id, len: message.len, switch, signal: signal.clone() })
        });
        match found {
            Some(named) if named.len <= 8 => Some(named),
            _ => {
                let name = sarrus_models::yaml::quoted(name);
                let found = format!("`{key}` names {name}, which the DBC file has not");
                let expected = "Message.Signal of a message with at most 8 bytes";
                self.wrong(key, found, expected, "correct the name");
                None
            }
        }
    }

    pub(super) fn wrong(&mut self, key: &str, found: String, expected: &str, help: &str) {
        self.diagnostics.error(self.settings.place(key), found, expected, help);
        self.good = false;
    }
}

state!(Reported { value, at_ns; named });

/// There is one where the settings name a signal.
impl State for Option<Reported> {
    fn carry(&mut self, words: &mut Words<'_>) {
        self.iter_mut().for_each(|reported| reported.carry(words));
    }
}
