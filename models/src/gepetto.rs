//! The files of Gepetto's tools for parallel robots: YAML that pairs frames of the URDF beside it,
//! and names its motors and ball joints.

use std::path::{Path, PathBuf};

use crate::export::urdf::escaped;
use crate::mjcf::Converted;
use crate::mjcf::document::Files;
use crate::report::{Diagnostics, quoted};
use crate::text::Text;
use crate::urdf::parse;
use crate::yaml::{self, Node};

const KEYS: [&str; 5] = ["closed_loop", "type", "name_mot", "joint_name", "joint_type"];

/// Converts the YAML at `path` and the URDF of its name; `None` after an error.
pub(crate) fn convert(
    path: Option<&Path>,
    (name, bytes): (&str, Vec<u8>),
    include: &[PathBuf],
    diagnostics: &mut Diagnostics,
) -> Option<Converted> {
    let root = yaml::read(name, bytes, "a file of Gepetto's tools", diagnostics)?;
    yaml::keys(&root, "the file", &KEYS, diagnostics);
    let [pairs, kinds, motors, joints, types] = KEYS.map(|key| yaml::list(&root, key, diagnostics));
    let beside = Path::new(name).with_extension("urdf");
    let beside = Path::new(beside.file_name()?);
    let (_, name, urdf) = Files::new(path, include).open(beside, root.span, diagnostics)?;
    let text = Text::new(&name, urdf, diagnostics)?;
    let document = parse(&text, diagnostics)?;
    let root_element = document.root_element();
    let Some(end) = text.content[..root_element.range().end].rfind("</robot") else {
        diagnostics.error(root.span, format!("{name} has no joints"), "a robot", "correct it");
        return None;
    };
    let elements = || root_element.children().filter(|of| of.has_tag_name("joint"));
    for joint in motors.iter().chain(joints) {
        let is_it = |of: roxmltree::Node<'_, '_>| {
            of.attribute("name") == joint.text() && of.has_attribute("type")
        };
        if !elements().any(is_it) {
            let found = joint.text().map_or("an entry that is no name".to_owned(), quoted);
            let expected = format!("a joint of {name} with a type");
            diagnostics.error(joint.span, found, expected, "correct it");
        }
    }
    if kinds.len() > pairs.len() {
        let found = format!("{} types", kinds.len());
        let expected = format!("one for each of {} closed loops", pairs.len());
        diagnostics.error(kinds[pairs.len()].span, found, expected, "remove the others");
    }
    let mut added = String::new();
    for (k, pair) in pairs.iter().enumerate() {
        let ends: Vec<&str> = pair.items().iter().filter_map(Node::text).collect();
        let kind = match (&ends[..], kinds.get(k).map_or(Some("6d"), Node::text)) {
            ([_, _], Some("3d")) => "ball",
            ([_, _], Some("6d")) => "fixed",
            _ => {
                diagnostics.error(pair.span, "a closed loop", "two frames, 3d or 6d", "correct it");
                continue;
            }
        };
        let [a, b] = [0, 1].map(|k| escaped(ends[k]));
        added += &format!(
            "<loop name=\"{a}_{b}\" type=\"{kind}\"><predecessor link=\"{a}\"/>\
             <successor link=\"{b}\"/></loop>\n"
        );
    }
    for name in motors.iter().filter_map(Node::text).map(escaped) {
        let of = format!("name=\"{name}\"");
        added += &format!("<transmission {of}><joint {of}/><actuator {of}/></transmission>\n");
    }
    let mut urdf = text.content.clone();
    urdf.insert_str(end, &added);
    if joints.len() != types.len() || types.iter().any(|of| of.text() != Some("SPHERICAL")) {
        let help = "write its type into the URDF";
        diagnostics.dynamics(root.span, "a joint of another type", "SPHERICAL", help);
    }
    let is_ball = |name: Option<&str>| joints.iter().any(|of| of.text() == name);
    let balls = elements().rev().filter(|of| is_ball(of.attribute("name")));
    for kind in balls.filter_map(|of| of.attribute_node("type")) {
        urdf.replace_range(kind.range_value(), "spherical");
    }
    (!diagnostics.has_errors()).then(|| Converted {
        name: root_element.attribute("name").unwrap_or("robot").to_owned(),
        urdf,
        submechanisms: "submechanisms: []\n".to_owned(),
        pose: None,
        is_driven: !motors.is_empty(),
    })
}
