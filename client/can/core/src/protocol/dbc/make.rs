//! A drive from its settings and its DBC file.

use sarrus_models::Diagnostics;

use super::drive::Dbc;
use super::file;
use super::signals::{Finder, Named, Role, frames};
use crate::drive::{Mode, Power};
use crate::protocol::power_up::PowerUp;
use crate::protocol::{Common, Made, Settings};

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
    let [velocity, torque, temperature, fault, enabled] =
        ["measured_velocity", "measured_torque", "temperature", "fault", "enabled"]
            .map(|key| finder.reported(key));
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
        velocity,
        torque,
        temperature,
        fault,
        enabled,
        enabled_value: settings.number("enabled_value"),
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
