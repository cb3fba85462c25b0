//! Motors asked one by one, without power: whether they answer, and their firmware.

use std::time::{Duration, Instant};

use sarrus_can_core::config::{Configuration, MotorConfig};
use sarrus_can_core::drive::Receipt;
use sarrus_can_core::frame::FrameQueue;
use sarrus_client::now_ns;

use super::{Finding, name};
use sarrus_can_run::bus::{self, Address, Bus, BusError, Heard, own};

/// Time for an answer, and between two questions.
const TIMEOUT: Duration = Duration::from_secs(1);
const AGAIN: Duration = Duration::from_millis(20);

/// Findings, and the firmware of motors that report it.
pub(super) fn ask(configuration: &mut Configuration) -> (Vec<Finding>, Vec<(String, String)>) {
    let mut findings = Vec::new();
    let mut firmware = Vec::new();
    let mut motors = std::mem::take(&mut configuration.motors);
    for (number, of_bus) in configuration.buses.iter().enumerate() {
        let address = Address::of(of_bus);
        let opened = own(&address).and_then(|mark| Ok((mark, bus::open(&address)?)));
        let (_mark, mut port) = match opened {
            Ok(opened) => opened,
            Err(error) => {
                findings.push(Finding::new(format!("bus {}", of_bus.name), error.to_string()));
                continue;
            }
        };
        for motor in motors.iter_mut().filter(|motor| motor.bus == number) {
            let name = name(configuration, motor.actuator).to_owned();
            match one(port.as_mut(), motor) {
                Ok(Answer { version: Some(version), .. }) => firmware.push((name, version)),
                Ok(Answer { heard: true, .. }) => {}
                Ok(Answer { malformed, .. }) => {
                    findings.push(Finding::new(format!("motor {name}"), silence(malformed)));
                }
                Err(error) => {
                    findings.push(Finding::new(format!("motor {name}"), error.to_string()))
                }
            }
        }
    }
    configuration.motors = motors;
    (findings, firmware)
}

fn silence(is_malformed: bool) -> &'static str {
    if is_malformed {
        "its answers are malformed, expected those of its protocol; correct protocol, variant or \
         model"
    } else {
        "no answer, expected one; is it powered, are its identifiers and the bit rate right? \
         `python -m sarrus.can scan --all` finds others"
    }
}

/// Answer of a motor.
#[derive(Default)]
struct Answer {
    heard: bool,
    malformed: bool,
    version: Option<String>,
}

fn one(port: &mut dyn Bus, motor: &mut MotorConfig) -> Result<Answer, BusError> {
    let version = motor.drive.parameters().iter().position(|parameter| parameter.is_version());
    let begin = Instant::now();
    let mut answer = Answer::default();
    let mut out = FrameQueue::new(32);
    while begin.elapsed() < TIMEOUT && !(answer.heard && version.is_none()) {
        out.clear();
        match version {
            Some(version) => motor.drive.read_parameter(version, &mut out),
            None => motor.drive.probe(&mut out),
        }
        for frame in out.frames() {
            port.send(frame)?;
        }
        bus::wait_for_bus(port, AGAIN)?;
        while let Some(heard) = port.next()? {
            let Heard::Frame(frame) = heard else { continue };
            match motor.drive.receive(now_ns(), &frame) {
                Receipt::Parameter(place, value) if Some(place) == version => {
                    let name = motor.drive.parameters().get(place).map_or("", |known| known.name);
                    let version = Some(format!("{name} {value}"));
                    return Ok(Answer { heard: true, version, ..answer });
                }
                Receipt::Malformed => answer.malformed = true,
                Receipt::NotMine | Receipt::Foreign => {}
                _ => answer.heard = true,
            }
        }
    }
    Ok(answer)
}
