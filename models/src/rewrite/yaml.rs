//! Placements of cuts, put behind the `cut_joint` of their loops.

use sarrus_dynamics::description::Placement;

use super::{Edit, list};
use crate::report::Diagnostics;
use crate::text::Text;
use crate::yaml;

/// The replacements that place cuts: separate lines, or further keys within braces. `None` if there
/// is no such loop.
pub(super) fn edits(
    text: &str,
    cuts: &[(usize, usize, Placement, Placement)],
    in_braces: bool,
) -> Option<Vec<Edit>> {
    let mut diagnostics = Diagnostics::new(false);
    let read = Text::new("", text.as_bytes().to_vec(), &mut diagnostics)?;
    // a byte order mark is not part of the text that was read
    let mark = text.len() - read.content.len();
    let root = yaml::parse(&read, yaml::SUBMECHANISMS, &mut diagnostics)?;
    let mut edits = Vec::new();
    for (s, l, predecessor, successor) in cuts {
        let entry = root.get("submechanisms")?.items().get(*s)?;
        let (key, value) = entry.get("loop_constraints")?.items().get(*l)?.entry("cut_joint")?;
        let placement = |key: &str, at: &Placement| {
            format!("{key}: {{xyz: [{}], rpy: [{}]}}", list(&at.xyz, ", "), list(&at.rpy, ", "))
        };
        let placements = [
            placement("predecessor_placement", predecessor),
            placement("successor_placement", successor),
        ];
        let from = read.offset(value.span)?;
        let rest = read.content.get(from..)?;
        let (at, new) = if in_braces {
            (from + scalar(rest), placements.map(|line| format!(", {line}")).concat())
        } else {
            let indent = " ".repeat(key.span.column as usize - 1);
            let end = rest.find(['\r', '\n']).unwrap_or(rest.len());
            (from + end, placements.map(|line| format!("\n{indent}{line}")).concat())
        };
        edits.push((at + mark..at + mark, new));
    }
    Some(edits)
}

/// The length of the word, in quotes or not, that a text begins with.
fn scalar(text: &str) -> usize {
    match text.chars().next() {
        Some(quote @ ('"' | '\'')) => {
            text.get(1..).and_then(|rest| rest.find(quote)).map_or(text.len(), |end| end + 2)
        }
        _ => text.find([',', '}', '\n', '\r', '#']).unwrap_or(text.len()),
    }
}
