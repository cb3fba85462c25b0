//! `sarrus-can replay`: the rules on a recorded input, without buses. The frames go to stdout as `candump -L` writes them.

use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use sarrus_can::bridge::{Bridge, BusEvent};
use sarrus_can::config::{Configuration, ConfigurationError, MAX_ACTUATORS};
use sarrus_can::frame::Frame;
use sarrus_proto::actuators::{ActuatorCommand, Operation};
use serde_json::Value;

/// Flags of `replay`.
#[derive(Args)]
pub(crate) struct Replay {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// JSON lines `{"t": NS, "frame": "123#00", "bus": NAME}`, or with `"command": {…}`, `"operate": "arm"`, `"event": "bus_off"`,
    /// `"cycle": true`
    log: PathBuf,
}

impl Replay {
    /// 0; 1 for a faulty configuration or line, 2 for what cannot be opened.
    pub(crate) fn run(&self) -> ExitCode {
        let configuration = match Configuration::load(&self.config) {
            Ok(configuration) => configuration,
            Err(error) => {
                eprintln!("{error}");
                return ExitCode::from(if matches!(error, ConfigurationError::Open { .. }) { 2 } else { 1 });
            }
        };
        let log = match std::fs::File::open(&self.log) {
            Ok(log) => log,
            Err(error) => {
                eprintln!("sarrus-can replay: cannot open {}: {error}; give the path of a readable file", self.log.display());
                return ExitCode::from(2);
            }
        };
        let mut out = BufWriter::new(io::stdout().lock());
        let mut bridge = Bridge::new(configuration);
        for (number, line) in BufReader::new(log).lines().enumerate() {
            let fault = match line {
                Ok(line) if line.trim().is_empty() => None,
                Ok(line) => step(&mut bridge, &line, &mut out).err(),
                Err(error) => Some(error.to_string()),
            };
            if let Some(fault) = fault {
                let _ = out.flush();
                eprintln!("{}:{}:1: {fault}", self.log.display(), number + 1);
                return ExitCode::from(1);
            }
        }
        // a reader that has gone away wants no more
        let _ = out.flush();
        ExitCode::SUCCESS
    }
}

/// Does what one line says.
fn step(bridge: &mut Bridge, line: &str, out: &mut impl Write) -> Result<(), String> {
    let line: Value = serde_json::from_str(line).map_err(|error| format!("this is not JSON: {error}"))?;
    let now_ns = line.get("t").and_then(Value::as_u64).ok_or("the line has no time, expected `\"t\": NANOSECONDS`")?;
    let bus = || {
        let name = line.get("bus").and_then(Value::as_str).ok_or("the line has no bus, expected `\"bus\": NAME`")?;
        bridge.configuration().bus(name).ok_or(format!("there is no bus `{name}` in the configuration"))
    };
    if let Some(text) = line.get("frame") {
        let frame = text.as_str().and_then(Frame::from_text).ok_or("the frame cannot be read, expected ID#DATA as candump writes it")?;
        let bus = bus()?;
        bridge.receive(now_ns, bus, &frame);
    } else if let Some(name) = line.get("event") {
        let count = line.get("count").and_then(Value::as_u64).unwrap_or(1) as u32;
        let event = name.as_str().and_then(|name| BusEvent::named(name, count)).ok_or("there is no such event")?;
        let bus = bus()?;
        bridge.bus_event(now_ns, bus, event);
    } else if let Some(name) = line.get("operate") {
        let operation = Operation::ALL.iter().find(|operation| Some(operation.name()) == name.as_str());
        bridge.operate(now_ns, *operation.ok_or("there is no such operation, expected arm, disarm or reset")?);
    } else if let Some(fields) = line.get("command") {
        bridge.command(now_ns, &command(fields, bridge.configuration())?);
    } else if line.get("cycle").is_some() {
        bridge.cycle(now_ns);
        print(bridge, now_ns, out).map_err(|error| error.to_string())?;
    } else {
        return Err("the line says nothing, expected frame, event, operate, command or cycle".to_owned());
    }
    Ok(())
}

/// A command; what is not given is zero, `null` is NaN, as JSON has no word for it.
fn command(fields: &Value, configuration: &Configuration) -> Result<ActuatorCommand, String> {
    let whole =
        |key: &str, otherwise: u64| fields.get(key).map_or(Some(otherwise), Value::as_u64).ok_or(format!("`{key}` is no whole number"));
    let numbers = |key: &str| {
        let mut numbers = [0.0; MAX_ACTUATORS];
        let Some(given) = fields.get(key) else { return Ok(numbers) };
        let given = given.as_array().filter(|given| given.len() <= MAX_ACTUATORS).ok_or(format!("`{key}` is no list of numbers"))?;
        for (into, number) in numbers.iter_mut().zip(given) {
            *into = if number.is_null() { f64::NAN } else { number.as_f64().ok_or(format!("`{key}` holds {number}, expected numbers"))? };
        }
        Ok::<_, String>(numbers)
    };
    Ok(ActuatorCommand {
        sequence: whole("sequence", 0)?,
        stamp_ns: whole("stamp_ns", 0)?,
        fingerprint: whole("fingerprint", configuration.fingerprint)?,
        n_u: whole("n_u", configuration.actuators.len() as u64)?,
        position: numbers("position")?,
        velocity: numbers("velocity")?,
        effort: numbers("effort")?,
        stiffness: numbers("stiffness")?,
        damping: numbers("damping")?,
    })
}

fn print(bridge: &Bridge, now_ns: u64, out: &mut impl Write) -> io::Result<()> {
    let (seconds, micros) = (now_ns / 1_000_000_000, now_ns % 1_000_000_000 / 1000);
    for (bus, config) in bridge.configuration().buses.iter().enumerate() {
        for frame in bridge.frames(bus) {
            writeln!(out, "({seconds}.{micros:06}) {} {frame}", config.name)?;
        }
    }
    Ok(())
}
