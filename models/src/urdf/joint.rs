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
const ORIGIN: Shape =
    Shape { attributes: &["xyz", "rpy", "quat_xyzw"], once: &[], many: &[], ignored: &[] };
const REFERENCE: Shape = Shape { attributes: &["link"], once: &[], many: &[], ignored: &[] };
const AXIS: Shape = Shape { attributes: &["xyz"], once: &[], many: &[], ignored: &[] };
const LIMIT: Shape = Shape {
    attributes: &["lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"],
    once: &[],
    many: &[],
    ignored: &[],
};
const MIMIC: Shape =
    Shape { attributes: &["joint", "multiplier", "offset"], once: &[], many: &[], ignored: &[] };

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

/// A joint as it stands in the file.
pub(crate) struct JointEntry {
    /// Empty when it is missing, which has been reported.
    pub(crate) name: String,
    pub(crate) span: Span,
    /// `None` when the type is not known, which has been reported.
    pub(crate) kind: Option<JointKind>,
    /// What a joint of several axes is, until it is a chain of parts.
    pub(super) compound: Option<Compound>,
    /// Which part of a chain the joint is.
    pub(crate) part: Option<Part>,
    /// Index of the joint in the file.
    pub(crate) source: usize,
    pub(crate) parent: Option<(String, Span)>,
    pub(crate) child: Option<(String, Span)>,
    pub(crate) has_limits: bool,
    /// Whether the limits hold a range: without `lower` and `upper` there is none.
    pub(crate) has_range: bool,
    pub(crate) masters: Vec<Master>,
    pub(crate) terms: Terms,
    /// What URDF+ says about the coordinate of a joint in a loop.
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
    let is = |written: &str| node.attribute("type") == Some(written);
    for (written, known) in [(BALL, "spherical"), (UNIVERSAL, "floating")] {
        if let Some(attribute) = node.attribute_node("type").filter(|_| is(written)) {
            reader.replaced.push((attribute.range_value(), known));
        }
    }
    let children = reader.children(node, &JOINT);
    let find = |name: &str| children.iter().copied().find(|child| child.has_tag_name(name));
    if let Some(node) = find("origin") {
        origin(reader, node);
    }
    let [parent, child] = ["parent", "child"].map(|end| match find(end) {
        Some(node) => {
            reader.children(node, &REFERENCE);
            reader.required(node, "link")
        }
        None => {
            reader.diagnostics.error(
                span,
                format!("the joint has no `{end}`"),
                format!("<{end} link=\"…\"/>"),
                "add it",
            );
            None
        }
    });
    let first = find("axis").and_then(|axis_node| {
        let kind = if is(PLANAR) { Some(JointKind::Continuous) } else { kind };
        axis(reader, axis_node, kind, &name)
    });
    let second = find("axis2");
    let axis2 = second.and_then(|node| {
        reader.unread.push(node.range());
        axis(reader, node, Some(JointKind::Continuous), &name)
    });
    let compound = if is(PLANAR) {
        Some(Compound::Planar)
    } else if is(UNIVERSAL) {
        universal(reader, span, &name, first.unwrap_or([1.0, 0.0, 0.0]), axis2, second.is_some())
    } else {
        None
    };
    if let Some(node) = second.filter(|_| !is(UNIVERSAL)) {
        let found = format!("`axis2` of the joint {}, which has one axis", quoted(&name));
        let span = reader.span(node);
        reader.diagnostics.error(span, found, "the type `universal`", "remove it");
    }
    let limit_node = find("limit");
    match limit_node {
        Some(node) => limit(reader, node, kind.filter(|_| !is(PLANAR)), &name),
        None if matches!(kind, Some(JointKind::Revolute | JointKind::Prismatic)) => {
            let what = if kind == Some(JointKind::Revolute) { "revolute" } else { "prismatic" };
            let found = format!("the {what} joint {} has no limits", quoted(&name));
            let help = if what == "revolute" {
                "add them, or make the joint continuous"
            } else {
                "add them"
            };
            reader.diagnostics.error(
                span,
                found,
                "<limit lower=\"…\" upper=\"…\" effort=\"…\" velocity=\"…\"/>",
                help,
            );
        }
        None => {}
    }
    let terms =
        find("dynamics").map(|node| dynamics::read(reader, node, kind, &name)).unwrap_or_default();
    let masters = find("mimic").and_then(|node| mimic(reader, node)).into_iter().collect();
    let has_range =
        limit_node.is_some_and(|node| node.has_attribute("lower") || node.has_attribute("upper"));
    let has_limits = limit_node.is_some();
    let independent = node.attribute_node("independent").and_then(|written| {
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
    });
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

fn kind_of(reader: &mut Reader<'_, '_>, written: &str, span: Span) -> Option<JointKind> {
    let names = TYPES.map(|(name, _)| name);
    let kind = TYPES.into_iter().find(|(name, _)| *name == written).map(|(_, kind)| kind);
    if kind.is_none() {
        let help = reader.diagnostics.did_you_mean(written, names, "choose one of them");
        let found = format!("the joint type {} is not known", quoted(written));
        reader.diagnostics.error(span, found, names.join(", "), help);
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
        let help = "write version=\"1.1\" on `robot` or use `rpy`";
        return reader.diagnostics.error(
            span,
            "`quat_xyzw` in a file of version 1.0",
            "`rpy`",
            help,
        );
    }
    if node.has_attribute("rpy") {
        reader.diagnostics.error(
            span,
            "`origin` has both `rpy` and `quat_xyzw`",
            "one of them",
            "remove the other",
        );
    }
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() >= 1e-3 {
        reader.diagnostics.error(
            span,
            format!("the quaternion of `origin` has the length {length}"),
            "1",
            "normalise it",
        );
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
    if node.attribute_node("xyz").is_none() {
        reader.diagnostics.error(
            reader.span(node),
            "`axis` has no `xyz`",
            "a direction as 0 0 1",
            "add it",
        );
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
            reader.diagnostics.error(
                reader.span(node),
                found,
                "a direction as 0 0 1",
                "correct it",
            );
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
    let [lower, upper] =
        ["lower", "upper"].map(|name| reader.numbers::<1>(node, name).map(|[number]| number));
    for name in ["effort", "velocity", "acceleration", "deceleration", "jerk"] {
        let needed = matches!(name, "effort" | "velocity") && !reader.version.has_optional_limits();
        let value = if needed {
            reader.required_number(node, name)
        } else {
            reader.numbers::<1>(node, name).map(|[number]| number)
        };
        if value.is_some_and(|value| value < 0.0) {
            reader.diagnostics.error(
                span,
                format!("the limit `{name}` is negative"),
                "zero or more",
                "correct the value",
            );
        }
    }
    let has_range = matches!(kind, Some(JointKind::Revolute | JointKind::Prismatic));
    if has_range
        && !reader.version.has_optional_limits()
        && !node.has_attribute("lower")
        && !node.has_attribute("upper")
    {
        reader.diagnostics.warning(
            span,
            format!("`limit` of the joint {} has neither `lower` nor `upper`", quoted(joint)),
            "the range of the joint",
            "add them; it is read as unbounded",
        );
    }
    let (lower, upper) = (lower.unwrap_or(0.0), upper.unwrap_or(f64::INFINITY));
    if has_range && lower > upper {
        reader.diagnostics.error(
            span,
            format!("the lower limit {lower} is above the upper limit {upper}"),
            "lower ≤ upper",
            "swap them",
        );
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
            Some(_) => reader.numbers::<1>(node, name).map(|[number]| number),
            None => Some(default),
        }
    });
    let (joint, span) = joint?;
    Some(Master { joint, span, multiplier: multiplier?, offset: offset? })
}
