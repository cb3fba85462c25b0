//! Damping, spring and rotor of a joint: `<dynamics>` of a joint, and the rotor in the actuator of
//! a `<transmission>`.

use roxmltree::Node;
use sarrus_dynamics::description::{Friction, JointKind, Terms};

use super::xml::{Reader, Shape};
use crate::report::{Diagnostics, Span, quoted};

const DYNAMICS: Shape =
    Shape::of("damping friction spring_stiffness spring_reference rotor_inertia gear_ratio");

/// The rotor of an actuator.
pub(crate) struct Rotor {
    pub(crate) joint: String,
    pub(crate) span: Span,
    pub(super) inertia: f64,
    pub(super) ratio: f64,
}

/// Reads `<dynamics>` of a joint.
pub(super) fn read<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    kind: Option<JointKind>,
    joint: &str,
) -> Terms {
    reader.children(node, &DYNAMICS);
    let names = ["damping", "friction", "spring_stiffness", "rotor_inertia"];
    let [damping, friction, stiffness, rotor_inertia] = names.map(|name| {
        let value = reader.number(node, name).unwrap_or(0.0);
        if value < 0.0 {
            let found = format!("`{name}` of `dynamics` is {value}");
            reader.diagnostics.error(reader.span(node), found, "zero or more", "correct the value");
        }
        value
    });
    let rest = reader.number(node, "spring_reference").unwrap_or(0.0);
    let ratio = reader.number(node, "gear_ratio").unwrap_or(1.0);
    let span = reader.span(node);
    if friction > 0.0 {
        let found =
            format!("the joint {} has dry friction, which counts only on request", quoted(joint));
        let help = "ask with \"friction\": true, or simulate with --friction";
        reader.diagnostics.warning(span, found, "`damping`", help);
    }
    check_ratio(rotor_inertia, ratio, span, reader.diagnostics);
    let friction = Friction { coulomb: friction, ..Friction::default() };
    let terms = Terms { damping, stiffness, rest, rotor_inertia, gear_ratio: ratio, friction };
    let is_accepted = accepts(kind, joint, &terms, span, reader.diagnostics);
    if is_accepted { terms } else { Terms::default() }
}

/// The rotor of a transmission's actuator; most transmissions have none and are skipped.
pub(super) fn rotors<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Vec<Rotor> {
    let child = |node: Node<'_, 't>, name: &str| node.children().any(|child| is_named(child, name));
    let all = |name: &'static str| node.children().filter(move |child| child.has_tag_name(name));
    let actuators: Vec<Node<'_, 't>> =
        all("actuator").filter(|actuator| child(*actuator, "rotor_inertia")).collect();
    let joints: Vec<Node<'_, 't>> = all("joint").collect();
    let ([actuator], [joint]) = (&actuators[..], &joints[..]) else {
        if let Some(second) = actuators.first() {
            let [rotors, joints] = [actuators.len(), joints.len()];
            let found = format!("the transmission has {rotors} rotors and {joints} joints");
            let help = "write a transmission for each rotor";
            reader.diagnostics.error(reader.span(*second), found, "one of each", help);
        }
        return Vec::new();
    };
    let mut value = |names: &[&str]| {
        let named = |name: &&str| actuator.children().find(|child| is_named(*child, name));
        let found = names.iter().find_map(named)?;
        let number = if found.has_attribute("value") {
            reader.required_number(found, "value")
        } else {
            reader.numbers_of_text(found).map(|[number]| number)
        };
        number.map(|number| (number, reader.span(found)))
    };
    let inertia = value(&["rotor_inertia"]);
    let ratio = value(&["gear_ratio", "mechanicalReduction"]).map_or(1.0, |(ratio, _)| ratio);
    let name = reader.required(*joint, "name");
    let (Some((inertia, span)), Some((joint, _))) = (inertia, name) else { return Vec::new() };
    if inertia < 0.0 {
        let found = format!("the rotor inertia is {inertia}");
        reader.diagnostics.error(span, found, "zero or more", "correct the value");
    }
    check_ratio(inertia, ratio, reader.span(*actuator), reader.diagnostics);
    Vec::from_iter((inertia > 0.0).then_some(Rotor { joint, span, inertia, ratio }))
}

/// Whether a joint of this kind can have these terms; reports it if not.
pub(super) fn accepts(
    kind: Option<JointKind>,
    joint: &str,
    terms: &Terms,
    span: Span,
    diagnostics: &mut Diagnostics,
) -> bool {
    let is_damped_alone =
        terms.stiffness == 0.0 && terms.rotor_inertia == 0.0 && terms.friction.coulomb == 0.0;
    let help = "remove it, or change the type of the joint";
    let joint = quoted(joint);
    let (found, expected) = match kind {
        _ if is_damped_alone && terms.damping == 0.0 => return true,
        Some(JointKind::Fixed) => {
            let found = format!(
                "the fixed joint {joint} has damping, a spring or a rotor, which is not read"
            );
            diagnostics.warning(span, found, "a joint that moves", help);
            return false;
        }
        // damping is the same in all directions; a spring has no angle to measure
        Some(JointKind::Spherical) if is_damped_alone => return true,
        Some(JointKind::Spherical) => {
            let found = format!("the ball joint {joint} has a spring or a rotor");
            (found, "damping, or a joint of one freedom")
        }
        Some(JointKind::Floating) => {
            let found =
                format!("the joint {joint} of several freedoms has damping, a spring or a rotor");
            (found, "a joint of one freedom")
        }
        _ => return true,
    };
    diagnostics.error(span, found, expected, help);
    false
}

/// Reports a rotor whose gear ratio is zero. A negative ratio is valid: its sign is that of the
/// motor's coordinate.
fn check_ratio(inertia: f64, ratio: f64, span: Span, diagnostics: &mut Diagnostics) {
    if inertia > 0.0 && ratio == 0.0 {
        let expected = "how often it turns while the joint turns once";
        let found = "the gear ratio of a rotor is zero";
        diagnostics.error(span, found, expected, "correct the value");
    }
}

/// An element by its name, with Drake's prefix, whether it is declared or not, or without.
fn is_named(node: Node<'_, '_>, name: &str) -> bool {
    let written = node.tag_name().name();
    node.is_element() && (written == name || written.strip_prefix("drake_") == Some(name))
}
