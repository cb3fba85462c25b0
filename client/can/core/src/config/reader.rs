//! The reader of configurations, and the values that its parts share.

use sarrus_models::yaml::{self, Node, Span, Value};
use sarrus_models::{Diagnostics, Loaded, Source};

use super::configuration::{Limits, MotorConfig, Surroundings};
use crate::settings::{Key, Settings};

/// A motor whose values were read but not yet compared with others.
pub(super) struct Read {
    pub(super) motor: MotorConfig,
    pub(super) place: Span,
}

/// Reader of a configuration.
pub(super) struct Reader<'a, 'f> {
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

    pub(super) fn list<'n>(&mut self, root: &'n Node, key: &str, most: usize) -> &'n [Node] {
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
        let [lower, upper, velocity, effort] =
            [limits.lower, limits.upper, limits.velocity, limits.effort];
        // files write an effort or a speed of zero for an unknown one
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
