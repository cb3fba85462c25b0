//! From the text of a configuration to its values, or to everything that is wrong with it.

use std::collections::HashSet;

use sarrus_models::yaml::{self, Node, Span, Value, quoted};
use sarrus_models::{Diagnostics, LoadError, Loaded, Report, Source};

use super::{
    BusConfig, Configuration, Limits, MAX_ACTUATORS, MAX_BUSES, MotorConfig, Stop, Surroundings,
    Timeouts, check,
};
use crate::mapping::Mapping;
use crate::protocol::{self, Common, PROTOCOLS};
use crate::settings::{Key, KeyKind, Settings};

/// A time or a size that nobody sensible exceeds.
const LARGE: f64 = 1e9;

const TOP: &[Key] = &[
    key("robot", KeyKind::Text, Some(""), "a bundled robot"),
    key("urdf", KeyKind::Text, Some(""), "the robot's URDF"),
    key("submechanisms", KeyKind::Text, Some(""), "the robot's submechanism file"),
    key("rate_hz", KeyKind::Number(1.0, 4000.0), None, "cycles in a second"),
    key(
        "ramp_ms",
        KeyKind::Number(0.0, 60_000.0),
        Some("500"),
        "time in which gains and efforts grow after arming",
    ),
    key(
        "stop",
        KeyKind::Word(&["mechanism", "robot"]),
        Some("mechanism"),
        "what stops when a motor fails",
    ),
];
const TIMEOUTS: &[Key] = &[
    key(
        "damping_ms",
        KeyKind::Number(0.1, 10_000.0),
        Some("20"),
        "T1: older commands bring damping",
    ),
    key("disable_ms", KeyKind::Number(0.1, 60_000.0), Some("100"), "T2: older commands disable"),
    key(
        "feedback_ms",
        KeyKind::Number(0.1, 10_000.0),
        Some("20"),
        "a motor silent for longer has failed",
    ),
    key(
        "arming_ms",
        KeyKind::Number(1.0, 60_000.0),
        Some("2000"),
        "arming that takes longer has failed",
    ),
];
const BUS: &[Key] = &[
    key("name", KeyKind::Text, None, "what motors call it"),
    key("interface", KeyKind::Text, Some("socketcan"), "how it is reached, in python-can's words"),
    key("channel", KeyKind::Text, None, "which of them, as can0"),
    key("bitrate", KeyKind::Integer(10_000, 1_000_000), Some("1000000"), "bit rate in bit/s"),
    key(
        "data_bitrate",
        KeyKind::Integer(10_000, 8_000_000),
        Some(""),
        "bit rate of the data in CAN FD in bit/s",
    ),
];
const MOTOR: &[Key] = &[
    key("actuator", KeyKind::Text, None, "the actuator that it drives"),
    key("bus", KeyKind::Text, None, "the bus that it is on"),
    key(
        "sign",
        KeyKind::Integer(-1, 1),
        Some("1"),
        "-1 where actuator and motor go against each other",
    ),
    key(
        "gear",
        KeyKind::Number(1e-9, LARGE),
        Some("1"),
        "the motor's turn for the actuator's, rad/rad or rad/m",
    ),
    key(
        "offset",
        KeyKind::Number(-LARGE, LARGE),
        Some(""),
        "where the actuator is when the motor says 0, in rad or m",
    ),
    key(
        "torque_constant",
        KeyKind::Number(1e-9, LARGE),
        Some("1"),
        "true torque for the torque that the protocol says",
    ),
    key(
        "damping",
        KeyKind::Number(0.0, LARGE),
        Some("0"),
        "damping while commands are late, N m s/rad or N s/m",
    ),
    key("watchdog_ms", KeyKind::Integer(1, 10_000), None, "the motor's own watchdog in ms"),
    key(
        "watchdog",
        KeyKind::Word(&["read_back", "believed"]),
        Some("read_back"),
        "believed where the protocol cannot read it",
    ),
];
const LIMITS: &[Key] = &[
    key("velocity", KeyKind::Number(1e-9, LARGE), Some(""), "greatest speed, rad/s or m/s"),
    key("effort", KeyKind::Number(0.0, LARGE), Some(""), "greatest effort, N m or N"),
    key(
        "effort_rate",
        KeyKind::Number(1e-9, 1e15),
        Some(""),
        "greatest change of the effort, N m/s or N/s",
    ),
];

const fn key(
    name: &'static str,
    kind: KeyKind,
    default: Option<&'static str>,
    about: &'static str,
) -> Key {
    Key { name, kind, default, about }
}

/// A motor whose values were read but not yet compared with others.
pub(super) struct Read {
    pub(super) motor: MotorConfig,
    pub(super) place: Span,
}

impl Configuration {
    /// Reads a configuration; `name` is that of its file in messages.
    ///
    /// # Errors
    /// Every fault with its place, not only the first.
    pub fn read(
        name: &str,
        bytes: Vec<u8>,
        surroundings: &Surroundings,
    ) -> Result<Configuration, Report> {
        let mut diagnostics = Diagnostics::new(false);
        let configuration =
            yaml::read(name, bytes, "a configuration of buses and motors", &mut diagnostics)
                .and_then(|root| {
                    Reader { surroundings, diagnostics: &mut diagnostics, period_ns: 0 }
                        .configuration(&root)
                });
        let report = diagnostics.into_report();
        match configuration {
            Some(configuration) if report.errors.is_empty() => {
                Ok(Configuration { warnings: report.warnings, ..configuration })
            }
            _ => Err(report),
        }
    }
}

struct Reader<'a, 'f> {
    surroundings: &'a Surroundings<'a>,
    diagnostics: &'f mut Diagnostics,
    period_ns: u64,
}

impl Reader<'_, '_> {
    fn settings(
        &mut self,
        node: &Node,
        of: &str,
        keys: &'static [Key],
        others: &[&str],
    ) -> Option<Settings> {
        Settings::read(node, of, keys, others, self.surroundings.file, self.diagnostics)
    }

    fn configuration(&mut self, root: &Node) -> Option<Configuration> {
        let top = self.settings(root, "the file", TOP, &["timeouts", "buses", "motors"]);
        self.period_ns = top.as_ref().map_or(0, |top| (1e9 / top.number("rate_hz")) as u64);
        let timeouts = self.timeouts(root);
        let buses = self.buses(root);
        let robot = top.as_ref().and_then(|top| self.robot(top));
        let read = self.motors(root, buses.as_deref(), robot.as_ref());
        let (top, timeouts, buses) = (top?, timeouts?, buses?);
        let actuators: Vec<String> = match &robot {
            Some(robot) => robot.loaded.compiled.model.active_names().to_vec(),
            None => read.iter().map(|(name, _)| name.clone()).collect(),
        };
        let mechanisms =
            robot.as_ref().map_or_else(|| (0..actuators.len()).collect(), Robot::mechanisms);
        let read: Vec<Read> = read.into_iter().map(|(_, read)| read).collect();
        if self.diagnostics.has_errors() {
            return None;
        }
        check::motors(&read, &actuators, &mechanisms, robot.is_some(), root.span, self.diagnostics);
        let places: Vec<Span> = read.iter().map(|read| read.place).collect();
        let configuration = Configuration {
            robot: robot.as_ref().map(|robot| robot.loaded.compiled.model.name().to_owned()),
            fingerprint: robot
                .as_ref()
                .map_or(0, |robot| robot.loaded.compiled.model.fingerprint()),
            source: robot.map(|robot| robot.source),
            actuators,
            mechanisms,
            rate_hz: top.number("rate_hz"),
            timeouts,
            ramp_ns: nanoseconds(top.number("ramp_ms")),
            stop: if top.text("stop") == "robot" { Stop::Robot } else { Stop::Mechanism },
            buses,
            motors: read.into_iter().map(|read| read.motor).collect(),
            warnings: Vec::new(),
        };
        check::whole(&configuration, &places, top.place("rate_hz"), self.diagnostics);
        Some(configuration)
    }

    fn timeouts(&mut self, root: &Node) -> Option<Timeouts> {
        let empty = Node { span: root.span, value: Value::Map(Vec::new()) };
        let node = root.get("timeouts").unwrap_or(&empty);
        let read = self.settings(node, "`timeouts`", TIMEOUTS, &[])?;
        let [damping_ns, disable_ns, feedback_ns, arming_ns] =
            ["damping_ms", "disable_ms", "feedback_ms", "arming_ms"]
                .map(|key| nanoseconds(read.number(key)));
        if disable_ns < damping_ns {
            let place = read.place("disable_ms");
            self.diagnostics.error(
                place,
                "`disable_ms` is less than `damping_ms`",
                "damping first",
                "make disable_ms larger",
            );
        }
        Some(Timeouts { damping_ns, disable_ns, feedback_ns, arming_ns })
    }

    fn buses(&mut self, root: &Node) -> Option<Vec<BusConfig>> {
        let nodes = self.list(root, "buses", MAX_BUSES);
        let mut names: HashSet<String> = HashSet::new();
        let mut channels: HashSet<String> = HashSet::new();
        let mut buses = Vec::new();
        for node in nodes {
            let Some(read) = self.settings(node, "the bus", BUS, &[]) else { continue };
            let name = read.text("name").to_owned();
            if !names.insert(name.clone()) {
                let found = format!("a second bus is named {}", quoted(&name));
                self.diagnostics.error(
                    read.place("name"),
                    found,
                    "a name of its own",
                    "rename one of them",
                );
            }
            let reached = format!("{} {}", read.text("interface"), read.text("channel"));
            if !channels.insert(reached.clone()) {
                let found = format!("a second bus is {}", quoted(&reached));
                self.diagnostics.error(
                    read.place("channel"),
                    found,
                    "one bus for each channel",
                    "put all motors of a channel on one bus",
                );
            }
            buses.push(BusConfig {
                name,
                interface: read.text("interface").to_owned(),
                channel: read.text("channel").to_owned(),
                bitrate: read.integer("bitrate") as u32,
                data_bitrate: read.has("data_bitrate").then(|| read.integer("data_bitrate") as u32),
            });
        }
        (!nodes.is_empty() && buses.len() == nodes.len()).then_some(buses)
    }

    /// The robot, if there is one; its faults are this file's where it names it.
    fn robot(&mut self, top: &Settings) -> Option<Robot> {
        let path = |key: &str| std::path::PathBuf::from(top.text(key));
        let (key, source) = match (top.has("robot"), top.has("urdf")) {
            (true, true) => {
                self.diagnostics.error(
                    top.place("urdf"),
                    "`urdf` beside `robot`",
                    "one robot",
                    "remove one of them",
                );
                return None;
            }
            (true, false) => ("robot", Source::Bundled(top.text("robot").to_owned())),
            (false, true) => {
                let submechanisms = top.has("submechanisms").then(|| path("submechanisms"));
                ("urdf", Source::Files { urdf: path("urdf"), submechanisms })
            }
            (false, false) if top.has("submechanisms") => {
                self.diagnostics.error(
                    top.place("submechanisms"),
                    "`submechanisms` without `urdf`",
                    "both",
                    "add the robot's `urdf`",
                );
                return None;
            }
            (false, false) => return None,
        };
        match (self.surroundings.robot)(&source) {
            Ok(loaded) => Some(Robot { loaded, source }),
            Err(LoadError::Faults(report)) => {
                let first = report.errors.first().map(ToString::to_string).unwrap_or_default();
                let found =
                    format!("the robot has {} faults, the first: {first}", report.errors.len());
                self.diagnostics.error(
                    top.place(key),
                    found,
                    "a robot that `sarrus check` accepts",
                    "run `sarrus check` and fix them",
                );
                None
            }
            Err(other) => {
                self.diagnostics.error(
                    top.place(key),
                    other.to_string(),
                    "a robot",
                    "correct the name",
                );
                None
            }
        }
    }

    /// The motors with the names of their actuators.
    fn motors(
        &mut self,
        root: &Node,
        buses: Option<&[BusConfig]>,
        robot: Option<&Robot>,
    ) -> Vec<(String, Read)> {
        let nodes = self.list(root, "motors", MAX_ACTUATORS);
        let mut motors = Vec::new();
        for node in nodes {
            let read = self.settings(node, "the motor", MOTOR, &["drive", "limits"]);
            let limits = self.limits(node, read.as_ref(), robot);
            let drive = self.drive(node, read.as_ref(), &limits);
            let (Some(read), Some((protocol, settings, common, drive))) = (read, drive) else {
                continue;
            };
            let name = read.text("actuator").to_owned();
            let actuator = match robot.map(|robot| robot.loaded.compiled.model.active_names()) {
                Some(known) => known.iter().position(|known| *known == name).or_else(|| {
                    let help = self.diagnostics.did_you_mean(
                        &name,
                        known.iter().map(String::as_str),
                        "correct the name",
                    );
                    let found = format!("the robot has no actuator {}", quoted(&name));
                    self.diagnostics.error(read.place("actuator"), found, known.join(", "), help);
                    None
                }),
                None => Some(motors.len()),
            };
            let bus = buses.and_then(|buses| {
                let place = buses.iter().position(|bus| bus.name == read.text("bus"));
                if place.is_none() {
                    let names = || buses.iter().map(|bus| bus.name.as_str());
                    let help = self.diagnostics.did_you_mean(
                        read.text("bus"),
                        names(),
                        "correct the name or add the bus",
                    );
                    let found = format!("there is no bus {}", quoted(read.text("bus")));
                    self.diagnostics.error(
                        read.place("bus"),
                        found,
                        names().collect::<Vec<_>>().join(", "),
                        help,
                    );
                }
                place
            });
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
                    offset: if read.has("offset") { read.number("offset") } else { 0.0 },
                    torque_constant: read.number("torque_constant"),
                },
                is_calibrated: read.has("offset"),
                watchdog_believed: read.text("watchdog") == "believed",
                limits,
                damping: read.number("damping"),
            };
            motors.push((name, Read { motor, place: node.span }));
        }
        motors
    }

    /// Limits of a motor's actuator: the file's, and the model's where the file has none.
    fn limits(&mut self, motor: &Node, read: Option<&Settings>, robot: Option<&Robot>) -> Limits {
        let of_model =
            read.zip(robot).and_then(|(read, robot)| robot.limits(read.text("actuator")));
        let mut limits = of_model.unwrap_or(Limits::NONE);
        let Some(node) = motor.get("limits") else {
            if limits.effort == f64::INFINITY {
                self.diagnostics.error(
                    motor.span,
                    "the motor has no `limits`",
                    "at least `limits: {effort: …}`",
                    "add them",
                );
            }
            return limits;
        };
        let Some(written) = self.settings(node, "`limits`", LIMITS, &["position"]) else {
            return limits;
        };
        if let Some([lower, upper]) =
            yaml::numbers::<2>(node, "`limits`", "position", self.diagnostics)
        {
            if lower >= upper {
                self.diagnostics.error(
                    node.span,
                    format!("the position limits are [{lower}, {upper}]"),
                    "lower < upper",
                    "correct them",
                );
            }
            [limits.lower, limits.upper] = [lower, upper];
        }
        for (key, limit) in [
            ("velocity", &mut limits.velocity),
            ("effort", &mut limits.effort),
            ("effort_rate", &mut limits.effort_rate),
        ] {
            if written.has(key) {
                *limit = written.number(key);
            }
        }
        if limits.effort == f64::INFINITY {
            self.diagnostics.error(
                node.span,
                "`limits` has no `effort`",
                "the greatest effort of this motor",
                "add it",
            );
        }
        if let Some(model) = of_model {
            let beyond = limits.lower < model.lower
                || limits.upper > model.upper
                || limits.effort > model.effort
                || limits.velocity > model.velocity;
            if beyond {
                self.diagnostics.warning(
                    node.span,
                    "`limits` go beyond those of the URDF",
                    "limits within the model's",
                    "correct one of them",
                );
            }
        }
        limits
    }

    fn drive(&mut self, motor: &Node, read: Option<&Settings>, limits: &Limits) -> Option<Driven> {
        let known = || PROTOCOLS.iter().map(|protocol| protocol.name);
        let expected = || known().collect::<Vec<_>>().join(", ");
        let Some(node) = motor.get("drive") else {
            let found = "the motor has no `drive`";
            self.diagnostics.error(
                motor.span,
                found,
                format!("`drive: {{protocol: …}}` with {}", expected()),
                "add it",
            );
            return None;
        };
        let Some((name, place)) = yaml::word(node, "protocol", self.diagnostics) else {
            if node.get("protocol").is_none() {
                self.diagnostics.error(
                    node.span,
                    "the drive has no `protocol`",
                    expected(),
                    "add it",
                );
            }
            return None;
        };
        let Some(protocol) = protocol::protocol(&name) else {
            let help =
                self.diagnostics.did_you_mean(&name, known(), "use `dbc` for any other protocol");
            self.diagnostics.error(
                place,
                format!("the protocol {} is not known", quoted(&name)),
                expected(),
                help,
            );
            return None;
        };
        let settings = self.settings(node, "the drive", protocol.keys, &["protocol", "mode"])?;
        let mode = match yaml::word(node, "mode", self.diagnostics) {
            None => protocol.modes.first().copied()?,
            Some((name, place)) => {
                let mode = protocol.modes.iter().copied().find(|mode| mode.name() == name);
                if mode.is_none() {
                    let modes = protocol
                        .modes
                        .iter()
                        .map(|mode| mode.name())
                        .collect::<Vec<_>>()
                        .join(", ");
                    let found =
                        format!("{} does not know the mode {}", protocol.name, quoted(&name));
                    self.diagnostics.error(place, found, modes, "choose one of them");
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
            period_ns: self.period_ns,
        };
        let drive = (protocol.make)(&settings, common, self.diagnostics)?;
        Some((protocol, settings, common, drive))
    }

    fn list<'n>(&mut self, root: &'n Node, key: &str, most: usize) -> &'n [Node] {
        let nodes = yaml::list(root, key, self.diagnostics);
        if nodes.is_empty()
            && matches!(
                root.get(key).map(|node| &node.value),
                None | Some(Value::Null | Value::List(_))
            )
        {
            let place = root.get(key).map_or(root.span, |node| node.span);
            self.diagnostics.error(
                place,
                format!("the file has no `{key}`"),
                "a list of at least one",
                "add it",
            );
        }
        if let Some(first) = nodes.get(most) {
            self.diagnostics.error(
                first.span,
                format!("`{key}` has {} entries", nodes.len()),
                format!("at most {most}"),
                "divide the robot",
            );
        }
        nodes
    }
}

type Driven = (&'static protocol::Protocol, Settings, Common, Box<dyn crate::drive::Drive>);

struct Robot {
    loaded: Loaded,
    source: Source,
}

impl Robot {
    /// Mechanisms numbered from 0 in the order of their first actuator.
    fn mechanisms(&self) -> Vec<usize> {
        let clusters = self.loaded.compiled.model.actuator_clusters();
        let mut known: Vec<usize> = Vec::new();
        let number = |cluster: &usize| {
            known.iter().position(|known| known == cluster).unwrap_or_else(|| {
                known.push(*cluster);
                known.len() - 1
            })
        };
        clusters.iter().map(number).collect()
    }

    /// Limits of an actuator in the model.
    fn limits(&self, actuator: &str) -> Option<Limits> {
        let joints = &self.loaded.description.joints;
        let limits = joints.iter().find(|joint| joint.name == actuator)?.limits?;
        let [lower, upper, velocity, effort] =
            [limits.lower, limits.upper, limits.velocity, limits.effort];
        // an effort or a speed of zero is how files say that nobody knows
        let known = |limit: f64| if limit > 0.0 { limit } else { f64::INFINITY };
        Some(Limits {
            lower,
            upper,
            velocity: known(velocity),
            effort: known(effort),
            effort_rate: f64::INFINITY,
        })
    }
}

impl Limits {
    /// No limits.
    pub const NONE: Limits = Limits {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: f64::INFINITY,
        effort: f64::INFINITY,
        effort_rate: f64::INFINITY,
    };
}

fn nanoseconds(ms: f64) -> u64 {
    (ms * 1e6).round() as u64
}
