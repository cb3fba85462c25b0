//! The reader of configurations, and the values that its parts share.

use sarrus_models::yaml::{self, Node, Span, Value, quoted};
use sarrus_models::{Diagnostics, Loaded, Source};

use super::configuration::{BusConfig, Limits, MotorConfig, Surroundings};
use crate::settings::{Key, Settings};

/// A motor whose values were read but not yet compared with others.
pub(super) struct Read {
    pub(super) motor: MotorConfig,
    pub(super) place: Span,
}

/// Reader of a configuration.
pub(super) struct Reader<'a, 'f> {
    /// Name of the file.
    pub(super) name: &'a str,
    pub(super) surroundings: &'a Surroundings<'a>,
    pub(super) diagnostics: &'f mut Diagnostics,
    pub(super) period_ns: u64,
}

impl Reader<'_, '_> {
    pub(super) fn settings(
        &mut self,
        node: &Node,
        of: &str,
        keys: &'static [Key],
        others: &[&str],
    ) -> Option<Settings> {
        Settings::read(node, of, keys, others, self.surroundings.file, self.diagnostics)
    }

    /// The index of a name in `known`; an unknown name is reported as `found`.
    pub(super) fn place(
        &mut self,
        (name, span): (&str, Span),
        known: &[impl AsRef<str>],
        found: String,
        help: &str,
    ) -> Option<usize> {
        let known: Vec<&str> = known.iter().map(AsRef::as_ref).collect();
        let place = known.iter().position(|known| *known == name);
        if place.is_none() {
            let help = self.diagnostics.did_you_mean(name, known.iter().copied(), help);
            self.diagnostics.error(span, found, known.join(", "), help);
        }
        place
    }

    /// The place of the bus that a setting names.
    pub(super) fn bus(&mut self, read: &Settings, buses: &[BusConfig]) -> Option<usize> {
        let name = read.text("bus");
        let known: Vec<&str> = buses.iter().map(|bus| bus.name.as_str()).collect();
        let found = format!("there is no bus {}", quoted(name));
        self.place((name, read.place("bus")), &known, found, "correct the name or add the bus")
    }

    pub(super) fn list<'n>(&mut self, root: &'n Node, key: &str, most: usize) -> &'n [Node] {
        let nodes = yaml::list(root, key, self.diagnostics);
        let value = root.get(key).map(|node| &node.value);
        if nodes.is_empty() && matches!(value, None | Some(Value::Null | Value::List(_))) {
            let place = root.get(key).map_or(root.span, |node| node.span);
            let found = format!("the file has no `{key}`");
            self.diagnostics.error(place, found, "a list of at least one", "add it");
        }
        if let Some(first) = nodes.get(most) {
            let found = format!("`{key}` has {} entries", nodes.len());
            let expected = format!("at most {most}");
            self.diagnostics.error(first.span, found, expected, "divide the robot");
        }
        nodes
    }
}

pub(super) fn nanoseconds(ms: f64) -> u64 {
    (ms * 1e6).round() as u64
}

/// The robot of a configuration.
pub(super) struct Robot {
    pub(super) loaded: Loaded,
    pub(super) source: Source,
}

impl Robot {
    /// Mechanisms numbered from 0 in the order of their first actuator.
    pub(super) fn mechanisms(&self) -> Vec<usize> {
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
    pub(super) fn limits(&self, actuator: &str) -> Option<Limits> {
        let joints = &self.loaded.description.joints;
        let limits = joints.iter().find(|joint| joint.name == actuator)?.limits?;
        // files write an effort or a speed of zero for an unknown one
        let known = |limit: f64| if limit > 0.0 { limit } else { f64::INFINITY };
        Some(Limits {
            lower: limits.lower,
            upper: limits.upper,
            velocity: known(limits.velocity),
            effort: known(limits.effort),
            effort_rate: f64::INFINITY,
        })
    }
}
