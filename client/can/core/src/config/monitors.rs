//! Bounds of the monitors: the group `monitors` of the file, and of a motor where it differs.

use sarrus_models::yaml::{Node, quoted};

use super::keys::MONITORS;
use super::read::Reader;
use crate::settings::Settings;

/// From where the bridge doubts what is measured; infinite where a monitor is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorBounds {
    /// Distance beyond a position limit, as part of the range between the two.
    pub position: f64,
    /// Speed beyond its limit, as part of it.
    pub velocity: f64,
    /// Time far behind the set-point `[s]`.
    pub following: f64,
    /// Difference between reported and asked effort, as part of the effort's limit.
    pub effort: f64,
    /// Change of the effort under one code of the position, as part of the effort's limit.
    pub frozen: f64,
    /// Speed between two measurements, as multiple of the limit of the velocity.
    pub jump: f64,
    /// Age of a measurement `[s]`.
    pub late: f64,
    /// Answers more than asked for.
    pub second_answer: f64,
    /// Whether frames with the bridge's own identifiers are a fault.
    pub second_master: bool,
    /// Temperature from which the effort is reduced `[°C]`.
    pub derate: f64,
    /// Temperature that is a fault `[°C]`.
    pub temperature: f64,
    /// Whether an error-passive bus is a fault.
    pub bus_passive: bool,
}

impl MonitorBounds {
    /// What holds where a file says nothing.
    pub const USUAL: MonitorBounds = MonitorBounds {
        position: 0.01,
        velocity: 0.05,
        following: 0.5,
        effort: 0.25,
        frozen: 0.25,
        jump: 1.2,
        late: 8e-3,
        second_answer: 3.0,
        second_master: true,
        derate: 90.0,
        temperature: 110.0,
        bus_passive: true,
    };

    /// No monitor at all.
    pub const OFF: MonitorBounds = MonitorBounds {
        position: f64::INFINITY,
        velocity: f64::INFINITY,
        following: f64::INFINITY,
        effort: f64::INFINITY,
        frozen: f64::INFINITY,
        jump: f64::INFINITY,
        late: f64::INFINITY,
        second_answer: f64::INFINITY,
        second_master: false,
        derate: f64::INFINITY,
        temperature: f64::INFINITY,
        bus_passive: false,
    };
}

impl Reader<'_, '_> {
    /// The bounds in the group `monitors` of a node; what it leaves out is `usual`.
    pub(super) fn monitors(&mut self, node: &Node, usual: MonitorBounds) -> MonitorBounds {
        let Some(group) = node.get("monitors") else { return usual };
        let Some(read) = self.settings(group, "`monitors`", MONITORS, &[]) else { return usual };
        for key in MONITORS.iter().map(|key| key.name) {
            if read.has(key) && is_off(&read, key) {
                self.diagnostics.warning(
                    read.place(key),
                    format!("the monitor {} is off", quoted(key)),
                    "every monitor on",
                    "remove the line unless another safeguard does this monitor's work",
                );
            }
        }
        let number = |key: &str, usual: f64| if read.has(key) { read.number(key) } else { usual };
        let word = |key: &str, usual: bool| if read.has(key) { !is_off(&read, key) } else { usual };
        let bounds = MonitorBounds {
            position: number("position", usual.position),
            velocity: number("velocity", usual.velocity),
            following: number("following_ms", usual.following * 1e3) * 1e-3,
            effort: number("effort", usual.effort),
            frozen: number("frozen", usual.frozen),
            jump: number("jump", usual.jump),
            late: number("late_ms", usual.late * 1e3) * 1e-3,
            second_answer: number("second_answer", usual.second_answer),
            second_master: word("second_master", usual.second_master),
            derate: number("derate", usual.derate),
            temperature: number("temperature", usual.temperature),
            bus_passive: word("bus_passive", usual.bus_passive),
        };
        if bounds.derate > bounds.temperature && bounds.derate.is_finite() {
            self.diagnostics.error(
                group.span,
                format!("`derate` {} beyond `temperature` {}", bounds.derate, bounds.temperature),
                "a reduction before the fault",
                "make derate smaller",
            );
        }
        bounds
    }
}

fn is_off(read: &Settings, key: &str) -> bool {
    read.number(key) == f64::INFINITY || read.text(key) == "off"
}
