//! Turns the text of a configuration into its values, or into all of its faults.

use std::collections::HashSet;
use std::sync::Arc;

use sarrus_models::yaml::{self, Node, Span, Value, quoted};
use sarrus_models::{Diagnostics, LoadError, Report, Source};
use sarrus_proto::watch::MAX_BUSES;

use super::commissioned::Commissioning;
use super::configuration::{BusConfig, Configuration, ModelRules, Stop, Surroundings, Timeouts};
use super::keys::{BUS, MODEL, TIMEOUTS, TOP};
use super::reader::{Read, Reader, Robot, nanoseconds};
use super::{check, plausible};
use crate::settings::{Key, Settings};

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
                    Reader { name, surroundings, diagnostics: &mut diagnostics, period_ns: 0 }
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

impl Reader<'_, '_> {
    fn configuration(&mut self, root: &Node) -> Option<Configuration> {
        const GROUPS: &[&str] =
            &["timeouts", "monitors", "model", "buses", "motors", "mechanisms", "encoders"];
        let top = self.settings(root, "the file", TOP, GROUPS);
        self.period_ns = top.as_ref().map_or(0, |top| (1e9 / top.number("rate_hz")) as u64);
        let timeouts = self.timeouts(root);
        let model_rules = self.model_rules(root);
        let buses = self.buses(root);
        let robot = top.as_ref().and_then(|top| self.robot(top));
        let read = self.motors(root, buses.as_deref(), robot.as_ref());
        let encoders = self.encoders(root, buses.as_deref(), robot.as_ref(), &read);
        let top = top?;
        let timeouts = timeouts?;
        let buses = buses?;
        let model = robot.as_ref().map(|robot| &robot.loaded.compiled.model);
        let actuators: Vec<String> = match model {
            Some(model) => model.active_names().to_vec(),
            None => read.iter().map(|(name, _)| name.clone()).collect(),
        };
        let mechanisms =
            robot.as_ref().map_or_else(|| (0..actuators.len()).collect(), Robot::mechanisms);
        let mut read: Vec<Read> = read.into_iter().map(|(_, read)| read).collect();
        if self.diagnostics.has_errors() {
            return None;
        }
        let has_model = robot.is_some();
        check::Motors {
            motors: &read,
            actuators: &actuators,
            mechanisms: &mechanisms,
            has_model,
            file: root.span,
        }
        .check(self.diagnostics);
        let places: Vec<Span> = read.iter().map(|read| read.place).collect();
        let stops = self.stops(root, &top, &actuators, &mechanisms, &mut read, has_model);
        let mut configuration = Configuration {
            stops,
            robot: model.map(|model| model.name().to_owned()),
            fingerprint: model.map_or(0, |model| model.fingerprint()),
            model: model.cloned().map(Arc::new),
            model_rules,
            source: robot.map(|robot| robot.source),
            actuators,
            mechanisms,
            rate_hz: top.number("rate_hz"),
            timeouts,
            ramp_ns: nanoseconds(top.number("ramp_ms")),
            stop: if top.text("stop") == "robot" { Stop::Robot } else { Stop::Mechanism },
            buses,
            motors: read.into_iter().map(|read| read.motor).collect(),
            encoders,
            commissioning: Commissioning::Unneeded,
            record_file: self.record_file(&top),
            warnings: Vec::new(),
        };
        configuration.commissioning = self.commissioning(&top, &configuration);
        check::whole(&configuration, &places, top.place("rate_hz"), self.diagnostics);
        plausible::ramp(&top, self.diagnostics);
        plausible::motors(&configuration, &places, self.diagnostics);
        Some(configuration)
    }

    /// The file of the record: the named one, else that of the configuration's name.
    fn record_file(&self, top: &Settings) -> String {
        match top.text("commissioning") {
            "" | "none" => {
                let path = std::path::Path::new(self.name).with_extension("commissioned");
                path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
            }
            file => file.to_owned(),
        }
    }

    /// Whether the motors of a robot were commissioned; a warning where they were not.
    fn commissioning(&mut self, top: &Settings, of: &Configuration) -> Commissioning {
        if of.robot.is_none() {
            return Commissioning::Unneeded;
        }
        let place = top.place("commissioning");
        if top.text("commissioning") == "none" {
            let found = "`commissioning: none`: nothing compared the motors with the robot";
            let help = "remove it and run `sarrus-can commission`, unless the motors are simulated";
            self.diagnostics.warning(place, found, "a record of the commissioning", help);
            return Commissioning::Waived;
        }
        let found = match (self.surroundings.file)(&of.record_file) {
            Ok(record) => of.compare_record(&record),
            Err(reason) => Commissioning::Missing(reason),
        };
        if let Commissioning::Missing(why) = &found {
            let found =
                format!("no record of the commissioning: {}: {why}", quoted(&of.record_file));
            let help = "run `sarrus-can commission`; without it nothing can be armed";
            self.diagnostics.warning(place, found, "one that fits this configuration", help);
        }
        found
    }

    /// The settings of a group that may be absent: then they are the defaults.
    fn group(&mut self, root: &Node, name: &str, keys: &'static [Key]) -> Option<Settings> {
        let empty = Node { span: root.span, value: Value::Map(Vec::new()) };
        self.settings(root.get(name).unwrap_or(&empty), &quoted(name), keys, &[])
    }

    fn timeouts(&mut self, root: &Node) -> Option<Timeouts> {
        let read = self.group(root, "timeouts", TIMEOUTS)?;
        let [damping_ns, disable_ns, feedback_ns, arming_ns] =
            ["damping_ms", "disable_ms", "feedback_ms", "arming_ms"]
                .map(|key| nanoseconds(read.number(key)));
        if disable_ns < damping_ns {
            let place = read.place("disable_ms");
            let found = "`disable_ms` is less than `damping_ms`";
            self.diagnostics.error(place, found, "damping first", "make disable_ms larger");
        }
        plausible::timeouts(&read, self.diagnostics);
        Some(Timeouts { damping_ns, disable_ns, feedback_ns, arming_ns })
    }

    fn model_rules(&mut self, root: &Node) -> ModelRules {
        let read = self.group(root, "model", MODEL);
        let number = |key: &str| read.as_ref().map_or(0.0, |read| read.number(key));
        let [effort, external, clearance] = ["effort", "external", "clearance"].map(number);
        ModelRules { effort, external, clearance }
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
                let place = read.place("name");
                self.diagnostics.error(place, found, "a name of its own", "rename one of them");
            }
            let reached = format!("{} {}", read.text("interface"), read.text("channel"));
            if !channels.insert(reached.clone()) {
                let found = format!("a second bus is {}", quoted(&reached));
                let place = read.place("channel");
                let help = "put all motors of a channel on one bus";
                self.diagnostics.error(place, found, "one bus for each channel", help);
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
                let found = "`urdf` beside `robot`";
                let help = "remove one of them";
                return top.wrong(self.diagnostics, "urdf", found, "one robot", help);
            }
            (true, false) => ("robot", Source::Bundled(top.text("robot").to_owned())),
            (false, true) => {
                let submechanisms = top.has("submechanisms").then(|| path("submechanisms"));
                ("urdf", Source::Files { urdf: path("urdf"), submechanisms })
            }
            (false, false) if top.has("submechanisms") => {
                let found = "`submechanisms` without `urdf`";
                let help = "add the robot's `urdf`";
                return top.wrong(self.diagnostics, "submechanisms", found, "both", help);
            }
            (false, false) => return None,
        };
        match (self.surroundings.robot)(&source) {
            Ok(loaded) => Some(Robot { loaded, source }),
            Err(LoadError::Faults(report)) => {
                let first = report.errors.first().map(ToString::to_string).unwrap_or_default();
                let found =
                    format!("the robot has {} faults, the first: {first}", report.errors.len());
                let expected = "a robot that `sarrus check` accepts";
                let help = "run `sarrus check` and fix them";
                top.wrong(self.diagnostics, key, found, expected, help)
            }
            Err(other) => {
                let help = "correct the name";
                top.wrong(self.diagnostics, key, other.to_string(), "a robot", help)
            }
        }
    }
}
