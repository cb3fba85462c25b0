//! Any motor whose frames a DBC file describes.
//!
//! The settings say which of the file's signals, written `Message.Signal`, is what: set-points that
//! are sent, and what the motor tells. Every message with a signal that is sent goes out in each
//! cycle, once for each value of its switch that those signals need; its other signals are raw 0
//! unless `constants` says otherwise. Intel and Motorola, signed, scaled and IEEE 754 signals;
//! values saturate. Units: `position_unit` and so on are how many rad, rad/s, N m, N m/rad and N m
//! s/rad are 1 of the file.
//!
//! Torque, gains and the largest torque are rounded towards zero. In the modes position and
//! velocity the motor's own loops make the torque: without the signal `torque_limit` they are
//! refused.
//!
//! The motor has power while `enable` has the value `enable_value`. Without power it is told the
//! position that it measured, and nothing else; the first set-point goes out a cycle before power.
//! In each cycle the frames with `enable` come last when they give power and first when they take
//! it. What the motor reported counts for `stale_ms`: later there is no velocity and torque, and
//! where `fault` or `enabled` have stopped, that is a fault. A DBC file says nothing of a watchdog:
//! it cannot be read.

mod file;
mod make;
mod signals;

use super::number::limited;
use super::power_up::{Action, PowerUp, Stage};
use super::{Key, KeyKind, Protocol, fault};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Power, Receipt, Reply, Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameKind, FrameQueue, Id};
use make::make;
use signals::{Named, Reported, Role, Sent, value};

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
        signal("position", Some(""), "signal of the desired position"),
        signal("velocity", Some(""), "signal of the desired velocity"),
        signal("torque", Some(""), "signal of the desired torque"),
        signal("stiffness", Some(""), "signal of the desired stiffness"),
        signal("damping", Some(""), "signal of the desired damping"),
        signal(
            "torque_limit",
            Some(""),
            "signal of the largest torque, which the modes position and velocity need",
        ),
        signal(
            "constants",
            Some(""),
            "values of other signals that are sent: Message.Signal=1, Message.Other=2",
        ),
        signal("measured_position", None, "signal of the measured position"),
        signal("measured_velocity", Some(""), "signal of the measured velocity"),
        signal("measured_torque", Some(""), "signal of the measured torque"),
        signal("temperature", Some(""), "signal of the temperature [°C]"),
        signal("fault", Some(""), "signal of the motor's fault, 0 without one"),
        signal("enabled", Some(""), "signal that tells whether the motor has power"),
        number("enabled_value", "1", "its value with power"),
        Key {
            name: "stale_ms",
            kind: KeyKind::Integer(1, 60_000),
            default: Some("200"),
            about: "what the motor has not reported again after this time is not believed any \
                more, in ms",
        },
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

/// A temperature counts for this time: it is reported seldom, and changes slowly `[ns]`.
const TEMPERATURE_NS: u64 = 10_000_000_000;

#[derive(Debug)]
struct Dbc {
    torque_limit: f64,
    sent: Vec<Sent>,
    enable: [f64; 2],
    units: [f64; 5],
    position: Reported,
    velocity: Option<Reported>,
    torque: Option<Reported>,
    temperature: Option<Reported>,
    fault: Option<Reported>,
    enabled: Option<Reported>,
    enabled_value: f64,
    stale_ns: u64,
    /// What tells of fault or power has stopped.
    silent: bool,
    /// Position as last measured `[rad]`.
    place: f64,
    code: u32,
    not_finite: bool,
    power: Power,
    power_up: PowerUp,
}

impl Dbc {
    fn send(&self, power: bool, desired: &Setpoint, out: &mut FrameQueue) {
        let Setpoint { position, velocity, torque, stiffness, damping } = *desired;
        let setpoint = [position, velocity, limited(torque, self.torque_limit), stiffness, damping];
        let [off, on] = self.enable;
        let value = |role| match role {
            Role::Enable if power => on,
            Role::Enable => off,
            Role::Setpoint(i) => match (setpoint.get(i), self.units.get(i)) {
                (Some(value), Some(unit)) => value / unit,
                _ => 0.0,
            },
            Role::Constant(value) | Role::Limit(value) => value,
        };
        // no power before its set-point, and no set-point before power is gone
        for has_power in [!power, power] {
            self.sent
                .iter()
                .filter(|sent| sent.has_power() == has_power)
                .for_each(|sent| out.push_some(sent.frame(value)));
        }
    }

    /// What keeps the motor where it is.
    fn neutral(&self) -> Setpoint {
        Setpoint {
            position: if self.place.is_finite() { self.place } else { 0.0 },
            ..Setpoint::default()
        }
    }

    fn reported(&self) -> impl Iterator<Item = &Reported> {
        [&self.velocity, &self.torque, &self.temperature, &self.fault, &self.enabled]
            .into_iter()
            .flatten()
            .chain([&self.position])
    }

    /// What the motor tells of its fault and power.
    fn health(&self) -> impl Iterator<Item = &Reported> {
        [&self.fault, &self.enabled].into_iter().flatten()
    }

    fn is_silent(&self, now_ns: u64) -> bool {
        self.health().any(|reported| reported.is_old(now_ns, self.stale_ns))
    }

    fn powered(&mut self, is_on: bool) {
        self.power_up.report(is_on);
        self.power = if is_on { Power::On } else { Power::Off };
    }
}

impl Drive for Dbc {
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        self.silent = self.is_silent(now_ns);
        let is_ready = self.place.is_finite()
            && self.state().power != Power::Unknown
            && self.state().fault == 0;
        match self.power_up.action(command, is_ready) {
            Action::Idle(_) | Action::Reset | Action::Withhold => {
                self.send(false, &self.neutral(), out);
            }
            Action::Prime(setpoint) => self.send(false, &setpoint, out),
            Action::Ask(setpoint) | Action::Await(setpoint) | Action::Follow(setpoint) => {
                // a motor that said before that it has power does not say so again
                if self.power == Power::On {
                    self.power_up.report(true);
                }
                self.send(true, &setpoint, out);
            }
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        self.send(true, setpoint, out);
    }

    fn disable(&self, out: &mut FrameQueue) {
        self.send(false, &self.neutral(), out);
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let is_reported = self.reported().any(|reported| reported.named.id == frame.id);
        if !is_reported && self.sent.iter().any(|sent| sent.id == frame.id) {
            return Receipt::Foreign;
        }
        let Some(len) = self
            .reported()
            .find(|reported| reported.named.id == frame.id)
            .map(|reported| reported.named.len)
        else {
            return Receipt::NotMine;
        };
        if frame.is_fd() || frame.data().len() != len {
            return Receipt::Malformed;
        }
        let [position_unit, velocity_unit, torque_unit, ..] = self.units;
        let take = |reported: &mut Option<Reported>, unit: f64| {
            reported.as_mut()?.take(now_ns, frame, unit)
        };
        take(&mut self.velocity, velocity_unit);
        take(&mut self.torque, torque_unit);
        take(&mut self.temperature, 1.0);
        if let Some(value) = take(&mut self.fault, 1.0) {
            // any number that is not 0 is a fault, NaN too; larger ones are the drives' own
            self.code =
                if value == 0.0 { 0 } else { (value.abs() as u32).clamp(1, i32::MAX as u32) };
        }
        if let Some(value) = take(&mut self.enabled, 1.0) {
            let is_on = value == self.enabled_value;
            self.powered(is_on);
        }
        self.silent = self.is_silent(now_ns);
        let Some(position) = self.position.take(now_ns, frame, position_unit) else {
            return Receipt::Noted;
        };
        self.not_finite = !position.is_finite();
        if self.not_finite {
            return Receipt::Malformed;
        }
        self.place = position;
        if self.enabled.is_none() {
            self.power = if self.power_up.is_asked() { Power::On } else { Power::Off };
        }
        Receipt::Measured(Measurement {
            position,
            velocity: value(self.velocity.as_ref(), now_ns, self.stale_ns),
            torque: value(self.torque.as_ref(), now_ns, self.stale_ns),
            temperature: value(self.temperature.as_ref(), now_ns, TEMPERATURE_NS),
        })
    }

    fn state(&self) -> DriveState {
        let is_known = !self.silent && self.health().all(Reported::is_known);
        let power = match self.power {
            _ if !is_known => Power::Unknown,
            Power::Off if self.power_up.is_starting() => Power::Starting,
            power => power,
        };
        let fault = match self.code {
            0 if self.not_finite => fault::NOT_FINITE,
            0 if self.power_up.stage() == Stage::Lost => fault::POWER_LOST,
            0 if self.silent => fault::SILENT,
            code => code,
        };
        DriveState { power, fault, watchdog: Watchdog::Unreadable }
    }

    fn forget(&mut self) {
        let Dbc { position, velocity, torque, temperature, fault, enabled, .. } = self;
        [velocity, torque, temperature, fault, enabled]
            .into_iter()
            .flatten()
            .chain([position])
            .for_each(Reported::forget);
        (self.silent, self.place, self.code, self.not_finite) = (false, f64::NAN, 0, false);
        self.power = Power::Unknown;
        self.power_up.forget();
    }

    fn identifiers(&self) -> Vec<Id> {
        let mut ids: Vec<Id> = self
            .sent
            .iter()
            .map(|sent| sent.id)
            .chain(self.reported().map(|reported| reported.named.id))
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    fn steps(&self) -> Setpoint {
        let [position_unit, velocity_unit, torque_unit, ..] = self.units;
        let step = |reported: Option<&Reported>, unit: f64| {
            reported.map_or(0.0, |reported| reported.named.step() * unit.abs())
        };
        Setpoint {
            position: step(Some(&self.position), position_unit),
            velocity: step(self.velocity.as_ref(), velocity_unit),
            torque: step(self.torque.as_ref(), torque_unit),
            ..Setpoint::default()
        }
    }

    fn replies(&self) -> Vec<Reply> {
        let mut replies: Vec<Reply> = Vec::new();
        for reported in self.reported() {
            let Named { id, len, .. } = reported.named;
            if !replies.iter().any(|reply| reply.id == id) {
                replies.push(Reply { id, kind: FrameKind::Classic, len });
            }
        }
        replies
    }

    /// Nothing: what a motor answers to is not in a DBC file.
    fn probe(&mut self, _out: &mut FrameQueue) {}
}
