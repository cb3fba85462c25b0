//! The bridge's half of the protocol.

use sarrus_models::Diagnostics;

use super::file;
use super::signals::{Finder, Named, Reported, Role, Sent, frames, value};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Power, Receipt, Reply, Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::protocol::number::limited;
use crate::protocol::power_up::{Action, PowerUp};
use crate::protocol::{Common, Made, Settings, fault};
use crate::state::state;

/// A temperature is valid for this time: reports are rare, and it changes slowly `[ns]`.
const TEMPERATURE_NS: u64 = 10_000_000_000;

#[derive(Debug)]
struct Dbc {
    torque_limit: f64,
    sent: Vec<Sent>,
    enable: [f64; 2],
    units: [f64; 5],
    position: Reported,
    /// The other signals, in the order of [`REPORTS`].
    reports: [Option<Reported>; 6],
    enabled_value: f64,
    /// The last count, and whether it differs from the one before.
    count: f64,
    counts_on: bool,
    stale_ns: u64,
    /// The signals of fault or power have stopped.
    silent: bool,
    /// Last measured position `[rad]`.
    place: f64,
    code: u32,
    not_finite: bool,
    power: Power,
    power_up: PowerUp,
}

/// Settings of signals that the motor may report besides its position.
const REPORTS: [&str; 6] =
    ["measured_velocity", "measured_torque", "temperature", "fault", "enabled", "counter"];
const SETPOINTS: [&str; 5] = ["position", "velocity", "torque", "stiffness", "damping"];
const UNITS: [&str; 5] =
    ["position_unit", "velocity_unit", "torque_unit", "stiffness_unit", "damping_unit"];

pub(super) fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    let messages = match file::parse(settings.text("file")) {
        Ok(messages) => messages,
        Err((line, what)) => {
            let found = format!("line {line} of the DBC file: {what}");
            return settings.wrong(diagnostics, "file", found, "a DBC file", "fix it there");
        }
    };
    let mut finder = Finder { messages: &messages, settings, diagnostics, good: true };
    let desired = sent_signals(&mut finder, common);
    check_mode(&mut finder, common);
    let position = finder.reported("measured_position");
    let reports = REPORTS.map(|key| finder.reported(key));
    let units = UNITS.map(|key| settings.number(key));
    if let Some(key) = UNITS.iter().zip(units).find_map(|(key, unit)| (unit == 0.0).then_some(*key))
    {
        finder.wrong(key, format!("`{key}` is 0"), "what 1 of the file is", "correct it");
    }
    let sent = frames(desired).unwrap_or_else(|switch| {
        let found = format!(
            "`{switch}` is the switch of its message, and other signals of that \
            message say what it is"
        );
        finder.wrong("constants", found, "a signal that is no switch", "remove it");
        Vec::new()
    });
    if !finder.good {
        return None;
    }
    Some(Box::new(Dbc {
        torque_limit: common.torque_limit,
        sent,
        enable: [settings.number("disable_value"), settings.number("enable_value")],
        units,
        position: position?,
        reports,
        enabled_value: settings.number("enabled_value"),
        count: f64::NAN,
        counts_on: true,
        stale_ns: settings.integer("stale_ms").unsigned_abs() * 1_000_000,
        silent: false,
        place: f64::NAN,
        code: 0,
        not_finite: false,
        power: Power::Unknown,
        power_up: PowerUp::primed(),
    }))
}

/// The signals that the settings name to be sent.
fn sent_signals(finder: &mut Finder<'_>, common: Common) -> Vec<(Named, Role)> {
    let mut desired: Vec<(Named, Role)> = Vec::new();
    desired.extend(finder.of("enable").map(|named| (named, Role::Enable)));
    for (i, key) in SETPOINTS.iter().enumerate() {
        desired.extend(finder.of(key).map(|named| (named, Role::Setpoint(i))));
    }
    if finder.settings.has("torque_limit") && common.torque_limit.is_finite() {
        let limit = common.torque_limit / finder.settings.number("torque_unit").abs();
        desired.extend(finder.of("torque_limit").map(|named| (named, Role::Limit(limit))));
    }
    let constants = finder.settings.text("constants").split(',');
    for constant in constants.filter(|text| !text.trim().is_empty()) {
        let parts = constant.split_once('=');
        match parts.map(|(name, value)| (name.trim(), value.trim().parse::<f64>())) {
            Some((name, Ok(value))) if value.is_finite() => {
                let named = finder.named("constants", name);
                desired.extend(named.map(|named| (named, Role::Constant(value))));
            }
            _ => {
                let found = format!("`{constant}` is no constant");
                finder.wrong("constants", found, "Message.Signal=number", "correct it");
            }
        }
    }
    desired
}

/// Checks that the mode has the signals that it needs.
fn check_mode(finder: &mut Finder<'_>, common: Common) {
    let needed: &[usize] = match common.mode {
        Mode::Impedance => &[0, 1, 2, 3, 4],
        Mode::Position => &[0],
        Mode::Velocity => &[1],
        Mode::Torque => &[2],
    };
    for key in needed.iter().filter_map(|i| SETPOINTS.get(*i)) {
        if !finder.settings.has(key) {
            let found = format!("the mode {} has no signal `{key}`", common.mode.name());
            finder.wrong(key, found, "the signal that takes it", "add it, or choose another mode");
        }
    }
    let needs_limit = common.mode.has_own_loops() && common.torque_limit.is_finite();
    if needs_limit && !finder.settings.has("torque_limit") {
        let found =
            format!("nothing limits the torque of the motor in the mode {}", common.mode.name());
        let help = "add it, or choose the mode torque";
        finder.wrong("torque_limit", found, "the signal `torque_limit`", help);
    }
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

    fn reported(&self) -> impl Iterator<Item = &Reported> {
        self.reports.iter().flatten().chain([&self.position])
    }

    /// The motor's report of its fault and power.
    fn health(&self) -> impl Iterator<Item = &Reported> {
        let [_, _, _, fault, enabled, _] = &self.reports;
        [fault, enabled].into_iter().flatten()
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
                self.send(false, &Setpoint::still(self.place), out);
            }
            Action::Prime(setpoint) => self.send(false, &setpoint, out),
            Action::Ask(setpoint) | Action::Await(setpoint) | Action::Follow(setpoint) => {
                // a motor that reported power before does not report it again
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
        self.send(false, &Setpoint::still(self.place), out);
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let Some(reported) = self.reported().find(|reported| reported.named.id == frame.id) else {
            let is_sent = self.sent.iter().any(|sent| sent.id == frame.id);
            return if is_sent { Receipt::Foreign } else { Receipt::NotMine };
        };
        if frame.is_fd() || frame.data().len() != reported.named.len {
            return Receipt::Malformed;
        }
        let [position_unit, velocity_unit, torque_unit, ..] = self.units;
        let units = [velocity_unit, torque_unit, 1.0, 1.0, 1.0, 1.0];
        let mut taken = [None; 6];
        for ((taken, reported), unit) in taken.iter_mut().zip(&mut self.reports).zip(units) {
            *taken = reported.as_mut().and_then(|reported| reported.take(now_ns, frame, unit));
        }
        let [_, _, _, fault, enabled, counter] = taken;
        if let Some(value) = fault {
            // any number that is not 0 is a fault, NaN too; larger ones are the drives' own
            self.code =
                if value == 0.0 { 0 } else { (value.abs() as u32).clamp(1, i32::MAX as u32) };
        }
        if let Some(value) = enabled {
            let is_on = value == self.enabled_value;
            self.powered(is_on);
        }
        if let Some(count) = counter {
            self.counts_on = count != self.count;
            self.count = count;
        }
        self.silent = self.is_silent(now_ns);
        let Some(position) = self.position.take(now_ns, frame, position_unit) else {
            return Receipt::Noted;
        };
        self.not_finite = !position.is_finite();
        if self.not_finite {
            return Receipt::Malformed;
        }
        if !self.counts_on {
            // the sensor stands still: this is its last measurement again
            return Receipt::Noted;
        }
        self.place = position;
        let [velocity, torque, temperature, _, enabled, _] = &self.reports;
        if enabled.is_none() {
            self.power = if self.power_up.is_asked() { Power::On } else { Power::Off };
        }
        Receipt::Measured(Measurement {
            position,
            velocity: value(velocity.as_ref(), now_ns, self.stale_ns),
            torque: value(torque.as_ref(), now_ns, self.stale_ns),
            temperature: value(temperature.as_ref(), now_ns, TEMPERATURE_NS),
        })
    }

    fn state(&self) -> DriveState {
        let is_known = !self.silent && self.health().all(Reported::is_known);
        let power = if is_known { self.power_up.reported(self.power) } else { Power::Unknown };
        let not_finite = fault::when(self.not_finite, fault::NOT_FINITE);
        let silent = fault::when(self.silent, fault::SILENT);
        let fault = fault::first([self.code, not_finite, self.power_up.fault(), silent]);
        DriveState { power, fault, watchdog: Watchdog::Unreadable }
    }

    fn forget(&mut self) {
        self.reports.iter_mut().flatten().chain([&mut self.position]).for_each(Reported::forget);
        (self.silent, self.place, self.code, self.not_finite) = (false, f64::NAN, 0, false);
        self.power = Power::Unknown;
        self.power_up.forget();
    }

    fn identifiers(&self) -> Vec<Id> {
        let sent = self.sent.iter().map(|sent| sent.id);
        let mut ids: Vec<Id> = sent.chain(self.reported().map(|of| of.named.id)).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    fn steps(&self) -> Setpoint {
        let [position_unit, velocity_unit, torque_unit, ..] = self.units;
        let [velocity, torque, ..] = &self.reports;
        let step = |reported: Option<&Reported>, unit: f64| {
            reported.map_or(0.0, |reported| reported.named.step() * unit.abs())
        };
        let velocity = step(velocity.as_ref(), velocity_unit);
        let torque = step(torque.as_ref(), torque_unit);
        Setpoint::of_motion(step(Some(&self.position), position_unit), velocity, torque)
    }

    fn counts(&self) -> bool {
        matches!(self.reports, [.., Some(_)])
    }

    fn replies(&self) -> Vec<Reply> {
        let mut replies: Vec<Reply> = Vec::new();
        for reported in self.reported() {
            let Named { id, len, .. } = reported.named;
            if !replies.iter().any(|reply| reply.id == id) {
                replies.push(Reply::classic(id, len));
            }
        }
        replies
    }
}

state!(Dbc {
    position, reports, count, counts_on, silent, place, code, not_finite, power, power_up;
    torque_limit, sent, enable, units, enabled_value, stale_ns
});
