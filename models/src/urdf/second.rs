//! A second reading of the numbers of a URDF, by urdf-rs: it must be the same as that of the walk.

use roxmltree::Node;
use sarrus_dynamics::description::{Inertial, Placement};

use super::xml::Reader;
use super::{JointEntry, LinkEntry, MOST_LINKS, Urdf, Weight};

/// Attributes that both read. The rotation of a quaternion is left out: that of urdf-rs is up to
/// 2.8e-3 rad off near the vertical.
const ATTRIBUTES: [&str; 17] = [
    "name", "version", "type", "link", "xyz", "rpy", "value", "ixx", "ixy", "ixz", "iyy", "iyz",
    "izz", "lower", "upper", "effort", "velocity",
];

/// An element as both readers have it: its name, and the numbers of the walk and of urdf-rs.
type Reading = (&'static str, Vec<f64>, Vec<f64>);

/// Compares both readings of a file whose links and joints the walk has read without an error, and
/// which is not refused for its size. A text that urdf-rs cannot read has only ours.
pub(super) fn check<'t>(reader: &mut Reader<'t, '_>, root: Node<'_, 't>, urdf: &Urdf) {
    if urdf.links.len().max(urdf.joints.len()) <= MOST_LINKS && !reader.diagnostics.has_errors() {
        let mut text = String::new();
        write(root, &mut text);
        compare(reader, root, &text, urdf);
    }
}

/// Reports where urdf-rs reads other names or numbers from `text` than the walk has read.
fn compare<'t>(reader: &mut Reader<'t, '_>, root: Node<'_, 't>, text: &str, urdf: &Urdf) {
    let Ok(robot) = urdf_rs::read_from_string(text) else { return };
    let counts = [urdf.links.len(), urdf.joints.len()].map(|count| count as f64);
    let others = [robot.links.len(), robot.joints.len()].map(|count| count as f64);
    if counts != others {
        return report(reader, root, ["", ""], &[("robot", counts.to_vec(), others.to_vec())]);
    }
    let nodes = |name: &'static str| both_read(root).filter(move |node| node.has_tag_name(name));
    for ((node, ours), theirs) in nodes("link").zip(&urdf.links).zip(&robot.links) {
        report(reader, node, [&ours.name, &theirs.name], &of_link(node, ours, theirs));
    }
    for ((node, ours), theirs) in nodes("joint").zip(&urdf.joints).zip(&robot.joints) {
        report(reader, node, [&ours.name, &theirs.name], &of_joint(node, ours, theirs));
    }
}

/// Appends what both read of an element, as the file has it, with the joint types by the names of
/// urdf-rs.
fn write(node: Node<'_, '_>, text: &mut String) {
    let name = node.tag_name().name();
    text.extend(["<", name]);
    for attribute in node.attributes().filter(|attribute| {
        attribute.namespace().is_none() && ATTRIBUTES.contains(&attribute.name())
    }) {
        let written = node.document().input_text().get(attribute.range()).unwrap_or_default();
        text.extend([
            " ",
            match (attribute.name(), attribute.value()) {
                ("type", "ball") => "type=\"spherical\"",
                ("type", "universal") => "type=\"floating\"",
                _ => written,
            },
        ]);
    }
    text.push('>');
    both_read(node).for_each(|child| write(child, text));
    text.extend(["</", name, ">"]);
}

/// The children of an element that both read.
fn both_read<'a, 't>(node: Node<'a, 't>) -> impl Iterator<Item = Node<'a, 't>> {
    let names: &[&str] = match node.tag_name().name() {
        "robot" => &["link", "joint"],
        "link" => &["inertial"],
        "inertial" => &["origin", "mass", "inertia"],
        "joint" if has_axis(node) => &["origin", "parent", "child", "axis", "limit"],
        "joint" => &["origin", "parent", "child", "limit"],
        _ => &[],
    };
    node.children().filter(move |child| {
        child.tag_name().namespace().is_none() && names.contains(&child.tag_name().name())
    })
}

/// The part of a link's inertial, or of a joint, with this name.
fn part<'a, 't>(node: Node<'a, 't>, name: &str) -> Option<Node<'a, 't>> {
    let inertial = both_read(node).find(|child| child.has_tag_name("inertial"));
    both_read(inertial.unwrap_or(node)).find(|child| child.has_tag_name(name))
}

/// Whether a joint has an axis; a fault in that of another one is none.
fn has_axis(joint: Node<'_, '_>) -> bool {
    !matches!(joint.attribute("type"), Some("fixed" | "floating" | "spherical" | "ball"))
}

fn of_link(node: Node<'_, '_>, ours: &LinkEntry, theirs: &urdf_rs::Link) -> [Reading; 3] {
    let Inertial { origin, mass, inertia } = match ours.inertial {
        Weight::Given { inertial, .. } => inertial,
        _ => Inertial { origin: Placement::default(), mass: 0.0, inertia: [0.0; 6] },
    };
    let urdf_rs::Inertial { inertia: i, mass: m, origin: pose } = &theirs.inertial;
    [
        of_origin(node, origin, pose),
        ("mass", vec![mass], vec![m.value]),
        ("inertia", inertia.to_vec(), vec![i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz]),
    ]
}

fn of_joint(node: Node<'_, '_>, ours: &JointEntry, theirs: &urdf_rs::Joint) -> [Reading; 3] {
    let axis = if has_axis(node) { ours.axis } else { *theirs.axis.xyz };
    let limit = &theirs.limit;
    let limits =
        ours.limits.map_or([0.0; 4], |ours| [ours.lower, ours.upper, ours.effort, ours.velocity]);
    // no bound: no attribute is 0 to urdf-rs, and −1 a number
    let written =
        [(limit.lower, 0.0), (limit.upper, 0.0), (limit.effort, -1.0), (limit.velocity, -1.0)];
    let bounds = limits.iter().zip(written).map(|(ours, (theirs, none))| {
        if ours.is_infinite() && theirs == none { *ours } else { theirs }
    });
    [
        of_origin(node, ours.origin, &theirs.origin),
        ("axis", axis.to_vec(), theirs.axis.xyz.to_vec()),
        ("limit", limits.to_vec(), bounds.collect()),
    ]
}

fn of_origin(node: Node<'_, '_>, ours: Placement, theirs: &urdf_rs::Pose) -> Reading {
    let is_turned = part(node, "origin").is_some_and(|origin| origin.has_attribute("quat_xyzw"));
    let rpy = if is_turned { ours.rpy } else { *theirs.rpy };
    ("origin", [ours.xyz, ours.rpy].concat(), [*theirs.xyz, rpy].concat())
}

/// Reports the names and numbers of one element that differ.
fn report<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    [ours, theirs]: [&str; 2],
    readings: &[Reading],
) {
    // not every reader makes spaces of other white space, as XML asks
    if !ours.split_whitespace().eq(theirs.split_whitespace()) {
        let found = "two readers of this file see different names";
        let help = "use letters, digits, _ and / in names";
        reader.diagnostics.error(reader.span(node), found, "plain names", help);
    }
    for (name, ours, theirs) in readings {
        let different = ours.iter().zip(theirs).find(|(ours, theirs)| ours != theirs);
        let Some((ours, theirs)) = different else { continue };
        let span = reader.span(part(node, name).unwrap_or(node));
        let found = format!(
            "two readers of this file see different numbers in `{name}`: {ours} and {theirs}"
        );
        reader.diagnostics.error(span, found, "one reading", "write plain decimal numbers");
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Version, joint, link, xml};
    use super::{Reader, Urdf, both_read, compare, write};
    use crate::bundled::{bundled, bundled_text};
    use crate::report::Diagnostics;
    use crate::text::Text;

    const LAMBDA: &str = include_str!("../../tests/suite/lambda.urdf");

    /// Whether urdf-rs reads its text with `from` replaced by `to`, and what is reported then.
    fn second(urdf: &str, [from, to]: [&str; 2]) -> (bool, String) {
        let mut diagnostics = Diagnostics::new(false);
        let file = Text::new("f", urdf.into(), &mut diagnostics).unwrap();
        let document = xml::parse(&file, &mut diagnostics).unwrap();
        let root = document.root_element();
        let version = Version(1, 0);
        let mut reader = Reader { text: &file, diagnostics: &mut diagnostics, version };
        let mut urdf = Urdf::of_robot(&mut reader, root).unwrap();
        for node in both_read(root) {
            match node.tag_name().name() {
                "link" => urdf.links.push(link::read(&mut reader, node)),
                _ => urdf.joints.push(joint::read(&mut reader, node)),
            }
        }
        assert!(!reader.diagnostics.has_errors());
        let mut text = String::new();
        write(root, &mut text);
        assert!(text.contains(from), "{text}");
        let text = text.replacen(from, to, 1);
        compare(&mut reader, root, &text, &urdf);
        let errors = diagnostics.into_report().errors;
        let lines = errors.iter().map(|error| format!("{error}\n")).collect();
        (urdf_rs::read_from_string(&text).is_ok(), lines)
    }

    #[test]
    fn both_readers_agree_on_every_bundled_robot() {
        let robots = bundled().filter_map(|(name, _)| bundled_text(name));
        for urdf in robots.map(|(urdf, _)| urdf).chain([LAMBDA]) {
            assert_eq!(second(urdf, ["", ""]), (true, String::new()), "{urdf}");
        }
    }

    #[test]
    fn differences_by_design_are_none() {
        let joint = |n: usize, kind: &str, inside: &str| {
            format!(
                "<link name=\"l{n}\"><visual/></link><joint name='j&amp;\t{n}' type=\"{kind}\">\
                 <parent link=\"l{}\"/><child link=\"l{n}\"/>{inside}</joint>",
                n - 1
            )
        };
        let robot = [
            "<robot name=\"r\" version=\"1.1\"><link name=\"l0\"/>".to_owned(),
            joint(1, "planar", "<axis xyz=\"0 0 2\"/>"),
            joint(2, "universal", "<axis xyz=\"0 1 0\"/><axis2 xyz=\"0 0 1\"/>"),
            joint(3, "ball", "<dynamics damping=\"1\"/>"),
            joint(4, "fixed", "<axis xyz=\"0 0 0 1\"/><origin xyz=\"1e-1 0 +2.\"/>"),
            joint(5, "revolute", "<limit effort=\"-1\" velocity=\"3\"/>"),
            joint(6, "continuous", "<origin quat_xyzw=\"0 1 0 0\" xyz=\"1 2 3\"/><mesh/>"),
            joint(7, "prismatic", "<limit upper=\"2\" effort=\"1\" velocity=\"-1\"/>"),
            "</robot>".to_owned(),
        ]
        .concat();
        assert_eq!(second(&robot, ["", ""]), (true, String::new()));
        // urdf-rs refuses an effort below zero from version 1.2 on
        let later = robot.replace("1.1", "1.2");
        assert_eq!(second(&later, ["", ""]), (false, String::new()));
    }

    #[test]
    fn different_readings_are_reported_where_they_differ() {
        let numbers = |at: &str, name: &str, ours: &str, theirs: &str| {
            format!(
                "f:{at}: two readers of this file see different numbers in `{name}`: {ours} and \
                 {theirs}, expected one reading, write plain decimal numbers\n"
            )
        };
        let names = |at: &str| {
            format!(
                "f:{at}: two readers of this file see different names, expected plain names, use \
                 letters, digits, _ and / in names\n"
            )
        };
        for (from, to, expected) in [
            ("value=\"0.5\"", "value=\".4\"", numbers("12:7", "mass", "0.5", "0.4")),
            ("iyz=\"0\"", "iyz=\"1e-3\"", numbers("7:7", "inertia", "0", "0.001")),
            ("0.2 0\" rpy=\"0", "0.2 0\" rpy=\"3", numbers("5:7", "origin", "0", "3")),
            ("0 0.3 0", "0 0.3 1", numbers("38:5", "origin", "0", "1")),
            ("2 0 0", "2 -1 0", numbers("33:5", "axis", "0", "-1")),
            ("\"-1.5\"", "\"-1.6\"", numbers("27:5", "limit", "-1.5", "-1.6")),
            ("\"100\"", "\"-1\"", numbers("27:5", "limit", "100", "-1")),
            ("\"rod\"", "\"r\"", names("16:3")),
            ("\"swing\"", "\"wing\"", names("29:3")),
            ("<link name=\"base\"></link>", "", numbers("1:1", "robot", "4", "3")),
        ] {
            assert_eq!(second(LAMBDA, [from, to]), (true, expected));
        }
    }
}
