//! Attributes of joints, by position.

use roxmltree::{Document, Node};
use sarrus_dynamics::description::{Curve, Joint};

use super::{Edit, NewZero, is_named, list, number};
use crate::report::Diagnostics;
use crate::text::Text;
use crate::urdf::child;

/// The replacements that make the new zero pose that of the URDF.
pub(super) fn edits(text: &str, zero: &NewZero) -> Result<Vec<Edit>, String> {
    // without a byte order mark, which is no part of the document
    let mut diagnostics = Diagnostics::new(false);
    let read = Text::new("", text.as_bytes().to_vec(), &mut diagnostics);
    let Some(mut read) = read else { return Err("a URDF file that is too large".to_owned()) };
    read.join_stray_prefix("drake", &mut diagnostics);
    let readable = read.content.as_str();
    let mark = text.len() - readable.len();
    let document = Document::parse(readable).map_err(|error| format!("a URDF file: {error}"))?;
    let root = document.root_element();
    let mut edits = Vec::new();
    for (old, new) in zero.old.joints.iter().zip(&zero.new.joints) {
        let node = root.children().find(|node| is_named(*node, "joint", &old.name));
        if let Some(node) = node {
            joint(readable, node, old, new, &mut edits);
            coupling(readable, root, node, old, new, &mut edits)?;
        } else if old != new {
            return Err(format!("the joint {}, which is not in the URDF", old.name));
        }
    }
    edits.iter_mut().for_each(|(range, _)| *range = range.start + mark..range.end + mark);
    Ok(edits)
}

/// Origin, limits, calibration and spring of a joint.
fn joint(text: &str, node: Node<'_, '_>, old: &Joint, new: &Joint, edits: &mut Vec<Edit>) {
    let child = |name: &str| child(node, name);
    if old.origin != new.origin {
        let xyz = list(&new.origin.xyz, " ");
        let rpy = list(&new.origin.rpy, " ");
        if let Some(origin) = child("origin") {
            if old.origin.xyz != new.origin.xyz {
                set(text, origin, "xyz", xyz, edits);
            }
            // angles replace a quaternion
            match origin.attribute_node("quat_xyzw") {
                _ if old.origin.rpy == new.origin.rpy => {}
                Some(quaternion) => edits.push((quaternion.range(), format!("rpy=\"{rpy}\""))),
                None => set(text, origin, "rpy", rpy, edits),
            }
        } else if let Some(first) = node.children().find(Node::is_element) {
            let at = first.range().start;
            let before = text.get(..at).unwrap_or_default();
            let (rest, indent) = before.split_at(before.trim_end_matches([' ', '\t']).len());
            let line = if rest.ends_with('\n') { format!("\n{indent}") } else { String::new() };
            edits.push((at..at, format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>{line}")));
        }
    }
    let moved = old.terms.rest - new.terms.rest;
    if moved == 0.0 {
        return;
    }
    if let (Some(limit), Some(old), Some(new)) = (child("limit"), old.limits, new.limits) {
        for (name, old, new) in [("lower", old.lower, new.lower), ("upper", old.upper, new.upper)] {
            if new.is_finite() && old != new {
                set(text, limit, name, number(new), edits);
            }
        }
    }
    for (element, names) in [
        ("calibration", &["rising", "falling", "reference_position"][..]),
        ("safety_controller", &["soft_lower_limit", "soft_upper_limit"]),
    ] {
        let Some(element) = child(element) else { continue };
        for name in names {
            let value = element.attribute(*name).and_then(|value| value.trim().parse::<f64>().ok());
            if let Some(value) = value {
                set(text, element, name, number(value - moved), edits);
            }
        }
    }
    if let Some(dynamics) = child("dynamics")
        && old.terms.stiffness != 0.0
    {
        set(text, dynamics, "spring_reference", number(new.terms.rest), edits);
    }
}

/// The offset of a coupling: of `<mimic>`, or of the first `<depends_on>`.
fn coupling(
    text: &str,
    root: Node<'_, '_>,
    node: Node<'_, '_>,
    old: &Joint,
    new: &Joint,
    edits: &mut Vec<Edit>,
) -> Result<(), String> {
    let (Some(old_coupling), Some(new)) = (&old.coupling, &new.coupling) else { return Ok(()) };
    if new == old_coupling {
        return Ok(());
    }
    let mut of_transmission = root
        .children()
        .filter(|node| node.has_tag_name("transmission"))
        .flat_map(|node| node.children())
        .filter(|node| is_named(*node, "joint", &old.name))
        .flat_map(|node| node.children())
        .filter(|node| node.has_tag_name("depends_on"));
    let is_curved = |of: &Node<'_, '_>| of.has_attribute("polynomial") || of.has_attribute("table");
    for (at, (_, curve)) in of_transmission.clone().filter(is_curved).zip(&new.curves) {
        match curve {
            Curve::Polynomial { about, .. } => set(text, at, "about", number(*about), edits),
            Curve::Table(points) => set(text, at, "table", list(points.as_flattened(), " "), edits),
        }
    }
    let Some(at) = child(node, "mimic").or_else(|| of_transmission.next()) else {
        return Err(format!("the coupling of {}, which stands in another file", old.name));
    };
    let now = at.attribute("offset").and_then(|x| x.trim().parse::<f64>().ok()).unwrap_or(0.0);
    set(text, at, "offset", number(now + new.offset - old_coupling.offset), edits);
    Ok(())
}

/// Sets an attribute, or adds it behind the element's name.
pub(super) fn set(
    text: &str,
    node: Node<'_, '_>,
    name: &str,
    value: String,
    edits: &mut Vec<Edit>,
) {
    match node.attribute_node(name) {
        Some(attribute) => edits.push((attribute.range_value(), value)),
        None => {
            let start = node.range().start;
            let tag = text.get(start..).unwrap_or_default();
            let length = tag.find(|c: char| c.is_whitespace() || c == '/' || c == '>');
            let at = start + length.unwrap_or(1);
            edits.push((at..at, format!(" {name}=\"{value}\"")));
        }
    }
}
