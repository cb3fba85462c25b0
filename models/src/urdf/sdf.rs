//! Joints of SDF inside `<gazebo>`: how Gazebo closes a loop that URDF cannot hold.

use roxmltree::Node;
use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::Placement;

use super::closing::{Closing, Named, Place, closing, kind, passive, to_write, unknown};
use super::origin;
use super::xml::{Reader, Shape, child};
use crate::cut::about;
use crate::report::quoted;

const JOINT: Shape = Shape {
    once: "parent child pose axis axis2",
    ignored: "physics sensor",
    ..Shape::of("name type")
};
const AXIS: Shape = Shape {
    once: "xyz use_parent_model_frame dynamics mimic",
    ignored: "limit initial_position",
    ..Shape::of("")
};

/// A joint between two links of the tree. Its frame lies in the child, its axes in this frame; at
/// zero it is the same frame on the parent. So the child is the predecessor of the cut.
pub(super) fn joint<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Closing> {
    let span = reader.span(node);
    let name = reader.required(node, "name");
    let written = reader.required(node, "type");
    let links = ["parent", "child"].map(|end| link(reader, node, end));
    let (name, (written, at)) = (name?.0, written?);
    for axis in reader.children(node, &JOINT) {
        if ["axis", "axis2"].contains(&axis.tag_name().name()) {
            reader.children(axis, &AXIS);
            passive(reader, axis, &name);
        }
    }
    let [Some(parent), Some(own)] = links else { return None };
    let names = [parent.0.as_str(), own.0.as_str()];
    let Some(kind) = kind(&written).filter(|kind| !matches!(kind, CutJoint::Cylindrical { .. }))
    else {
        return unknown(reader, at, &name, &written, names);
    };
    let place = match child(node, "pose") {
        None => Placement::default(),
        Some(pose) => {
            let frame = ["relative_to", "frame"].iter().find_map(|key| pose.attribute(*key));
            if frame.is_some_and(|frame| !frame.is_empty() && frame != own.0) {
                let found = format!("the pose of the joint {} in another frame", quoted(&name));
                let help = to_write(&name, names, Some(&written));
                reader.diagnostics.error(reader.span(pose), found, "a pose in the child", help);
                return None;
            }
            placement(reader, pose)?
        }
    };
    let mut axes = [[0.0, 0.0, 1.0]; 2];
    for (axis, element) in axes.iter_mut().zip(["axis", "axis2"]) {
        let Some(of) = child(node, element) else {
            if element == "axis2" && matches!(kind, CutJoint::Universal { .. }) {
                let found = format!("the universal joint {} has no `axis2`", quoted(&name));
                let help = to_write(&name, names, Some("universal, axis: […], axis2: […]"));
                return reader.diagnostics.refused(span, found, "two axes", help);
            }
            continue;
        };
        let Some(xyz) = child(of, "xyz") else { continue };
        let frame = xyz.attribute("expressed_in").unwrap_or_default();
        let is_model = child(of, "use_parent_model_frame")
            .and_then(|node| node.text())
            .is_some_and(|text| matches!(text.trim(), "1" | "true"));
        let is_child = frame == own.0 && place.rpy == [0.0; 3];
        if is_model || !(frame.is_empty() || frame == name || is_child) {
            let found = format!("an axis of the joint {} in another frame", quoted(&name));
            let help = to_write(&name, names, Some(&written));
            reader.diagnostics.error(reader.span(xyz), found, "an axis in the joint's", help);
            return None;
        }
        *axis = reader.numbers_of_text::<3>(xyz)?;
    }
    // the second axis belongs to the child, which is the predecessor
    let [axis, axis2] =
        if matches!(kind, CutJoint::Universal { .. }) { [axes[1], axes[0]] } else { axes };
    let links = [own, parent];
    let place = Place::Predecessor(place);
    let joint = about(kind, axis, axis2);
    closing(reader, Closing { name, is_unnamed: false, span, links, place, joint }, axes)
}

/// The pose of a `<pose>`, in radians, degrees or with a quaternion; `None` after an error.
fn placement<'t>(reader: &mut Reader<'t, '_>, pose: Node<'_, 't>) -> Option<Placement> {
    let in_degrees = match pose.attribute("degrees").unwrap_or("false") {
        "true" | "1" => true,
        "false" | "0" => false,
        other => {
            let found = format!("`degrees` of `pose` is {}", quoted(other));
            reader.diagnostics.error(reader.span(pose), found, "true or false", "correct it");
            return None;
        }
    };
    match pose.attribute("rotation_format").unwrap_or("euler_rpy") {
        "euler_rpy" => {
            let [x, y, z, angles @ ..] = reader.numbers_of_text::<6>(pose)?;
            let rpy = if in_degrees { angles.map(f64::to_radians) } else { angles };
            Some(Placement { xyz: [x, y, z], rpy })
        }
        "quat_xyzw" if !in_degrees => {
            let [x, y, z, quaternion @ ..] = reader.numbers_of_text::<7>(pose)?;
            Some(Placement { xyz: [x, y, z], rpy: origin::turned(reader, pose, quaternion)? })
        }
        format => {
            let found = format!("the rotation format {} of `pose`", quoted(format));
            let expected = "euler_rpy, or quat_xyzw without degrees";
            reader.diagnostics.refused(reader.span(pose), found, expected, "correct it")
        }
    }
}

/// The link that an end names, without the name of its model.
fn link<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>, end: &str) -> Option<Named> {
    let found = child(node, end);
    let text = found.and_then(|end| end.text()).unwrap_or_default().trim();
    let name = text.rsplit("::").next().unwrap_or_default();
    let span = reader.span(found.unwrap_or(node));
    if name.is_empty() {
        let what = format!("the joint inside `gazebo` has no `{end}`");
        return reader.diagnostics.refused(span, what, format!("<{end}>LINK</{end}>"), "add it");
    }
    Some((name.to_owned(), span))
}
