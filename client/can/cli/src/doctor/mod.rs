//! `sarrus-can doctor`: obstacles to running a robot in this computer, its buses and a
//! configuration, one line and remedy each. It changes nothing; with `--motors` it asks the motors,
//! without giving them power.

mod machine;
mod motors;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use rustix::fs::{self, OFlags};
use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::config::{BusConfig, Configuration, MotorConfig};
use sarrus_can_core::drive::Watchdog;
use serde_json::{Value, json};

use crate::check::Format;
use machine::Machine;
use sarrus_can_run::bus::{interface, is_pseudo_terminal};

/// Flags of `doctor`.
#[derive(Args)]
pub(crate) struct Doctor {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// Also ask every motor for an answer and for its firmware; no bridge may run on the buses
    /// meanwhile
    #[arg(long)]
    motors: bool,
    /// As text or as one JSON object
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Something that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Finding {
    /// The checked item.
    check: String,
    /// The fault, the expected state and the remedy.
    text: String,
}

impl Finding {
    fn new(check: impl Into<String>, text: impl Into<String>) -> Finding {
        Finding { check: check.into(), text: text.into() }
    }
}

impl Doctor {
    /// 0 when all is well, 1 for a finding, 2 for a file that cannot be opened.
    pub(crate) fn run(&self) -> Result<ExitCode, ExitCode> {
        let mut configuration = crate::configuration(&self.config)?;
        let warnings = configuration.warnings.iter();
        let mut findings: Vec<Finding> =
            warnings.map(|warning| Finding::new("configuration", warning.to_string())).collect();
        findings.extend(configuration.buses.iter().flat_map(bus));
        let of_motor = |motor: &MotorConfig| believed(motor, name(&configuration, motor.actuator));
        findings.extend(configuration.motors.iter().filter_map(of_motor));
        findings.extend(Machine::here().findings());
        let mut firmware = Vec::new();
        if self.motors {
            let (silent, versions) = motors::ask(&mut configuration);
            findings.extend(silent);
            firmware = versions;
        }
        match self.format {
            Format::Text => {
                for Finding { check, text } in &findings {
                    println!("{check}: {text}");
                }
                for (motor, version) in &firmware {
                    eprintln!("firmware of {motor}: {version}");
                }
                eprintln!("{} finding(s)", findings.len());
            }
            Format::Json => println!("{}", object(&findings, &firmware)),
        }
        Ok(ExitCode::from(u8::from(!findings.is_empty())))
    }
}

fn object(findings: &[Finding], firmware: &[(String, String)]) -> Value {
    let finding = |of: &Finding| json!({"check": of.check, "finding": of.text});
    let version = |(motor, version): &(_, _)| json!({"motor": motor, "firmware": version});
    json!({
        "findings": findings.iter().map(finding).collect::<Value>(),
        "firmware": firmware.iter().map(version).collect::<Value>(),
    })
}

fn name(configuration: &Configuration, actuator: usize) -> &str {
    configuration.actuators.get(actuator).map_or("", String::as_str)
}

/// Findings about a bus: whether the interface exists, its bit rates, state and queue.
fn bus(bus: &BusConfig) -> Vec<Finding> {
    let check = format!("bus {}", bus.name);
    let one = |text: String| vec![Finding::new(&check, text)];
    match bus.interface.as_str() {
        "socketcan" => {}
        "slcan" => return serial_port(&bus.channel).map_or_else(Vec::new, one),
        other => {
            return one(format!(
                "`{other}` is not looked at here, expected socketcan or slcan; \
                 `python -m sarrus.can scan` tries it"
            ));
        }
    }
    let channel = &bus.channel;
    let interface = match interface(channel) {
        Ok(interface) => interface,
        Err(error) => {
            return one(format!(
                "{channel}: {error}, expected an interface; plug the adapter in and see \
                 `ip -details link`"
            ));
        }
    };
    let mut findings = Vec::new();
    match interface.check(channel, Some(bus.bitrate), bus.data_bitrate) {
        Err(error) => findings.extend(one(error.to_string())),
        Ok(Some(BusEvent::ErrorWarning | BusEvent::ErrorPassive)) => findings.extend(one(format!(
            "{channel} counts many errors, expected an error-active controller; look at wires, \
             termination and the bit rate of every node"
        ))),
        Ok(_) => {}
    }
    findings.extend(interface.advice(channel).map(|text| Finding::new(&check, text)));
    findings
}

/// Why a serial port cannot be used. A program that has it open is not disturbed.
fn serial_port(channel: &str) -> Option<String> {
    let path = channel.rsplit_once('@').map_or(channel, |(path, _)| path);
    let has_speed = path != channel;
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    match fs::open(path, flags, fs::Mode::empty()) {
        Err(error) => Some(format!(
            "{path} cannot be opened: {error}, expected a serial port; plug the adapter in, and \
             see that this user may use it (group `dialout`)"
        )),
        // simulated motors' end has no speed
        Ok(_) if !has_speed && !is_pseudo_terminal(path) => Some(format!(
            "{path} has no speed in the configuration, expected `{path}@SPEED`; without it \
             nobody knows whether the port is fast enough for its bus"
        )),
        Ok(_) => None,
    }
}

/// A watchdog that cannot be read is believed: an operator should have seen it work.
fn believed(motor: &MotorConfig, name: &str) -> Option<Finding> {
    let is_unreadable = motor.drive.state().watchdog == Watchdog::Unreadable;
    (is_unreadable && motor.watchdog_believed).then(|| {
        Finding::new(
            format!("watchdog of {name}"),
            format!(
                "{} ms are believed, expected a watchdog that is read back, which {} cannot; see \
                 it work once: unplug the bus while the motor holds something light",
                motor.common.watchdog_ms, motor.protocol.name
            ),
        )
    })
}
