//! Elements inside `<gazebo>`, by their effect on the dynamics.
//!
//! | elements | in the model |
//! |---|---|
//! | `joint` | a loop |
//! | `springStiffness`, `springReference` of a joint | its spring |
//! | a `plugin` whose file or name holds "mimic" | a coupling |
//! | other plug-ins; contacts, pictures, sensors, the solver | nothing |
//! | `gravity`, `turnGravityOff`, `dampingFactor`, … | an error, unless their value changes nothing |
//! | others | nothing, with a warning |

use std::collections::BTreeMap;

use roxmltree::Node;

use super::joint::Master;
use super::transmission::Dependence;
use super::xml::{Reader, child, has};
use crate::report::{Span, quoted};

/// Elements that the dynamics do not depend on.
const IRRELEVANT: [&str; 3] = [
    // contacts
    "collision fdir1 kd kp maxContacts maxVel minDepth mu mu1 mu2 selfCollide self_collide",
    // pictures and sensors
    "battery laserRetro light material particle_emitter projector provideFeedback sensor visual",
    // the method by which Gazebo solves the same equations
    "allow_auto_disable cfmDamping disableFixedJointLumping enable_wind fudgeFactor \
     implicitSpringDamper must_be_base_link physics preserveFixedJoint stopCfm stopErp",
];

/// Elements that change the dynamics, with the value at which they do not.
const CHANGES: [(&str, Option<f64>); 3] = [
    ("axis axis2 include inertial link model velocity_decay", None),
    ("dampingFactor kinematic pose static turnGravityOff", Some(0.0)),
    ("gravity", Some(1.0)),
];

/// Springs and couplings of `<gazebo>`.
#[derive(Default)]
pub(super) struct Extras {
    /// Stiffness and reference, by the joint.
    pub(super) springs: BTreeMap<String, (Span, [f64; 2])>,
    pub(super) couplings: Vec<Dependence>,
}

impl Extras {
    /// Reads one `<gazebo>` without its loops, or the `<gravity>` of a link; reports effects that
    /// the model lacks.
    pub(super) fn read<'t>(&mut self, reader: &mut Reader<'t, '_>, node: Node<'_, 't>) {
        if let Some(gravity) = child(node, "gravity").filter(|_| node.has_tag_name("link")) {
            changes(reader, gravity, node.attribute("name").unwrap_or_default());
        }
        if !node.has_tag_name("gazebo") {
            return;
        }
        let reference = node.attribute("reference").unwrap_or_default();
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "joint" => {}
                "springStiffness" => self.spring(reader, element, reference, 0),
                "springReference" => self.spring(reader, element, reference, 1),
                "plugin" => self.couplings.extend(mimic(reader, element)),
                name if IRRELEVANT.iter().any(|names| has(names, name)) => {}
                _ => changes(reader, element, reference),
            }
        }
    }

    fn spring<'t>(
        &mut self,
        reader: &mut Reader<'t, '_>,
        element: Node<'_, 't>,
        joint: &str,
        index: usize,
    ) {
        let Some([value]) = reader.numbers_of_text(element) else { return };
        let absent = (reader.span(element), [0.0; 2]);
        self.springs.entry(joint.to_owned()).or_insert(absent).1[index] = value;
    }
}

/// Reports an element that changes the dynamics, and warns of an unknown one.
fn changes<'t>(reader: &mut Reader<'t, '_>, element: Node<'_, 't>, of: &str) {
    let name = element.tag_name().name();
    let span = reader.span(element);
    let of = if of.is_empty() { String::new() } else { format!(" of {}", quoted(of)) };
    let Some((_, neutral)) = CHANGES.iter().find(|(names, _)| has(names, name)) else {
        let found = format!("the element {} in `gazebo`{of} is not known", quoted(name));
        let help = "it is not read; describe its effect on the dynamics in URDF";
        return reader.diagnostics.warning(span, found, "an element of Gazebo", help);
    };
    let words = element.text().unwrap_or_default().split_ascii_whitespace();
    // the place of the whole robot is free, its attitude is not
    let is_of_robot = name == "pose" && of.is_empty();
    let mut values = words.skip(if is_of_robot { 3 } else { 0 }).map(|word| match word {
        "true" => Some(1.0),
        "false" => Some(0.0),
        word => word.parse::<f64>().ok(),
    });
    if neutral.is_some() && values.all(|value| value == *neutral) {
        return;
    }
    let found = format!("`{name}` in `gazebo`{of} changes the dynamics and is not modelled");
    let expected = neutral.map_or("none".to_owned(), |neutral| format!("{neutral}, or none"));
    reader.diagnostics.dynamics(span, found, expected, "describe it in URDF or remove it");
}

/// The coupling of a plug-in that makes one joint follow another.
fn mimic<'t>(reader: &mut Reader<'t, '_>, plugin: Node<'_, 't>) -> Option<Dependence> {
    let is_mimic = |key: &str| {
        plugin.attribute(key).is_some_and(|name| name.to_ascii_lowercase().contains("mimic"))
    };
    if !is_mimic("filename") && !is_mimic("name") {
        return None;
    }
    let span = reader.span(plugin);
    let name = |element: &str| {
        child(plugin, element).and_then(|node| node.text()).map(|text| text.trim().to_owned())
    };
    let [Some(master), Some(joint)] = ["joint", "mimicJoint"].map(name) else {
        let found = "a plug-in that couples joints, without `joint` and `mimicJoint`";
        let help = "write <mimic joint multiplier/> into the joint that follows";
        reader.diagnostics.dynamics(span, found, "<joint> and <mimicJoint>", help);
        return None;
    };
    let [multiplier, offset] = [("multiplier", 1.0), ("offset", 0.0)].map(|(element, default)| {
        let Some(node) = child(plugin, element) else { return Some(default) };
        reader.numbers_of_text(node).map(|[number]| number)
    });
    let master =
        Master { joint: master, span, multiplier: multiplier?, offset: offset?, curve: None };
    Some(Dependence { joint, span, masters: vec![master] })
}
