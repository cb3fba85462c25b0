//! Mass and inertia of links, by position.

use roxmltree::Document;
use sarrus_dynamics::description::Inertial;

use super::{edited, is_named, list, number, urdf::set};
use crate::urdf::child;

/// The text of a URDF with other masses and inertias of the named links; every other byte stays.
/// Axes are those of the text.
///
/// # Errors
/// Text that is no URDF, and a link that has no inertia in it.
pub fn with_inertials(text: &str, links: &[(&str, Inertial)]) -> Result<String, String> {
    let document = Document::parse(text).map_err(|error| format!("a URDF file: {error}"))?;
    let mut edits = Vec::new();
    for (name, inertial) in links {
        let node = document.root_element().children().find(|node| is_named(*node, "link", name));
        let node = node.and_then(|node| child(node, "inertial"));
        let parts = node.and_then(|node| Some((child(node, "mass")?, child(node, "inertia")?)));
        let (Some(node), Some((mass, inertia))) = (node, parts) else {
            return Err(format!("the inertia of the link {name}, which is not in the URDF"));
        };
        set(text, mass, "value", number(inertial.mass), &mut edits);
        let xyz = list(&inertial.origin.xyz, " ");
        match child(node, "origin") {
            Some(origin) => set(text, origin, "xyz", xyz, &mut edits),
            None => {
                let at = mass.range().start;
                edits.push((at..at, format!("<origin xyz=\"{xyz}\"/>")));
            }
        }
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        for (name, x) in names.into_iter().zip(inertial.inertia) {
            set(text, inertia, name, number(x), &mut edits);
        }
    }
    Ok(edited(text, edits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_numbers_of_named_links_change() {
        let text = "<robot name=\"r\"><!-- kept -->\n <link name=\"a\"><inertial>\
                    <mass value='1'/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" \
                    izz=\"1\"/></inertial></link> <link name=\"b\"><inertial><origin \
                    rpy=\"0 0 1\" xyz=\"0 0 0\"/><mass value=\"2\"/><inertia ixx=\"1\" ixy=\"0\" \
                    ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link></robot>\n";
        let mut inertial = Inertial::point(3.5, [0.25, 0.0, -1.0]);
        inertial.inertia = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
        let written = with_inertials(text, &[("b", inertial)]).unwrap();
        let expected = text.replace("value=\"2\"", "value=\"3.5\"");
        assert_eq!(written, expected.replace("xyz=\"0 0 0\"", "xyz=\"0.25 0 -1\""));
        let written = with_inertials(text, &[("a", inertial)]).unwrap();
        assert!(written.contains("<inertial><origin xyz=\"0.25 0 -1\"/><mass value='3.5'/>"));
        assert!(with_inertials(text, &[("c", inertial)]).is_err());
    }
}
