//! The motors of a configuration: limits, drives, and the model's limits of their actuators.

use sarrus_models::yaml::{self, Node, quoted};
use sarrus_proto::actuators::MAX_ACTUATORS;

use super::configuration::{BusConfig, Limits, MotorConfig};
use super::keys::{LARGE, LEAST, LIMITS, MOTOR};
use super::reader::{Read, Reader, Robot};
use super::values::MonitorBounds;
use crate::mapping::Mapping;
use crate::protocol::{self, Common, PROTOCOLS};
use crate::settings::Settings;

impl Reader<'_, '_> {
    /// The motors with the names of their actuators.
    pub(super) fn motors(
        &mut self,
        root: &Node,
        buses: Option<&[BusConfig]>,
        robot: Option<&Robot>,
    ) -> Vec<(String, Read)> {
        let nodes = self.list(root, "motors", MAX_ACTUATORS);
        let usual = self.monitors(root, MonitorBounds::USUAL);
        let mut motors = Vec::new();
        for node in nodes {
            let read = self.settings(node, "the motor", MOTOR, &["drive", "limits", "monitors"]);
            let limits = self.limits(node, read.as_ref(), robot);
            let monitors = self.monitors(node, usual);
            let drive = self.drive(node, read.as_ref(), &limits);
            let (Some(read), Some((protocol, settings, common, drive))) = (read, drive) else {
                continue;
            };
            let name = read.text("actuator").to_owned();
            let actuator = match robot {
                Some(robot) => self.actuator(&read, robot),
                None => Some(motors.len()),
            };
            let bus = buses.and_then(|buses| self.bus(&read, buses));
            if read.integer("sign") == 0 {
                self.diagnostics.error(read.place("sign"), "`sign` is 0", "1 or -1", "correct it");
            }
            let (Some(actuator), Some(bus)) = (actuator, bus) else { continue };
            let motor = MotorConfig {
                actuator,
                bus,
                protocol,
                settings,
                common,
                drive,
                mapping: Mapping {
                    sign: read.number("sign"),
                    gear: read.number("gear"),
                    offset: read.number_or("offset", 0.0),
                    torque_constant: read.number("torque_constant"),
                },
                is_calibrated: read.has("offset"),
                watchdog_believed: read.text("watchdog") == "believed",
                limits,
                damping: read.number_or("damping", limits.damping()),
                dither: read.number_or("dither", 0.0),
                rest: read.has("rest").then(|| read.number("rest")),
                monitors,
            };
            motors.push((name, Read { motor, place: node.span }));
        }
        motors
    }

    /// The place in u of the actuator that a motor names.
    fn actuator(&mut self, read: &Settings, robot: &Robot) -> Option<usize> {
        let name = (read.text("actuator"), read.place("actuator"));
        let found = format!("the robot has no actuator {}", quoted(name.0));
        let known = robot.loaded.compiled.model.active_names();
        self.place(name, known, found, "correct the name")
    }

    /// Limits of a motor's actuator, all from the file: those of the robot bound them.
    fn limits(&mut self, motor: &Node, read: Option<&Settings>, robot: Option<&Robot>) -> Limits {
        let Some(node) = motor.get("limits") else {
            let expected = "`limits: {position: [lower, upper], velocity: …, effort: …}`";
            let found = "the motor has no `limits`";
            self.diagnostics.error(motor.span, found, expected, "add them");
            return Limits::NONE;
        };
        let written = self.settings(node, "`limits`", LIMITS, &["position"]);
        if node.get("position").is_none() {
            let help = "add it; a joint that turns for ever has the range of its longest run";
            let found = "`limits` has no `position`";
            self.diagnostics.error(node.span, found, "`position: [lower, upper]`", help);
        }
        let position = yaml::numbers::<2>(node, "`limits`", "position", self.diagnostics);
        let Some((written, [lower, upper])) = written.zip(position) else { return Limits::NONE };
        // as far apart as the least of all other numbers
        let is_range = upper - lower >= LEAST && lower.abs().max(upper.abs()) <= LARGE;
        if !is_range {
            let found = format!("the position limits are [{lower}, {upper}]");
            self.diagnostics.error(node.span, found, "lower < upper", "correct them");
        }
        let limits = Limits {
            lower,
            upper,
            velocity: written.number("velocity"),
            effort: written.number("effort"),
            effort_rate: written.number_or("effort_rate", f64::INFINITY),
        };
        let of_model =
            read.zip(robot).and_then(|(read, robot)| robot.limits(read.text("actuator")));
        if let Some(model) = of_model {
            let beyond = limits.lower < model.lower
                || limits.upper > model.upper
                || limits.effort > model.effort
                || limits.velocity > model.velocity;
            if beyond {
                let found = "`limits` go beyond those of the URDF";
                let expected = "limits within the model's";
                self.diagnostics.warning(node.span, found, expected, "correct one of them");
            }
        }
        limits
    }

    fn drive(&mut self, motor: &Node, read: Option<&Settings>, limits: &Limits) -> Option<Driven> {
        let known: Vec<&str> = PROTOCOLS.iter().map(|protocol| protocol.name).collect();
        let expected = known.join(", ");
        let Some(node) = motor.get("drive") else {
            let expected = format!("`drive: {{protocol: …}}` with {expected}");
            self.diagnostics.error(motor.span, "the motor has no `drive`", expected, "add it");
            return None;
        };
        let Some((name, place)) = yaml::word(node, "protocol", self.diagnostics) else {
            if node.get("protocol").is_none() {
                let found = "the drive has no `protocol`";
                self.diagnostics.error(node.span, found, expected, "add it");
            }
            return None;
        };
        let found = format!("the protocol {} is not known", quoted(&name));
        let help = "use `dbc` for any other protocol";
        let protocol = *PROTOCOLS.get(self.place((&name, place), &known, found, help)?)?;
        let settings = self.settings(node, "the drive", protocol.keys, &["protocol", "mode"])?;
        let mode = match yaml::word(node, "mode", self.diagnostics) {
            None => protocol.modes.first().copied()?,
            Some((name, place)) => {
                let mode = protocol.modes.iter().copied().find(|mode| mode.name() == name);
                if mode.is_none() {
                    let modes: Vec<&str> = protocol.modes.iter().map(|mode| mode.name()).collect();
                    let name = quoted(&name);
                    let found = format!("{} does not know the mode {name}", protocol.name);
                    let help = "choose one of them";
                    self.diagnostics.error(place, found, modes.join(", "), help);
                }
                mode?
            }
        };
        let read = read?;
        let torque_limit = limits.effort / (read.number("gear") * read.number("torque_constant"));
        let common = Common {
            mode,
            watchdog_ms: read.integer("watchdog_ms") as u32,
            torque_limit,
            velocity_limit: limits.velocity * read.number("gear"),
            period_ns: self.period_ns,
        };
        let drive = (protocol.make)(&settings, common, self.diagnostics)?;
        Some((protocol, settings, common, drive))
    }
}

type Driven = (&'static protocol::Protocol, Settings, Common, Box<dyn crate::drive::Drive>);
