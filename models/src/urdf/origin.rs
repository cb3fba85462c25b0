//! Origins: a translation with roll, pitch and yaw, or with a quaternion.

use roxmltree::Node;
use sarrus_dynamics::description::Placement;

use super::xml::{Reader, Shape};
use crate::rotation;

const ORIGIN: Shape = Shape::of("xyz rpy quat_xyzw");

/// Deviations of a quaternion's length from 1: that of rounding, and that of a coarse file.
const ROUNDED: f64 = 1e-6;
const COARSE: f64 = 1e-3;

/// Reads an origin, of a joint or of an inertial; `None` after an error.
pub(super) fn origin<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Placement> {
    reader.children(node, &ORIGIN);
    placement(reader, node)
}

/// `xyz` and `rpy` or `quat_xyzw` of an element, zero without; `None` after an error.
pub(super) fn placement<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Placement> {
    let [xyz, rpy] = ["xyz", "rpy"].map(|name| match node.has_attribute(name) {
        true => reader.numbers::<3>(node, name),
        false => Some([0.0; 3]),
    });
    if !node.has_attribute("quat_xyzw") {
        return Some(Placement { xyz: xyz?, rpy: rpy? });
    }
    let quaternion = reader.numbers::<4>(node, "quat_xyzw")?;
    let span = reader.span(node);
    if !reader.version.has_quaternions() {
        let found = "`quat_xyzw` in a file of version 1.0";
        let help = "write version=\"1.1\" on `robot` or use `rpy`";
        return reader.diagnostics.refused(span, found, "`rpy`", help);
    }
    if node.has_attribute("rpy") {
        let found = format!("`{}` has both `rpy` and `quat_xyzw`", node.tag_name().name());
        reader.diagnostics.error(span, found, "one of them", "remove the other");
    }
    let rpy = turned(reader, node, quaternion)?;
    Some(Placement { xyz: xyz?, rpy })
}

/// Roll, pitch and yaw of a quaternion x, y, z, w near unit length; `None` after an error.
pub(super) fn turned<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    quaternion: [f64; 4],
) -> Option<[f64; 3]> {
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    let span = reader.span(node);
    let found = format!("the quaternion of `{}` has the length {length}", node.tag_name().name());
    if (length - 1.0).abs() >= COARSE {
        return reader.diagnostics.refused(span, found, "1", "normalise it");
    }
    if (length - 1.0).abs() > ROUNDED {
        let help = "write more digits; it is read as a direction, normalised";
        reader.diagnostics.warning(span, found, "1", help);
    }
    Some(rotation::rpy(quaternion))
}
