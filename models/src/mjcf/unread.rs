//! Reports each element and attribute that the conversion has not read: a note where it has no
//! influence on the dynamics, an error elsewhere.

use std::collections::BTreeMap;

use super::document::Element;
use crate::report::{Diagnostics, Span, quoted};

/// Elements and those of their attributes without influence on mass, forces, loops, limits and
/// actuators; `*` before whole elements with all that they hold, `=` for an attribute of one value.
pub(crate) const HARMLESS: &str = include_str!("harmless.txt");

/// Reports the unread parts of a model.
pub(crate) fn report(root: &Element, harmless: &str, help: &str, diagnostics: &mut Diagnostics) {
    let lines = harmless.lines().filter_map(|line| line.trim().split_once(':'));
    let mut harmless: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (tag, attributes) in lines {
        harmless.entry(tag).or_default().extend(attributes.split_whitespace());
    }
    let mut found = BTreeMap::new();
    visit(root, (&harmless, help), &mut found, diagnostics);
    for ((tag, what), (span, count)) in found {
        let times = if count == 1 { String::new() } else { format!(" ({count} times)") };
        let what = match what {
            "" => format!("the element {} is not read{times}", quoted(tag)),
            what => format!("`{what}` of {} is not read{times}", quoted(tag)),
        };
        diagnostics.note(span, what, "it has no influence on the dynamics");
    }
}

/// Elements that are unread where an `<attach>` places another part of their file.
const PARTS: [&str; 4] = ["body", "frame", "replicate", "attach"];

/// First position and number of each unread part.
type Found<'e> = BTreeMap<(&'e str, &'e str), (Span, usize)>;

fn visit<'e>(
    element: &'e Element,
    (harmless, help): (&BTreeMap<&str, Vec<&str>>, &str),
    found: &mut Found<'e>,
    diagnostics: &mut Diagnostics,
) {
    let tag = element.name.as_str();
    let known = harmless.get(tag).map_or(&[][..], Vec::as_slice);
    let is_harmless = harmless.get("*").is_some_and(|whole| whole.contains(&tag));
    if !element.is_read.get() {
        if PARTS.contains(&tag) {
            // and it may hold that part
            let parts = element.children.iter().filter(|of| PARTS.contains(&&*of.name));
            parts.for_each(|part| visit(part, (harmless, help), found, diagnostics));
        } else if is_harmless {
            found.entry((tag, "")).or_insert((element.span, 0)).1 += 1;
        } else {
            let found = format!("the element {} is not read", quoted(tag));
            diagnostics.dynamics(element.span, found, "an element that is known", help);
        }
        return;
    }
    for attribute in element.attributes.iter().filter(|of| !of.is_read.get()) {
        let name = attribute.name.as_str();
        let with_value = format!("{name}={}", attribute.value.trim());
        if is_harmless || known.contains(&name) || known.contains(&&*with_value) {
            found.entry((tag, name)).or_insert((attribute.span, 0)).1 += 1;
        } else {
            let found = format!("the attribute {} of {} is not read", quoted(name), quoted(tag));
            let help = "remove it";
            diagnostics.dynamics(attribute.span, found, "an attribute that is known", help);
        }
    }
    for child in &element.children {
        // a default that no element takes
        if tag == "default" && !child.is_read.get() {
            found.entry((child.name.as_str(), "")).or_insert((child.span, 0)).1 += 1;
        } else {
            visit(child, (harmless, help), found, diagnostics);
        }
    }
}
