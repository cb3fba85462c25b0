//! What only the whole configuration shows: identifiers, mechanisms without motors, loads of buses.

use std::collections::HashMap;

use sarrus_models::Diagnostics;
use sarrus_models::yaml::{Span, quoted};

use super::Configuration;
use super::bus_load::{self, REFUSED, WARNED};
use super::read::Read;
use crate::drive::{Mode, Setpoint, Shared, Watchdog};
use crate::frame::{FrameQueue, Id};
use crate::mapping::ActuatorSetpoint;

/// Motors against each other and against the robot's mechanisms.
pub(super) fn motors(
    motors: &[Read],
    actuators: &[String],
    mechanisms: &[usize],
    has_model: bool,
    file: Span,
    diagnostics: &mut Diagnostics,
) {
    let mut driven: HashMap<&str, ()> = HashMap::new();
    let mut identifiers: HashMap<(usize, Id), &Read> = HashMap::new();
    let name = |read: &Read| actuators.get(read.motor.actuator).map_or("", String::as_str);
    for read in motors {
        if driven.insert(name(read), ()).is_some() {
            let found = format!("a second motor drives {}", quoted(name(read)));
            diagnostics.error(
                read.place,
                found,
                "one motor for each actuator",
                "remove one of them",
            );
        }
        for id in read.motor.drive.identifiers() {
            if let Some(other) = identifiers.insert((read.motor.bus, id), read) {
                let found = format!(
                    "the identifier 0x{:X} of {} is also that of {}",
                    id.number(),
                    quoted(name(read)),
                    quoted(name(other))
                );
                diagnostics.error(
                    read.place,
                    found,
                    "identifiers of its own on a bus",
                    "give one of them another id",
                );
            }
        }
        if !read.motor.is_calibrated {
            let found = format!("{} has no `offset`", quoted(name(read)));
            diagnostics.warning(
                read.place,
                found,
                "where the actuator is when the motor says 0",
                "measure it; without it nothing can be armed",
            );
        }
        if read.motor.watchdog_believed && read.motor.drive.state().watchdog != Watchdog::Unreadable
        {
            let found = format!("the watchdog of {} is believed", quoted(name(read)));
            diagnostics.warning(
                read.place,
                found,
                "`read_back`: this protocol can read it",
                "remove `watchdog: believed`, unless this motor refuses to tell it",
            );
        }
        if !read.motor.watchdog_believed
            && read.motor.drive.state().watchdog == Watchdog::Unreadable
        {
            let found = format!(
                "the protocol {} cannot read the motor's watchdog",
                read.motor.protocol.name
            );
            let help = "set it with the maker's tool, then write `watchdog: believed`; without it \
                nothing can be armed";
            diagnostics.warning(read.place, found, "a watchdog that is known to be on", help);
        }
    }
    let mut seen: Vec<(usize, Shared, &Read)> = Vec::new();
    for read in motors {
        let bus = read.motor.bus;
        for shared in read.motor.drive.shared_identifiers() {
            if let Some(other) = identifiers.get(&(bus, shared.id)) {
                let found = format!(
                    "{} listens on 0x{:X}, which is {}'s alone",
                    quoted(name(read)),
                    shared.id.number(),
                    quoted(name(other))
                );
                diagnostics.error(
                    read.place,
                    found,
                    "an identifier of nobody's",
                    "give one of them another id",
                );
            }
            if let Some((.., other)) =
                seen.iter().find(|(of, known, _)| *of == bus && known.collides(&shared))
            {
                let (one, two) = (quoted(name(read)), quoted(name(other)));
                let found = format!(
                    "frames of {one} and {two} on 0x{:X} cannot be told apart",
                    shared.id.number()
                );
                diagnostics.error(
                    read.place,
                    found,
                    "ids that differ in the bits that a reply has room for",
                    "give one of them another id or reply",
                );
            }
            seen.push((bus, shared, read));
        }
    }
    if !has_model {
        return;
    }
    let is_driven = |actuator: usize| motors.iter().any(|read| read.motor.actuator == actuator);
    for (actuator, mechanism) in
        mechanisms.iter().enumerate().filter(|(actuator, _)| !is_driven(*actuator))
    {
        let written = quoted(actuators.get(actuator).map_or("", String::as_str));
        let partner =
            motors.iter().find(|read| mechanisms.get(read.motor.actuator) == Some(mechanism));
        match partner {
            Some(read) => {
                let found = format!(
                    "{written} has no motor, but {} of the same closed mechanism has",
                    quoted(name(read))
                );
                diagnostics.error(
                    read.place,
                    found,
                    "a motor for each actuator of a closed mechanism",
                    "add the missing motor",
                );
            }
            None => {
                diagnostics.warning(
                    file,
                    format!("{written} has no motor"),
                    "a motor for each actuator",
                    "its commands are not used",
                );
            }
        }
    }
}

/// Protocols against buses, and the loads of the buses.
pub(super) fn whole(
    configuration: &Configuration,
    places: &[Span],
    rate: Span,
    diagnostics: &mut Diagnostics,
) {
    for (motor, place) in configuration.motors.iter().zip(places) {
        let Some(bus) = configuration.buses.get(motor.bus) else { continue };
        if motor.protocol.fd && bus.data_bitrate.is_none() {
            let found = format!(
                "{} needs CAN FD, and {} is a classic bus",
                motor.protocol.name,
                quoted(&bus.name)
            );
            diagnostics.error(
                *place,
                found,
                "`data_bitrate` on the bus",
                "add it, or use another bus",
            );
        }
        if u64::from(motor.common.watchdog_ms) * 1_000_000 <= configuration.period_ns() {
            let found = format!(
                "a watchdog of {} ms at {} Hz",
                motor.common.watchdog_ms, configuration.rate_hz
            );
            diagnostics.error(
                *place,
                found,
                "a watchdog longer than a cycle",
                "the motor would turn its torque off between two commands; make it longer",
            );
        }
        let [still, damped] = [0.0, motor.damping].map(|damping| {
            // with all the stiffness that there is: some motors have no damping without any
            let damped = ActuatorSetpoint { stiffness: 1e60, damping, ..Default::default() };
            let mut frames = FrameQueue::new(16);
            motor.drive.encode(&motor.mapping.to_motor(&damped), &mut frames);
            frames
        });
        let has_damping = motor.common.mode == Mode::Impedance && motor.damping > 0.0;
        if has_damping && still.frames() == damped.frames() {
            let found = format!("a damping of {} is no code of this motor", motor.damping);
            diagnostics.warning(
                *place,
                found,
                "a damping that its protocol can say",
                "make it larger: codes are rounded towards zero, so this is none",
            );
        }
        let mut frames = FrameQueue::new(16);
        motor.drive.encode(&Setpoint::default(), &mut frames);
        if frames.frames().is_empty() {
            diagnostics.error(
                *place,
                "the drive sends nothing for a set-point",
                "at least one frame",
                "correct its settings",
            );
        }
    }
    if configuration.timeouts.feedback_ns <= configuration.period_ns() {
        let found =
            format!("`feedback_ms` is not longer than a cycle at {} Hz", configuration.rate_hz);
        diagnostics.error(
            rate,
            found,
            "longer than a cycle",
            "motors answer once a cycle; make it longer, or rate_hz higher",
        );
    }
    for (bus, load) in configuration.buses.iter().zip(bus_load::loads(configuration)) {
        let name = quoted(&bus.name);
        for (what, fraction) in
            [(name.clone(), load.fraction), (format!("the serial port of {name}"), load.serial)]
        {
            let found = format!(
                "{what} is loaded to {:.0} % at {} Hz",
                fraction * 100.0,
                configuration.rate_hz
            );
            let help = "lower rate_hz, or spread the motors over more buses";
            if fraction > REFUSED {
                diagnostics.error(rate, found, format!("at most {:.0} %", REFUSED * 100.0), help);
            } else if fraction > WARNED {
                diagnostics.warning(rate, found, format!("at most {:.0} %", WARNED * 100.0), help);
            }
        }
    }
}
