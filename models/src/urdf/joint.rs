//! Joints: type, links, axis, limits, couplings.

use roxmltree::Node;
use sarrus_dynamics::description::{JointKind, Terms};

use super::compound::{Compound, Part};
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
    (BALL, JointKind::Spherical),
    (PLANAR, JointKind::Floating),
    (UNIVERSAL, JointKind::Continuous),
];

/// Another name of `spherical`, which urdf-rs does not know.
const BALL: &str = "ball";
/// Joints of several axes; urdf-rs does not know the second.
const PLANAR: &str = "planar";
const UNIVERSAL: &str = "universal";

/// A joint as written.
pub(crate) struct JointEntry {
    /// Empty when it is missing, which has been reported.
    pub(crate) name: String,
    pub(crate) span: Span,
    /// `None` when the type is not known, which has been reported.
    pub(crate) kind: Option<JointKind>,
    /// The chain that replaces a joint of several axes.
    pub(super) compound: Option<Compound>,
    /// Which part of a chain the joint is.
    pub(crate) part: Option<Part>,
    /// Index of the joint in the file.
    pub(crate) source: usize,
    pub(crate) parent: Option<(String, Span)>,
    pub(crate) child: Option<(String, Span)>,
    pub(crate) has_limits: bool,
    /// Whether the limits define a range; without `lower` and `upper` they do not.
    pub(crate) has_range: bool,
    pub(crate) masters: Vec<Master>,
    pub(crate) terms: Terms,
    /// `independent` of URDF+, of a joint in a loop.
    pub(crate) independent: Option<bool>,
}

/// One term of a coupling.
#[derive(Clone, Debug)]
pub(crate) struct Master {
    pub(crate) joint: String,
    pub(crate) span: Span,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

pub(super) fn read<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    source: usize,
) -> JointEntry {
    let span = reader.span(node);
    let name = reader.required(node, "name").map(|(name, _)| name).unwrap_or_default();
    let kind =
        reader.required(node, "type").and_then(|(written, span)| kind_of(reader, &written, span));
    let is_planar = node.attribute("type") == Some(PLANAR);
    replace_type(reader, node);
    let children = reader.children(node, &JOINT);
    let find = |name: &str| children.iter().copied().find(|child| child.has_tag_name(name));
    if let Some(node) = find("origin") {
        origin(reader, node);
    }
    let [parent, child] = ["parent", "child"].map(|end| link(reader, span, end, find(end)));
    let motion = if is_planar { Some(JointKind::Continuous) } else { kind };
    let first = find("axis").and_then(|node| axis(reader, node, motion, &name));
    let compound = compound(reader, node, &name, first.unwrap_or([1.0, 0.0, 0.0]), find("axis2"));
    let limit_node = find("limit");
    match limit_node {
        Some(node) => limit(reader, node, kind.filter(|_| !is_planar), &name),
        None => without_limits(reader, span, kind, &name),
    }
    let terms =
        find("dynamics").map(|node| dynamics::read(reader, node, kind, &name)).unwrap_or_default();
    let masters = find("mimic").and_then(|node| mimic(reader, node)).into_iter().collect();
    let has_range =
        limit_node.is_some_and(|node| node.has_attribute("lower") || node.has_attribute("upper"));
    let has_limits = limit_node.is_some();
    let independent = independent(reader, node);
    JointEntry {
        name,
        span,
        kind,
        independent,
        compound,
        part: None,
        source,
        parent,
        child,
        has_limits,
        has_range,
        masters,
        terms,
    }
}

/// Replaces a type that urdf-rs does not know in the text for urdf-rs.
fn replace_type<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) {
    let Some(attribute) = node.attribute_node("type") else { return };
    let known = match attribute.value() {
        BALL => "spherical",
        UNIVERSAL => "floating",
        _ => return,
    };
    reader.replaced.push((attribute.range_value(), known));
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
    let second = axis2.and_then(|node| {
        reader.unread.push(node.range());
        axis(reader, node, Some(JointKind::Continuous), name)
    });
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

/// Checks an origin, of a joint or of an inertial.
pub(super) fn origin<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) {
    reader.children(node, &ORIGIN);
    reader.numbers::<3>(node, "xyz");
    reader.numbers::<3>(node, "rpy");
    let Some(quaternion) = reader.numbers::<4>(node, "quat_xyzw") else { return };
    let span = reader.span(node);
    if !reader.version.has_quaternions() {
        let found = "`quat_xyzw` in a file of version 1.0";
        let help = "write version=\"1.1\" on `robot` or use `rpy`";
        return reader.diagnostics.error(span, found, "`rpy`", help);
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

/// Checks an axis; its direction where the joint moves along or about it.
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
    let axis = reader.numbers::<3>(node, "xyz").filter(|_| moves);
    if let Some(axis) = axis {
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
) {
    reader.children(node, &LIMIT);
    let span = reader.span(node);
    let [lower, upper] = ["lower", "upper"].map(|name| reader.number(node, name));
    for name in ["effort", "velocity", "acceleration", "deceleration", "jerk"] {
        let needed = matches!(name, "effort" | "velocity") && !reader.version.has_optional_limits();
        let value =
            if needed { reader.required_number(node, name) } else { reader.number(node, name) };
        if value.is_some_and(|value| value < 0.0) {
            let found = format!("the limit `{name}` is negative");
            reader.diagnostics.error(span, found, "zero or more", "correct the value");
        }
    }
    let has_range = matches!(kind, Some(JointKind::Revolute | JointKind::Prismatic));
    if has_range
        && !reader.version.has_optional_limits()
        && !node.has_attribute("lower")
        && !node.has_attribute("upper")
    {
        let found =
            format!("`limit` of the joint {} has neither `lower` nor `upper`", quoted(joint));
        let help = "add them; it is read as unbounded";
        reader.diagnostics.warning(span, found, "the range of the joint", help);
    }
    let lower = lower.unwrap_or(0.0);
    let upper = upper.unwrap_or(f64::INFINITY);
    if has_range && lower > upper {
        let found = format!("the lower limit {lower} is above the upper limit {upper}");
        reader.diagnostics.error(span, found, "lower ≤ upper", "swap them");
    }
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
