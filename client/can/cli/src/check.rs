//! `sarrus-can check`: the content of a configuration, and all its faults.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use sarrus_can_core::bus_load;
use sarrus_can_core::config::{Configuration, ConfigurationError, MotorConfig};
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::FrameQueue;
use sarrus_models::Report;
use serde_json::{Value, json};

/// Flags of `check`.
#[derive(Args)]
pub(crate) struct Check {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// As text or as one JSON object
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    Text,
    Json,
}

impl Check {
    /// 0 for a valid configuration, warnings allowed; 1 for faults, 2 for a file that cannot be
    /// opened.
    pub(crate) fn run(&self) -> ExitCode {
        match Configuration::load(&self.config) {
            Ok(configuration) => {
                match self.format {
                    Format::Text => {
                        configuration
                            .warnings
                            .iter()
                            .for_each(|warning| eprintln!("warning: {warning}"));
                        print!("{}", text(&configuration));
                    }
                    Format::Json => println!("{}", object(&configuration)),
                }
                ExitCode::SUCCESS
            }
            Err(ConfigurationError::Faults(Report { errors, warnings, .. })) => {
                match self.format {
                    Format::Text => {
                        errors.iter().for_each(|error| eprintln!("{error}"));
                        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
                        eprintln!("{} errors, {} warnings", errors.len(), warnings.len());
                    }
                    Format::Json => {
                        println!("{}", json!({"errors": errors, "warnings": warnings}));
                    }
                }
                ExitCode::from(1)
            }
            Err(error) => crate::failed("check", error),
        }
    }
}

/// The frames of a command of zeros.
fn zero(motor: &MotorConfig) -> Vec<String> {
    let mut frames = FrameQueue::new(16);
    motor.drive.encode(&Setpoint::default(), &mut frames);
    frames.frames().iter().map(ToString::to_string).collect()
}

/// The means that find an encoder that freezes while it holds, besides its own noise.
fn frozen(motor: &MotorConfig) -> &'static str {
    if motor.monitors.frozen == f64::INFINITY {
        "frozen_undetectable"
    } else if motor.drive.counts() {
        "counter"
    } else if motor.dither > 0.0 {
        "dither"
    } else {
        "frozen_undetectable"
    }
}

fn text(configuration: &Configuration) -> String {
    let mut out = String::new();
    let robot = configuration.robot.as_deref().unwrap_or("no model");
    // writing to a string cannot fail
    let _ = writeln!(
        out,
        "{robot}, {} motors on {} buses at {} Hz\n",
        configuration.motors.len(),
        configuration.buses.len(),
        configuration.rate_hz
    );
    let mut rows = Vec::new();
    for (bus, load) in configuration.buses.iter().zip(bus_load::loads(configuration)) {
        let data = bus.data_bitrate.map(|rate| format!(" / {rate}")).unwrap_or_default();
        rows.push(vec![
            bus.name.clone(),
            format!("{} {}", bus.interface, bus.channel),
            format!("{}{data}", bus.bitrate),
            load.frames.to_string(),
            format!("{:.0} µs", load.busy * 1e6),
            format!("{:.0} %", load.fraction * 100.0),
        ]);
    }
    table(&mut out, "bus | channel | bit rate | frames | longest | load", &rows);
    out.push('\n');
    let head = "actuator | bus | protocol | mode | sign | gear | offset | effort | watchdog \
        | frozen encoder | stops together with | command of zeros";
    let mut rows = Vec::new();
    for motor in &configuration.motors {
        let name =
            |actuator: usize| configuration.actuators.get(actuator).cloned().unwrap_or_default();
        let mechanism = configuration.mechanisms.get(motor.actuator);
        let partners = configuration.motors.iter().map(|other| other.actuator);
        let partners = partners.filter(|other| {
            *other != motor.actuator && configuration.mechanisms.get(*other) == mechanism
        });
        let partners = partners.map(name).collect::<Vec<_>>().join(" ");
        let believed = if motor.watchdog_believed { ", believed" } else { "" };
        rows.push(vec![
            name(motor.actuator),
            configuration.buses.get(motor.bus).map(|bus| bus.name.clone()).unwrap_or_default(),
            motor.protocol.name.to_owned(),
            motor.common.mode.name().to_owned(),
            format!("{:+}", motor.mapping.sign),
            motor.mapping.gear.to_string(),
            if motor.is_calibrated { motor.mapping.offset.to_string() } else { "none".to_owned() },
            motor.limits.effort.to_string(),
            format!("{} ms{believed}", motor.common.watchdog_ms),
            frozen(motor).to_owned(),
            if partners.is_empty() { "-".to_owned() } else { partners },
            zero(motor).join(" "),
        ]);
    }
    table(&mut out, head, &rows);
    out
}

/// Columns as wide as their widest entry; bars separate the names in the head.
pub(crate) fn table(out: &mut String, head: &str, rows: &[Vec<String>]) {
    let head: Vec<String> = head.split(" | ").map(str::to_owned).collect();
    let rows = || [&head].into_iter().chain(rows);
    let width = |column: usize| {
        rows().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max()
    };
    let widths: Vec<usize> = (0..head.len()).map(|column| width(column).unwrap_or(0)).collect();
    for row in rows() {
        let line: Vec<String> =
            row.iter().zip(&widths).map(|(entry, width)| format!("{entry:<width$}")).collect();
        let _ = writeln!(out, "{}", line.join("  ").trim_end());
    }
}

fn object(configuration: &Configuration) -> Value {
    let buses: Vec<Value> = configuration
        .buses
        .iter()
        .zip(bus_load::loads(configuration))
        .map(|(bus, load)| {
            json!({"name": bus.name, "interface": bus.interface, "channel": bus.channel,
           "bitrate": bus.bitrate, "data_bitrate": bus.data_bitrate,
               "frames": load.frames, "busy_us": load.busy * 1e6, "load": load.fraction,
               "serial_load": load.serial})
        })
        .collect();
    let motors: Vec<Value> = configuration
        .motors
        .iter()
        .map(|motor| {
            json!({"actuator": configuration.actuators.get(motor.actuator),
               "bus": configuration.buses.get(motor.bus).map(|bus| &bus.name),
               "protocol": motor.protocol.name, "mode": motor.common.mode.name(),
               "sign": motor.mapping.sign, "gear": motor.mapping.gear,
               "offset": motor.is_calibrated.then_some(motor.mapping.offset),
               "torque_constant": motor.mapping.torque_constant,
               "watchdog_ms": motor.common.watchdog_ms, "frozen": frozen(motor),
               "mechanism": configuration.mechanisms.get(motor.actuator), "zero": zero(motor)})
        })
        .collect();
    json!({
        "robot": configuration.robot, "fingerprint": format!("{:016x}", configuration.fingerprint),
        "rate_hz": configuration.rate_hz,
        "actuators": configuration.actuators, "buses": buses, "motors": motors,
        "warnings": configuration.warnings, "errors": [],
    })
}
