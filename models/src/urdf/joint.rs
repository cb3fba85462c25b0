//! Joints: type, links, axis, limits, couplings.

use roxmltree::Node;
use sarrus_dynamics::description::{Curve, JointKind, Limits, Motor, Placement, Terms};

use super::compound::Compound;
use super::dynamics;
use super::origin::origin;
use super::xml::{Reader, Shape};
use crate::number;
use crate::report::{Span, quoted};
use crate::rotation::dot;

const JOINT: Shape = Shape {
    once: "origin parent child axis axis2 limit mimic dynamics",
    ignored: "calibration safety_controller hardwareInterface joint_properties sensor gazebo",
    ..Shape::of("name type independent")
};
const REFERENCE: Shape = Shape::of("link");
const AXIS: Shape = Shape::of("xyz");
const LIMIT: Shape = Shape::of("lower upper effort velocity acceleration deceleration jerk");
const MIMIC: Shape = Shape::of("joint multiplier offset");

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

/// Another name of `spherical`.
const BALL: &str = "ball";
/// Joints of several axes.
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
    pub(crate) parent: Option<(String, Span)>,
    pub(crate) child: Option<(String, Span)>,
    pub(crate) origin: Placement,
    pub(crate) axis: [f64; 3],
    /// Of the position without bounds where the file gives no range.
    pub(crate) limits: Option<Limits>,
    pub(crate) masters: Vec<Master>,
    pub(crate) terms: Terms,
    /// Of a submechanism file.
    pub(crate) motor: Option<Motor>,
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
    /// In place of the multiplier.
    pub(crate) curve: Option<Curve>,
}

pub(super) fn read<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> JointEntry {
    let span = reader.span(node);
    let name = reader.required(node, "name").map(|(name, _)| name).unwrap_or_default();
    let kind =
        reader.required(node, "type").and_then(|(written, span)| kind_of(reader, &written, span));
    let is_planar = node.attribute("type") == Some(PLANAR);
    let children = reader.children(node, &JOINT);
    let find = |name: &str| children.iter().copied().find(|child| child.has_tag_name(name));
    let origin = find("origin").and_then(|node| origin(reader, node)).unwrap_or_default();
    let [parent, child] = ["parent", "child"].map(|end| link(reader, span, end, find(end)));
    let motion = if is_planar { Some(JointKind::Continuous) } else { kind };
    let first = find("axis").and_then(|node| axis(reader, node, motion, &name));
    let axis = first.unwrap_or([1.0, 0.0, 0.0]);
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
        parent,
        child,
        origin,
        axis,
        limits,
        masters,
        terms,
        motor: None,
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
        return reader.diagnostics.refused(joint, found, format!("<{end} link=\"…\"/>"), "add it");
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
    let span = reader.span(axis2.unwrap_or(joint));
    if joint.attribute("type") != Some(UNIVERSAL) {
        if axis2.is_some() {
            let found = format!("`axis2` of the joint {}, which has one axis", quoted(name));
            reader.diagnostics.error(span, found, "the type `universal`", "remove it");
        }
        return (joint.attribute("type") == Some(PLANAR)).then_some(Compound::Planar);
    }
    if axis2.is_none() {
        let found = format!("the universal joint {} has no `axis2`", quoted(name));
        return reader.diagnostics.refused(span, found, "<axis2 xyz=\"…\"/>", "add it");
    }
    let axis2 = second?;
    let cosine = dot(first, axis2) / (dot(first, first) * dot(axis2, axis2)).sqrt();
    if cosine.abs() > 1.0 - 1e-6 {
        let found = format!("the axes of the universal joint {} are parallel", quoted(name));
        let span = reader.span(joint);
        reader.diagnostics.error(span, found, "two directions", "correct one of them");
    }
    Some(Compound::Universal { axis2 })
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
            reader.diagnostics.refused(at, found, "true or false", "correct it")
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

/// Reads an axis, and checks its direction. A joint that has none is not refused for a fault in
/// it.
fn axis<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    kind: Option<JointKind>,
    joint: &str,
) -> Option<[f64; 3]> {
    reader.children(node, &AXIS);
    let span = reader.span(node);
    let expected = "a direction as 0 0 1";
    if matches!(kind, Some(JointKind::Fixed | JointKind::Floating | JointKind::Spherical)) {
        let written = node.attribute("xyz")?;
        let axis = number::numbers(written);
        if let Err(fault) = &axis {
            let found =
                format!("`xyz` of `axis`, which the joint {} lacks: {fault}", quoted(joint));
            let help = "remove it; it is not read";
            reader.diagnostics.warning(span, found, number::expected(3), help);
        }
        return axis.ok();
    }
    if !node.has_attribute("xyz") {
        reader.diagnostics.error(span, "`axis` has no `xyz`", expected, "add it");
    }
    let axis = reader.numbers::<3>(node, "xyz");
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
) -> Limits {
    reader.children(node, &LIMIT);
    let span = reader.span(node);
    let is_optional = reader.version.has_optional_limits();
    let has_bound = node.has_attribute("lower") || node.has_attribute("upper");
    let is_bounded = has_bound && !is_optional;
    let absent = if is_bounded { [0.0; 2] } else { [f64::NEG_INFINITY, f64::INFINITY] };
    let lower = reader.number(node, "lower").unwrap_or(absent[0]);
    let upper = reader.number(node, "upper").unwrap_or(absent[1]);
    let names = ["effort", "velocity", "acceleration", "deceleration", "jerk"];
    let [effort, velocity, ..] = names.map(|name| {
        let needed = matches!(name, "effort" | "velocity") && !is_optional;
        let value =
            if needed { reader.required_number(node, name) } else { reader.number(node, name) };
        let found = format!("the limit `{name}` is {}", value.unwrap_or_default());
        match value {
            // many files write −1 for none
            Some(-1.0) => {
                let help = "remove it or correct it; it is read as unbounded";
                reader.diagnostics.warning(span, found, "zero or more", help);
                f64::INFINITY
            }
            Some(value) if value < 0.0 => {
                reader.diagnostics.error(span, found, "zero or more", "correct the value");
                value
            }
            value => value.unwrap_or(f64::INFINITY),
        }
    });
    let has_range = matches!(kind, Some(JointKind::Revolute | JointKind::Prismatic));
    if has_range && !is_optional && !has_bound {
        let found =
            format!("`limit` of the joint {} has neither `lower` nor `upper`", quoted(joint));
        let help = "add them; it is read as unbounded";
        reader.diagnostics.warning(span, found, "the range of the joint", help);
    }
    if has_range && lower > upper {
        let found = format!("the lower limit {lower} is above the upper limit {upper}");
        reader.diagnostics.error(span, found, "lower ≤ upper", "swap them");
    }
    Limits { lower, upper, velocity, effort }
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
    Some(Master { joint, span, multiplier: multiplier?, offset: offset?, curve: None })
}
