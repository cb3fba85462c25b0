//! Joints: type, links, axis, limits, couplings.

use std::f64::consts::FRAC_PI_2;

use roxmltree::Node;
use sarrus_dynamics::description::{JointKind, Limits, Placement, Terms};

use super::compound::Compound;
use super::dynamics;
use super::xml::{Reader, Shape};
use crate::report::{Span, quoted};

const JOINT: Shape = Shape {
    attributes: &["name", "type", "independent"],
    once: &["origin", "parent", "child", "axis", "axis2", "limit", "mimic", "dynamics"],
    many: &[],
    ignored: &[
        "calibration",
        "safety_controller",
        "hardwareInterface",
        "joint_properties",
        "sensor",
        "gazebo",
    ],
};
const ORIGIN: Shape = Shape::of(&["xyz", "rpy", "quat_xyzw"]);
const REFERENCE: Shape = Shape::of(&["link"]);
const AXIS: Shape = Shape::of(&["xyz"]);
const LIMIT: Shape =
    Shape::of(&["lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"]);
const MIMIC: Shape = Shape::of(&["joint", "multiplier", "offset"]);

/// Joint types; those of several axes count as the motion of their parts.
const TYPES: [(&str, JointKind); 9] = [
    ("revolute", JointKind::Revolute),
    ("continuous", JointKind::Continuous),
    ("prismatic", JointKind::Prismatic),
    ("fixed", JointKind::Fixed),
    ("floating", JointKind::Floating),
    ("spherical", JointKind::Spherical),
    ("ball", JointKind::Spherical),
    (PLANAR, JointKind::Floating),
    (UNIVERSAL, JointKind::Continuous),
];

/// Joints of several axes.
const PLANAR: &str = "planar";
const UNIVERSAL: &str = "universal";

/// A joint as it stands in the file.
pub(crate) struct JointEntry {
    /// Empty when it is missing, which has been reported.
    pub(crate) name: String,
    pub(crate) span: Span,
    /// `None` when the type is not known, which has been reported.
    pub(crate) kind: Option<JointKind>,
    /// The chain that replaces a joint of several axes.
    pub(super) compound: Option<Compound>,
    pub(crate) origin: Placement,
    pub(crate) axis: [f64; 3],
    pub(crate) parent: Option<(String, Span)>,
    pub(crate) child: Option<(String, Span)>,
    /// Those of `<limit>`, of a joint of any kind.
    pub(super) limits: Option<Limits>,
    pub(crate) masters: Vec<Master>,
    pub(crate) terms: Terms,
    /// `independent` of URDF+, of a joint in a loop.
    pub(crate) independent: Option<bool>,
}

impl JointEntry {
    /// The limits that a joint of this kind has.
    pub(crate) fn limits(&self) -> Option<Limits> {
        let limits = self.limits?;
        match self.kind {
            Some(JointKind::Revolute | JointKind::Prismatic) => Some(limits),
            Some(JointKind::Continuous) => {
                Some(Limits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..limits })
            }
            _ => None,
        }
    }
}

/// One term of a coupling.
#[derive(Clone, Debug)]
pub(crate) struct Master {
    pub(crate) joint: String,
    pub(crate) span: Span,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

pub(super) fn read<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> JointEntry {
    let span = reader.span(node);
    let name = reader.required(node, "name").map(|(name, _)| name).unwrap_or_default();
    let kind =
        reader.required(node, "type").and_then(|(written, span)| kind_of(reader, &written, span));
    let is_planar = node.attribute("type") == Some(PLANAR);
    let children = reader.children(node, &JOINT);
    let find = |name: &str| children.iter().copied().find(|child| child.has_tag_name(name));
    let origin = find("origin").map(|node| origin(reader, node)).unwrap_or_default();
    let [parent, child] = ["parent", "child"].map(|end| link(reader, span, end, find(end)));
    let motion = if is_planar { Some(JointKind::Continuous) } else { kind };
    let axis = find("axis").and_then(|node| axis(reader, node, motion, &name));
    let axis = axis.unwrap_or([1.0, 0.0, 0.0]);
    let compound = compound(reader, node, &name, axis, find("axis2"));
    let limits = find("limit").map(|node| limit(reader, node, kind.filter(|_| !is_planar), &name));
    if limits.is_none() {
        without_limits(reader, span, kind, &name);
    }
    let terms =
        find("dynamics").map(|node| dynamics::read(reader, node, kind, &name)).unwrap_or_default();
    let masters = find("mimic").and_then(|node| mimic(reader, node)).into_iter().collect();
    let independent = independent(reader, node);
    JointEntry {
        name,
        span,
        kind,
        independent,
        compound,
        origin,
        axis,
        parent,
        child,
        limits,
        masters,
        terms,
    }
}

/// The link that an end of a joint names.
fn link<'t>(
    reader: &mut Reader<'t, '_>,
    joint: Span,
    end: &str,
    node: Option<Node<'_, 't>>,
) -> Option<(String, Span)> {
    let Some(node) = node else {
        let found = format!("the joint has no `{end}`");
        reader.diagnostics.error(joint, found, format!("<{end} link=\"…\"/>"), "add it");
        return None;
    };
    reader.children(node, &REFERENCE);
    reader.required(node, "link")
}

/// The chain of a joint of several axes; `None` of any other joint and after an error.
fn compound<'t>(
    reader: &mut Reader<'t, '_>,
    joint: Node<'_, 't>,
    name: &str,
    first: [f64; 3],
    axis2: Option<Node<'_, 't>>,
) -> Option<Compound> {
    let second = axis2.and_then(|node| axis(reader, node, Some(JointKind::Continuous), name));
    if joint.attribute("type") == Some(UNIVERSAL) {
        return universal(reader, reader.span(joint), name, first, second, axis2.is_some());
    }
    if let Some(node) = axis2 {
        let found = format!("`axis2` of the joint {}, which has one axis", quoted(name));
        let span = reader.span(node);
        reader.diagnostics.error(span, found, "the type `universal`", "remove it");
    }
    (joint.attribute("type") == Some(PLANAR)).then_some(Compound::Planar)
}

/// Reports a joint with a range that has no `<limit>`.
fn without_limits(reader: &mut Reader<'_, '_>, span: Span, kind: Option<JointKind>, name: &str) {
    let [kind, help] = match kind {
        Some(JointKind::Revolute) => ["revolute", "add them, or make the joint continuous"],
        Some(JointKind::Prismatic) => ["prismatic", "add them"],
        _ => return,
    };
    let found = format!("the {kind} joint {} has no limits", quoted(name));
    let expected = "<limit lower=\"…\" upper=\"…\" effort=\"…\" velocity=\"…\"/>";
    reader.diagnostics.error(span, found, expected, help);
}

/// Whether URDF+ declares the joint independent or dependent.
fn independent<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<bool> {
    let written = node.attribute_node("independent")?;
    match written.value().to_ascii_lowercase().as_str() {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => {
            let found = format!("`independent` is {}", quoted(written.value()));
            let at = reader.span_of_value(&written);
            reader.diagnostics.error(at, found, "true or false", "correct it");
            None
        }
    }
}

fn kind_of(reader: &mut Reader<'_, '_>, written: &str, span: Span) -> Option<JointKind> {
    let names = TYPES.map(|(name, _)| name);
    let kind = TYPES.into_iter().find(|(name, _)| *name == written).map(|(_, kind)| kind);
    if kind.is_none() {
        let found = format!("the joint type {} is not known", quoted(written));
        let help = "choose one of them";
        reader.diagnostics.unknown(span, found, names.join(", "), written, names, help);
    }
    kind
}

/// Reads an origin, of a joint or of an inertial.
pub(super) fn origin<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Placement {
    reader.children(node, &ORIGIN);
    let placement = reader.placement(node).unwrap_or_default();
    let Some(quaternion) = reader.numbers::<4>(node, "quat_xyzw") else { return placement };
    let span = reader.span(node);
    if !reader.version.has_quaternions() {
        let found = "`quat_xyzw` in a file of version 1.0";
        let help = "write version=\"1.1\" on `robot` or use `rpy`";
        reader.diagnostics.error(span, found, "`rpy`", help);
        return placement;
    }
    if node.has_attribute("rpy") {
        let found = "`origin` has both `rpy` and `quat_xyzw`";
        reader.diagnostics.error(span, found, "one of them", "remove the other");
    }
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() >= 1e-3 {
        let found = format!("the quaternion of `origin` has the length {length}");
        reader.diagnostics.error(span, found, "1", "normalise it");
    }
    Placement { rpy: angles(quaternion.map(|x| x / length)), ..placement }
}

/// Roll, pitch and yaw of a unit quaternion x, y, z, w, as urdfdom has them.
fn angles([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    let sin_pitch = -2.0 * (x * z - w * y);
    if sin_pitch.abs() >= 0.99999 {
        let side = sin_pitch.signum();
        return [0.0, side * FRAC_PI_2, 2.0 * (-side * x).atan2(side * y)];
    }
    let [xx, yy, zz, ww] = [x, y, z, w].map(|part| part * part);
    [
        (2.0 * (y * z + w * x)).atan2(ww - xx - yy + zz),
        sin_pitch.asin(),
        (2.0 * (x * y + w * z)).atan2(ww + xx - yy - zz),
    ]
}

/// A universal joint of these axes; `None` after an error.
fn universal(
    reader: &mut Reader<'_, '_>,
    span: Span,
    joint: &str,
    axis: [f64; 3],
    axis2: Option<[f64; 3]>,
    is_given: bool,
) -> Option<Compound> {
    let Some(axis2) = axis2 else {
        if !is_given {
            let found = format!("the universal joint {} has no `axis2`", quoted(joint));
            reader.diagnostics.error(span, found, "<axis2 xyz=\"…\"/>", "add it");
        }
        return None;
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let cosine = dot(axis, axis2) / (dot(axis, axis) * dot(axis2, axis2)).sqrt();
    if cosine.abs() > 1.0 - 1e-6 {
        let found = format!("the axes of the universal joint {} are parallel", quoted(joint));
        reader.diagnostics.error(span, found, "two directions", "correct one of them");
    }
    Some(Compound::Universal { axis2 })
}

/// Reads an axis; checks its direction if the joint moves along or about it.
fn axis<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    kind: Option<JointKind>,
    joint: &str,
) -> Option<[f64; 3]> {
    reader.children(node, &AXIS);
    let span = reader.span(node);
    let expected = "a direction as 0 0 1";
    if !node.has_attribute("xyz") {
        reader.diagnostics.error(span, "`axis` has no `xyz`", expected, "add it");
    }
    let moves =
        matches!(kind, Some(JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic));
    let axis = reader.numbers::<3>(node, "xyz");
    if let Some(axis) = axis.filter(|_| moves) {
        let length = axis.iter().fold(0.0_f64, |length, x| length.max(x.abs()));
        // far from unit length its square would leave the range of numbers
        if !(1e-6..=1e6).contains(&length) {
            let found = if length == 0.0 {
                format!("the axis of joint {} is zero", quoted(joint))
            } else {
                format!("the axis of joint {} has a length near {length:e}", quoted(joint))
            };
            reader.diagnostics.error(span, found, expected, "correct it");
        }
    }
    axis
}

fn limit<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    kind: Option<JointKind>,
    joint: &str,
) -> Limits {
    reader.children(node, &LIMIT);
    let span = reader.span(node);
    let is_optional = reader.version.has_optional_limits();
    let [lower, upper] = ["lower", "upper"].map(|name| reader.number(node, name));
    let names = ["effort", "velocity", "acceleration", "deceleration", "jerk"];
    let [effort, velocity, ..] = names.map(|name| {
        let needed = matches!(name, "effort" | "velocity") && !is_optional;
        let value =
            if needed { reader.required_number(node, name) } else { reader.number(node, name) };
        if value.is_some_and(|value| value < 0.0) {
            let found = format!("the limit `{name}` is negative");
            reader.diagnostics.error(span, found, "zero or more", "correct the value");
        }
        value.unwrap_or(f64::INFINITY)
    });
    let has_range = matches!(kind, Some(JointKind::Revolute | JointKind::Prismatic));
    let is_unbounded = !node.has_attribute("lower") && !node.has_attribute("upper");
    if has_range && !is_optional && is_unbounded {
        let found =
            format!("`limit` of the joint {} has neither `lower` nor `upper`", quoted(joint));
        let help = "add them; it is read as unbounded";
        reader.diagnostics.warning(span, found, "the range of the joint", help);
    }
    let least = lower.unwrap_or(0.0);
    let most = upper.unwrap_or(f64::INFINITY);
    if has_range && least > most {
        let found = format!("the lower limit {least} is above the upper limit {most}");
        reader.diagnostics.error(span, found, "lower ≤ upper", "swap them");
    }
    // before version 1.2 a bound that is missing beside another is zero
    let [least, most] = match is_optional || is_unbounded {
        true => [f64::NEG_INFINITY, f64::INFINITY],
        false => [0.0; 2],
    };
    Limits { lower: lower.unwrap_or(least), upper: upper.unwrap_or(most), velocity, effort }
}

fn mimic<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Master> {
    reader.children(node, &MIMIC);
    master(reader, node)
}

/// Reads `joint`, `multiplier` and `offset`, of a mimic or of a transmission.
pub(super) fn master<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Master> {
    let joint = reader.required(node, "joint");
    let [multiplier, offset] = [("multiplier", 1.0), ("offset", 0.0)].map(|(name, default)| {
        match node.attribute_node(name) {
            Some(_) => reader.number(node, name),
            None => Some(default),
        }
    });
    let (joint, span) = joint?;
    Some(Master { joint, span, multiplier: multiplier?, offset: offset? })
}
