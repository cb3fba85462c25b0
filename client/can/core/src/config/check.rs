//! Checks of the whole configuration: identifiers, mechanisms without motors, loads of buses.

use std::collections::{HashMap, HashSet};

use sarrus_models::Diagnostics;
use sarrus_models::yaml::{Span, quoted};

use super::bus_load::{self, REFUSED, WARNED};
use super::configuration::{BusConfig, Configuration, MotorConfig};
use super::reader::Read;
use crate::drive::{Mode, Setpoint, Shared, Watchdog};
use crate::frame::{FrameQueue, Id};
use crate::mapping::ActuatorSetpoint;

/// Checks the motors of a configuration against each other and the robot's mechanisms.
pub(super) struct Motors<'a> {
    pub(super) motors: &'a [Read],
    pub(super) actuators: &'a [String],
    /// By actuator.
    pub(super) mechanisms: &'a [usize],
    pub(super) has_model: bool,
    /// The place of the file.
    pub(super) file: Span,
}

/// The motor that owns each identifier of each bus.
type Owners<'a> = HashMap<(usize, Id), &'a Read>;

impl<'a> Motors<'a> {
    /// Checks them.
    pub(super) fn check(&self, diagnostics: &mut Diagnostics) {
        let mut driven: HashSet<usize> = HashSet::new();
        let mut owners = Owners::new();
        for read in self.motors {
            if !driven.insert(read.motor.actuator) {
                let found = format!("a second motor drives {}", self.name(read));
                let expected = "one motor for each actuator";
                diagnostics.error(read.place, found, expected, "remove one of them");
            }
            self.identifiers(read, &mut owners, diagnostics);
            self.trust(read, diagnostics);
            self.beside(read, diagnostics);
        }
        self.shared_identifiers(&owners, diagnostics);
        if self.has_model {
            self.undriven_actuators(&driven, diagnostics);
        }
    }

    fn name(&self, read: &Read) -> String {
        quoted(self.actuators.get(read.motor.actuator).map_or("", String::as_str))
    }

    /// Identifiers that belong to one motor alone.
    fn identifiers(&self, read: &'a Read, owners: &mut Owners<'a>, diagnostics: &mut Diagnostics) {
        for id in read.motor.drive.identifiers() {
            let Some(other) = owners.insert((read.motor.bus, id), read) else { continue };
            let number = id.number();
            let one = self.name(read);
            let two = self.name(other);
            let found = format!("the identifier 0x{number:X} of {one} is also that of {two}");
            let expected = "identifiers of its own on a bus";
            diagnostics.error(read.place, found, expected, "give one of them another id");
        }
    }

    /// A motor without offset, and watchdogs that are believed or cannot be read.
    fn trust(&self, read: &Read, diagnostics: &mut Diagnostics) {
        let motor = &read.motor;
        if !motor.is_calibrated {
            let found = format!("{} has no `offset`", self.name(read));
            let expected = "the actuator's position where the motor reports 0";
            let help = "measure it; without it nothing can be armed";
            diagnostics.warning(read.place, found, expected, help);
        }
        let is_unreadable = motor.drive.state().watchdog == Watchdog::Unreadable;
        if motor.watchdog_believed && !is_unreadable {
            let found = format!("the watchdog of {} is believed", self.name(read));
            let expected = "`read_back`: this protocol can read it";
            let help = "remove `watchdog: believed`, unless this motor refuses to tell it";
            diagnostics.warning(read.place, found, expected, help);
        }
        if !motor.watchdog_believed && is_unreadable {
            let name = motor.protocol.name;
            let found = format!("the protocol {name} cannot read the motor's watchdog");
            let help = "set it with the maker's tool, then write `watchdog: believed`; without it \
                nothing can be armed";
            diagnostics.warning(read.place, found, "a watchdog that is known to be on", help);
        }
    }

    /// A dither that does nothing or too much, and a rest pose outside the limits.
    fn beside(&self, read: &Read, diagnostics: &mut Diagnostics) {
        let MotorConfig { common, dither, rest, limits, .. } = &read.motor;
        let name = self.name(read);
        let two_codes = 2.0 * read.motor.drive.steps().position / read.motor.mapping.gear;
        let [least, most] = match common.mode {
            Mode::Position => [two_codes, 0.05 * (limits.upper - limits.lower)],
            Mode::Velocity => [f64::INFINITY; 2],
            Mode::Impedance | Mode::Torque => [0.0, 0.2 * limits.effort],
        };
        if *dither > 0.0 && !(least..=most).contains(dither) {
            let found = format!("the `dither` of {name} is {dither}");
            let expected = match common.mode {
                Mode::Velocity => "none: the mode velocity has no dither".to_owned(),
                _ => format!("a number from {least} to {most}"),
            };
            diagnostics.error(read.place, found, expected, "correct it");
        }
        if rest.is_some_and(|rest| !(limits.lower..=limits.upper).contains(&rest)) {
            let found = format!("the `rest` of {name} is outside its limits");
            diagnostics.error(read.place, found, "a position inside", "correct it");
        }
    }

    /// Identifiers that several motors use, distinguished by their data.
    fn shared_identifiers(&self, owners: &Owners<'_>, diagnostics: &mut Diagnostics) {
        let mut seen: Vec<(usize, Shared, &Read)> = Vec::new();
        for read in self.motors {
            let bus = read.motor.bus;
            for shared in read.motor.drive.shared_identifiers() {
                let name = self.name(read);
                let number = shared.id.number();
                if let Some(owner) = owners.get(&(bus, shared.id)) {
                    let owner = self.name(owner);
                    let found = format!("{name} listens on 0x{number:X}, which is {owner}'s alone");
                    let expected = "an identifier that no motor owns";
                    diagnostics.error(read.place, found, expected, "give one of them another id");
                }
                let collides = |(other_bus, other, _): &&(usize, Shared, &Read)| {
                    *other_bus == bus && other.collides(&shared)
                };
                if let Some((.., other)) = seen.iter().find(collides) {
                    let other = self.name(other);
                    let found = format!(
                        "frames of {name} and {other} on 0x{number:X} cannot be told apart"
                    );
                    let expected = "ids that differ in the bits that a reply has room for";
                    let help = "give one of them another id or reply";
                    diagnostics.error(read.place, found, expected, help);
                }
                seen.push((bus, shared, read));
            }
        }
    }

    /// Actuators without a motor: an error beside others of the same mechanism that have one.
    fn undriven_actuators(&self, driven: &HashSet<usize>, diagnostics: &mut Diagnostics) {
        for (actuator, mechanism) in self.mechanisms.iter().enumerate() {
            if driven.contains(&actuator) {
                continue;
            }
            let name = quoted(self.actuators.get(actuator).map_or("", String::as_str));
            let is_partner =
                |read: &&Read| self.mechanisms.get(read.motor.actuator) == Some(mechanism);
            if let Some(read) = self.motors.iter().find(is_partner) {
                let partner = self.name(read);
                let found =
                    format!("{name} has no motor, but {partner} of the same closed mechanism has");
                let expected = "a motor for each actuator of a closed mechanism";
                diagnostics.error(read.place, found, expected, "add the missing motor");
            } else {
                let found = format!("{name} has no motor");
                let help = "its commands are not used";
                diagnostics.warning(self.file, found, "a motor for each actuator", help);
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
        rates(motor, bus, configuration, *place, diagnostics);
        codes(motor, *place, diagnostics);
    }
    let rate_hz = configuration.rate_hz;
    if configuration.timeouts.feedback_ns <= configuration.period_ns() {
        let found = format!("`feedback_ms` is not longer than a cycle at {rate_hz} Hz");
        let help = "motors answer once a cycle; make it longer, or rate_hz higher";
        diagnostics.error(rate, found, "longer than a cycle", help);
    }
    for (bus, load) in configuration.buses.iter().zip(bus_load::loads(configuration)) {
        let name = quoted(&bus.name);
        let port = format!("the serial port of {name}");
        for (line, fraction) in [(name, load.fraction), (port, load.serial)] {
            let found = format!("{line} is loaded to {:.0} % at {rate_hz} Hz", fraction * 100.0);
            let help = "lower rate_hz, or spread the motors over more buses";
            let expected = |most: f64| format!("at most {:.0} %", most * 100.0);
            if fraction > REFUSED {
                diagnostics.error(rate, found, expected(REFUSED), help);
            } else if fraction > WARNED {
                diagnostics.warning(rate, found, expected(WARNED), help);
            }
        }
    }
}

/// A motor's protocol on its bus, and its watchdog at the rate of the bridge.
fn rates(
    motor: &MotorConfig,
    bus: &BusConfig,
    configuration: &Configuration,
    place: Span,
    diagnostics: &mut Diagnostics,
) {
    if motor.protocol.fd && bus.data_bitrate.is_none() {
        let protocol = motor.protocol.name;
        let found = format!("{protocol} needs CAN FD, and {} is a classic bus", quoted(&bus.name));
        let help = "add it, or use another bus";
        diagnostics.error(place, found, "`data_bitrate` on the bus", help);
    }
    let watchdog_ms = motor.common.watchdog_ms;
    if u64::from(watchdog_ms) * 1_000_000 <= configuration.period_ns() {
        let found = format!("a watchdog of {watchdog_ms} ms at {} Hz", configuration.rate_hz);
        let help = "the motor would turn its torque off between two commands; make it longer";
        diagnostics.error(place, found, "a watchdog longer than a cycle", help);
    }
}

/// Whether a motor's protocol can send its damping, and anything at all.
fn codes(motor: &MotorConfig, place: Span, diagnostics: &mut Diagnostics) {
    let frames = |setpoint: &Setpoint| {
        let mut frames = FrameQueue::new(16);
        motor.drive.encode(setpoint, &mut frames);
        frames
    };
    let [still, damped] = [0.0, motor.damping].map(|damping| {
        // with the greatest stiffness: some motors have no damping without any
        let damped = ActuatorSetpoint { stiffness: 1e60, damping, ..Default::default() };
        frames(&motor.mapping.to_motor(&damped))
    });
    let has_damping = motor.common.mode == Mode::Impedance && motor.damping > 0.0;
    if has_damping && still.frames() == damped.frames() {
        let found = format!("a damping of {} is no code of this motor", motor.damping);
        let help = "make it larger: codes are rounded towards zero, so this is none";
        diagnostics.warning(place, found, "a damping that its protocol can say", help);
    }
    if frames(&Setpoint::default()).frames().is_empty() {
        let found = "the drive sends nothing for a set-point";
        diagnostics.error(place, found, "at least one frame", "correct its settings");
    }
}
