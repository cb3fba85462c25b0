//! The record of a robot's commissioning: its lines name the robot and every motor with its zero.
//! Power is given only where the configuration says the same.

use core::fmt::Write;

use super::configuration::Configuration;

/// Whether the motors of a robot were commissioned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Commissioning {
    /// There is no robot to compare them with.
    Unneeded,
    /// `commissioning: none`.
    Waived,
    /// A record fits, or is being made.
    Done,
    /// No record fits, and why: nothing may be armed.
    Missing(String),
}

impl Configuration {
    /// The lines of a record that fits this configuration, while it has its motors.
    pub fn record(&self) -> String {
        let robot = self.robot.as_deref().unwrap_or("none");
        let mut text = format!("robot: {robot}\nfingerprint: {:016x}\n", self.fingerprint);
        for motor in &self.motors {
            let bus = self.buses.get(motor.bus).map_or("", |bus| bus.name.as_str());
            let actuator = self.actuators.get(motor.actuator).map_or("", String::as_str);
            let ids = motor.numbers().map(|number| format!("0x{number:X}"));
            let map = &motor.mapping;
            // writing to a string cannot fail
            let _ = writeln!(
                text,
                "- {{actuator: {actuator}, bus: {bus}, protocol: {}, mode: {}, identifiers: [{}], \
                 sign: {}, gear: {}, offset: {}, torque_constant: {}, drive: {}}}",
                motor.protocol.name,
                motor.common.mode.name(),
                ids.collect::<Vec<_>>().join(", "),
                map.sign,
                map.gear,
                map.offset,
                map.torque_constant,
                motor.settings
            );
        }
        text
    }

    /// Whether a record fits; lines that begin with `#` are its measurements.
    pub(super) fn compare_record(&self, record: &str) -> Commissioning {
        let expected = self.record();
        let mut found = record.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
        for line in expected.lines() {
            match found.next() {
                Some(of_record) if of_record == line => {}
                Some(of_record) => {
                    return Commissioning::Missing(format!("it has `{of_record}`, not `{line}`"));
                }
                None => return Commissioning::Missing(format!("it has no `{line}`")),
            }
        }
        match found.next() {
            Some(more) => Commissioning::Missing(format!("it also has `{more}`")),
            None => Commissioning::Done,
        }
    }
}
