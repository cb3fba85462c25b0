//! Loops in the URDF, in the elements of other programs, as cuts:
//!
//! | element | of | cut frames |
//! |---|---|---|
//! | `<gazebo><joint>` | SDF inside Gazebo's extension | that of the joint, given in the child |
//! | `<loop>` | URDF+ | `origin` of `predecessor` and of `successor` |
//! | `<loop_joint>` | Isaac Sim: `link1`, `link2`; exporters: `parent`, `child` | both are given |
//! | `<constraint>` | proposed for urdfdom | `parent_origin` and `child_origin` |
//! | `<drake:ball_constraint>` | Drake | the points of both bodies |
//!
//! An incomplete loop is an error with the lines to write into the submechanism file.

use std::collections::BTreeSet;

use roxmltree::Node;
use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::Placement;

use super::origin::placement;
use super::sdf;
use super::xml::{Reader, Shape, child, drake};
use crate::cut::{about, n_axes, named};
use crate::report::{Diagnostics, Span, quoted};

/// A name and its position.
pub(super) type Named = (String, Span);

/// A loop as a cut between two links.
pub(crate) struct Closing {
    pub(crate) name: String,
    /// The links' names form its name.
    pub(crate) is_unnamed: bool,
    pub(crate) span: Span,
    /// Predecessor and successor.
    pub(crate) links: [Named; 2],
    pub(crate) place: Place,
    pub(crate) joint: CutJoint,
}

/// The positions of the two cut frames.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// On both links.
    Both([Placement; 2]),
    /// On the predecessor; on the successor it is the same frame at zero.
    Predecessor(Placement),
    /// As before; on the successor at this point, with the orientation of that frame.
    Point(Placement, [f64; 3]),
    /// As before; at zero this axis in the predecessor's cut frame is that in the frame given on
    /// the successor, and the loop is open where they differ.
    Axes([Placement; 2], [[f64; 3]; 2]),
}

/// `<loop>`, `<loop_joint>` and `<constraint>`.
const ELEMENT: Shape = Shape {
    many: "predecessor successor sucessor parent child link1 link2 parent_origin child_origin \
        axis axis2 parent_axis child_axis dynamics",
    ..Shape::of("name type")
};

/// The cut joint of a joint type.
pub(super) fn kind(written: &str) -> Option<CutJoint> {
    match written {
        "continuous" | "hinge" => named("revolute"),
        "ball" => named("spherical"),
        "fixed" => named("weld"),
        _ => named(written),
    }
}

/// The loops of one element of the robot.
pub(super) fn read<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Vec<Closing> {
    let closing = match (drake(node), node.tag_name().name()) {
        (Some(name), _) => drake_constraint(reader, node, name),
        (_, "gazebo") => {
            let joints = node.children().filter(|child| child.has_tag_name("joint"));
            let joints: Vec<Node<'_, 't>> = joints.collect();
            return joints.into_iter().filter_map(|joint| sdf::joint(reader, joint)).collect();
        }
        _ => element(reader, node),
    };
    Vec::from_iter(closing)
}

/// The joints that the file declares actuated: those of transmissions with an actuator, and those
/// that ros2_control commands.
pub(super) fn actuated(root: Node<'_, '_>) -> BTreeSet<String> {
    let has = |node: Node<'_, '_>, name: &str| node.children().any(|of| of.has_tag_name(name));
    let groups = root.children().filter(|node| {
        node.has_tag_name("ros2_control")
            || (node.has_tag_name("transmission") && has(*node, "actuator"))
    });
    let joints = groups.flat_map(|group| {
        let is_commanded = group.has_tag_name("ros2_control");
        group
            .children()
            .filter(move |node| node.has_tag_name("joint"))
            .filter(move |node| !is_commanded || has(*node, "command_interface"))
    });
    joints.filter_map(|joint| joint.attribute("name").map(str::to_owned)).collect()
}

/// `<loop>`, `<loop_joint>`, `<constraint>`: two links with origins, a type, an axis or two.
fn element<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Closing> {
    let span = reader.span(node);
    let name = reader.required(node, "name");
    let written = reader.required(node, "type");
    reader.children(node, &ELEMENT);
    passive(reader, node, node.attribute("name").unwrap_or_default());
    let child = |names: &[&str]| {
        node.children().find(|child| names.contains(&child.tag_name().name()) && child.is_element())
    };
    // one exporter writes `link1` twice, another `sucessor`
    let mut ends = node.children().filter(|child| {
        let names = ["predecessor", "successor", "sucessor", "parent", "child", "link1", "link2"];
        names.contains(&child.tag_name().name()) && child.is_element()
    });
    let three = std::array::from_fn(|_| ends.next());
    let [Some(first), Some(second), None] = three else {
        let found = format!("`{}` does not name two links", node.tag_name().name());
        let help = to_write(&name.map(|(name, _)| name).unwrap_or_default(), ["A", "B"], None);
        return reader.diagnostics.refused(span, found, "a link at each end", help);
    };
    let links = [first, second].map(|end| link(reader, end));
    let origins = [(first, "parent_origin"), (second, "child_origin")].map(|(end, beside)| {
        let beside = child(&[beside]);
        let inside = end.children().find(|inner| inner.has_tag_name("origin"));
        placement(reader, beside.or(inside).unwrap_or(end))
    });
    let axes = [["axis", "parent_axis"], ["axis2", "child_axis"]].map(|names| child(&names));
    let [axis, axis2] = axes.map(|axis| axis.map(|node| reader.numbers::<3>(node, "xyz")));
    let (name, (written, at)) = (name?.0, written?);
    let [Some(first), Some(second)] = links else { return None };
    let links = [first, second];
    let names = [links[0].0.as_str(), links[1].0.as_str()];
    let Some(kind) = kind(&written) else {
        return unknown(reader, at, &name, &written, names);
    };
    let [first, second] = [origins[0]?, origins[1]?];
    let in_parent = axes[0].is_some_and(|axis| axis.attribute("frame") == Some("parent"));
    let place = match in_parent {
        // an axis in the parent equals one in the cut frame if that is not rotated
        true if first.rpy == [0.0; 3] => Place::Point(first, second.xyz),
        true => {
            let found = format!("the axis of the loop {} in a turned frame", quoted(&name));
            let help = to_write(&name, names, Some(&written));
            return reader.diagnostics.refused(span, found, "an axis in the cut frame", help);
        }
        false => Place::Both([first, second]),
    };
    let axis = match axis {
        Some(axis) => axis?,
        None => [1.0, 0.0, 0.0],
    };
    let place = match (axis2, n_axes(kind), child(&["child_axis"])) {
        (Some(own), 1, Some(_)) => Place::Axes([first, second], [axis, own?]),
        _ => place,
    };
    let axis2 = match axis2 {
        Some(axis2) => axis2?,
        None if matches!(kind, CutJoint::Universal { .. }) => {
            let found = format!("the universal loop {} has one axis", quoted(&name));
            let help = to_write(&name, names, Some("universal, axis: […], axis2: […]"));
            return reader.diagnostics.refused(span, found, "two axes", help);
        }
        None => [0.0, 1.0, 0.0],
    };
    let joint = about(kind, axis, axis2);
    closing(reader, Closing { name, is_unnamed: false, span, links, place, joint }, [axis, axis2])
}

/// `<drake:ball_constraint>`; other constraints of Drake are errors with the lines to write.
fn drake_constraint<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    element: &str,
) -> Option<Closing> {
    let span = reader.span(node);
    let child =
        |name: &str| node.children().find(|child| drake(*child).is_some_and(|of| of == name));
    if element != "ball_constraint" {
        let found = format!("{} is not read", quoted(&format!("drake:{element}")));
        let help = to_write(element, ["A", "B"], None);
        return reader.diagnostics.refused(span, found, "drake:ball_constraint, or a cut", help);
    }
    let ends = [["body_A", "p_AP"], ["body_B", "p_BQ"]].map(|names| {
        let [body, point] = names.map(|name| child(&format!("ball_constraint_{name}")));
        let body = body.and_then(|body| reader.required(body, "name"));
        let point = point.map_or(Some([0.0; 3]), |point| reader.numbers::<3>(point, "value"));
        Some((body?, Placement { xyz: point?, rpy: [0.0; 3] }))
    });
    let [Some((first, at_first)), Some((second, at_second))] = ends else {
        let found = "`drake:ball_constraint` does not name two bodies and points";
        let help = to_write(element, ["A", "B"], Some("spherical"));
        return reader.diagnostics.refused(span, found, "a body and a point at each end", help);
    };
    let name =
        node.attribute("name").map_or_else(|| format!("{}_{}", first.0, second.0), Into::into);
    Some(Closing {
        name,
        is_unnamed: !node.has_attribute("name"),
        span,
        links: [first, second],
        place: Place::Both([at_first, at_second]),
        joint: CutJoint::Spherical,
    })
}

/// A loop whose axes are directions; `None` after an error.
pub(super) fn closing(
    reader: &mut Reader<'_, '_>,
    closing: Closing,
    axes: [[f64; 3]; 2],
) -> Option<Closing> {
    let bad = axes.into_iter().find(|axis| {
        let size = axis.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        !(1e-50..=1e50).contains(&size)
    });
    if bad.is_some() {
        let found = format!("an axis of the loop {} has no direction", quoted(&closing.name));
        let expected = "a direction as 0 0 1";
        return reader.diagnostics.refused(closing.span, found, expected, "correct it");
    }
    Some(closing)
}

/// Reports damping, a spring, a rotor or a coupling of a closing joint: a cut has none of them.
pub(super) fn passive<'t>(reader: &mut Reader<'t, '_>, joint: Node<'_, 't>, name: &str) {
    const TERMS: [&str; 4] = ["damping", "spring_stiffness", "rotor_inertia", "friction"];
    let joint_of = format!("the closing joint {}", quoted(name));
    if let Some(mimic) = child(joint, "mimic") {
        let found = format!("{joint_of} is coupled, which a cut is not");
        let help = "cut the loop at another joint, or remove the coupling";
        reader.diagnostics.dynamics(reader.span(mimic), found, "a joint of the tree", help);
    }
    for dynamics in joint.children().filter(|node| node.has_tag_name("dynamics")) {
        let mut value = |term: &str| match child(dynamics, term) {
            Some(node) => reader.numbers_of_text(node).map(|[number]| number),
            None => reader.number(dynamics, term),
        };
        let terms: Vec<&str> =
            TERMS.into_iter().filter(|term| value(term).is_some_and(|of| of != 0.0)).collect();
        let span = reader.span(dynamics);
        match &terms[..] {
            [] => {}
            ["friction"] => {
                let found = format!("{joint_of} has dry friction, which is not modelled");
                reader.diagnostics.warning(span, found, "none", "remove it");
            }
            terms => {
                let found = format!("{joint_of} has {}, which a cut cannot have", terms.join(", "));
                let help = "cut the loop at another joint, so that this one is in the tree";
                reader.diagnostics.dynamics(span, found, "a joint of the tree", help);
            }
        }
    }
}

/// Reports the actuators of closing joints.
pub(super) fn driven(closings: &[Closing], actuated: &BTreeSet<String>, of: &mut Diagnostics) {
    for closing in closings.iter().filter(|closing| actuated.contains(&closing.name)) {
        let joint = quoted(&closing.name);
        let found = format!("the closing joint {joint} has an actuator, which a cut cannot have");
        let help = "cut the loop at another joint, so that this one is in the tree";
        of.dynamics(closing.span, found, "a joint of the tree", help);
    }
}

/// Reports a type without a cut joint.
pub(super) fn unknown<T>(
    reader: &mut Reader<'_, '_>,
    at: Span,
    name: &str,
    written: &str,
    links: [&str; 2],
) -> Option<T> {
    let found = format!("the loop {} of type {}", quoted(name), quoted(written));
    const TYPES: &str = "revolute continuous spherical ball fixed prismatic cylindrical universal";
    let expected: Vec<&str> = TYPES.split(' ').filter(|of| *of != written).collect();
    let help = match written {
        "screw" | "gearbox" => "write what ties its joints as <mimic joint multiplier/> into the \
            one that follows"
            .to_owned(),
        _ => to_write(name, links, None),
    };
    reader.diagnostics.refused(at, found, expected.join(", "), help)
}

/// The lines of the submechanism file that replace a loop that is not read.
pub(super) fn to_write(name: &str, links: [&str; 2], kind: Option<&str>) -> String {
    let [a, b] = links;
    let kind = kind.unwrap_or("…");
    format!(
        "write it as a loop of the submechanism file: loop_constraints: [{{cut_joint: {name}, \
         predecessor_body: {a}, successor_body: {b}, cut_joint_type: {kind}}}]"
    )
}

/// The link that an end names.
fn link<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Named> {
    let is_name = node.has_attribute("name") && !node.has_attribute("link");
    reader.required(node, if is_name { "name" } else { "link" })
}
