//! Bounds of the monitors: the group `monitors` of the file, and of a motor where it differs.

use sarrus_models::yaml::{Node, quoted};

use super::keys::MONITORS;
use super::reader::Reader;
use super::values::MonitorBounds;
use crate::settings::Settings;

impl Reader<'_, '_> {
    /// The bounds in the group `monitors` of a node; missing ones are `usual`.
    pub(super) fn monitors(&mut self, node: &Node, usual: MonitorBounds) -> MonitorBounds {
        let Some(group) = node.get("monitors") else { return usual };
        let Some(read) = self.settings(group, "`monitors`", MONITORS, &[]) else { return usual };
        for key in MONITORS.iter().map(|key| key.name) {
            if read.has(key) && is_off(&read, key) {
                let found = format!("the monitor {} is off", quoted(key));
                let help = "remove the line unless another safeguard does this monitor's work";
                self.diagnostics.warning(read.place(key), found, "every monitor on", help);
            }
        }
        let number = |key: &str, usual: f64| read.number_or(key, usual);
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
            let MonitorBounds { derate, temperature, .. } = bounds;
            let found = format!("`derate` {derate} beyond `temperature` {temperature}");
            let expected = "a reduction before the fault";
            self.diagnostics.error(group.span, found, expected, "make derate smaller");
        }
        bounds
    }
}

fn is_off(read: &Settings, key: &str) -> bool {
    read.number(key) == f64::INFINITY || read.text(key) == "off"
}
