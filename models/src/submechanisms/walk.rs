//! The shape of a submechanism file, key by key, with the position of every value.

use std::collections::BTreeSet;

use super::cut;
use crate::report::{Diagnostics, Span};
use crate::urdf::Urdf;
use crate::yaml::{Named, Node, Value, keys, list, missing, number, numbers, word, words};

/// A submechanism as written; absent and malformed values are `None` and have been reported.
pub(crate) struct Entry {
    pub(crate) span: Span,
    pub(crate) name: Option<Named>,
    pub(crate) type_name: Option<Named>,
    pub(crate) file_path: Option<Named>,
    pub(crate) all: Option<Vec<Named>>,
    pub(crate) tree: Option<Vec<Named>>,
    pub(crate) independent: Option<Vec<Named>>,
    pub(crate) active: Option<Vec<Named>>,
    pub(crate) loops: Vec<LoopEntry>,
}

impl Entry {
    /// Replaces the names of joints of several axes by those of their parts.
    pub(super) fn expand(&mut self, urdf: &Urdf) {
        for list in [&mut self.all, &mut self.tree, &mut self.independent, &mut self.active] {
            let Some(names) = list else { continue };
            let parts = |(name, span): Named| match urdf.parts.get(&name) {
                Some(parts) => parts.iter().map(|part| (part.clone(), span)).collect(),
                None => vec![(name, span)],
            };
            *names = std::mem::take(names).into_iter().flat_map(parts).collect();
        }
    }
}

/// A loop constraint as written.
pub(crate) struct LoopEntry {
    pub(crate) span: Span,
    pub(crate) cut_joint: Option<Named>,
    pub(crate) predecessor: Option<Named>,
    pub(crate) successor: Option<Named>,
    pub(crate) is_placed: bool,
    pub(crate) rows: Vec<Span>,
}

const OF_ENTRY: &str = "the submechanism";
const TOP: &[&str] = &["submechanisms", "actuators", "exoskeletons"];
const ENTRY: &str = "type contextual_name name file_path jointnames jointnames_spanningtree \
    jointnames_independent jointnames_active loop_constraints closed_forms";
const LOOP: &str = "cut_joint predecessor_body successor_body frames constraint_axes \
    cut_joint_type axis axis2 baumgarte_stabilization_parameter predecessor_placement \
    successor_placement";
const ROW: &[&str] = &["name", "axis", "baumgarte_stabilization_parameter"];
const PLACEMENT: &[&str] = &["xyz", "rpy"];

fn words_of(list: &str) -> Vec<&str> {
    list.split(' ').collect()
}

/// The submechanisms of a file.
pub(crate) fn walk(root: &Node, diagnostics: &mut Diagnostics) -> Vec<Entry> {
    if !keys(root, "the file", TOP, diagnostics) {
        return Vec::new();
    }
    if let Some(exoskeletons) = root.get("exoskeletons").filter(|node| !node.items().is_empty()) {
        let found = "`exoskeletons` is not used";
        let help = "couple their joints by <mimic> in the URDF";
        diagnostics.warning(exoskeletons.span, found, "submechanisms only", help);
    }
    let Some(list) = root.get("submechanisms") else {
        missing(root, "the file", "submechanisms", "a list of at least one", diagnostics);
        return Vec::new();
    };
    if !matches!(list.value, Value::Null | Value::List(_)) {
        let found = format!("`submechanisms` is {}", list.describe());
        diagnostics.error(list.span, found, "a list", "write each submechanism as a list item");
    } else if list.items().is_empty() {
        let help = "list the joints in submechanisms";
        diagnostics.error(list.span, "`submechanisms` is empty", "at least one", help);
    }
    list.items().iter().filter_map(|node| entry(node, diagnostics)).collect()
}

fn entry(node: &Node, diagnostics: &mut Diagnostics) -> Option<Entry> {
    if !keys(node, "a submechanism", &words_of(ENTRY), diagnostics) {
        return None;
    }
    let contextual_name = word(node, "contextual_name", diagnostics);
    let other_name = word(node, "name", diagnostics);
    if node.get("contextual_name").is_none() && node.get("name").is_none() {
        missing(node, OF_ENTRY, "contextual_name", "a name of its own", diagnostics);
    }
    let type_name = word(node, "type", diagnostics);
    if node.get("type").is_none() {
        missing(node, OF_ENTRY, "type", "a type as 3R, RRPR or NUMERICAL", diagnostics);
    }
    let file_path = word(node, "file_path", diagnostics);
    for key in ["jointnames_spanningtree", "jointnames_independent", "jointnames_active"] {
        if node.get(key).is_none() {
            missing(node, OF_ENTRY, key, "a list of joints, which may be empty", diagnostics);
        }
    }
    if let Some((text, span)) = word(node, "closed_forms", diagnostics)
        && !["on", "off"].contains(&text.as_str())
    {
        let found = format!("`closed_forms` is {text}");
        diagnostics.error(span, found, "on or off", "write `closed_forms: off`, or nothing");
    }
    Some(Entry {
        span: node.span,
        name: contextual_name.or(other_name),
        type_name,
        file_path,
        all: words(node, "jointnames", diagnostics),
        tree: words(node, "jointnames_spanningtree", diagnostics),
        independent: words(node, "jointnames_independent", diagnostics),
        active: words(node, "jointnames_active", diagnostics),
        loops: list(node, "loop_constraints", diagnostics)
            .iter()
            .filter_map(|node| loop_entry(node, diagnostics))
            .collect(),
    })
}

fn loop_entry(node: &Node, diagnostics: &mut Diagnostics) -> Option<LoopEntry> {
    if !keys(node, "a loop constraint", &words_of(LOOP), diagnostics) {
        return None;
    }
    let frames = frames(node, diagnostics);
    let [cut_joint, predecessor, successor] = ["cut_joint", "predecessor_body", "successor_body"]
        .map(|key| {
            if node.get(key).is_none() && frames.is_none() {
                let expected = format!("`{key}: NAME`");
                missing(node, "the loop constraint", key, expected, diagnostics);
            }
            word(node, key, diagnostics)
        });
    let (predecessor, successor) = match frames.clone().flatten() {
        Some([first, second]) => (Some(first), Some(second)),
        None => (predecessor, successor),
    };
    baumgarte(node, diagnostics);
    let is_placed = placements(node, diagnostics) || frames.is_some();
    let axes = list(node, "constraint_axes", diagnostics);
    let of_type = cut::walk(node, diagnostics);
    let no_axes = axes.is_empty() && node.get("cut_joint_type").is_none();
    let given = node.get("constraint_axes").map(|axes| &axes.value);
    if no_axes && !matches!(given, Some(Value::Scalar { .. } | Value::Map(_))) {
        let found = "the loop constraint has no `constraint_axes`";
        let help = "list the constrained directions, or give a cut_joint_type";
        diagnostics.error(node.span, found, "at least one", help);
    }
    if let Some(seventh) = axes.get(6) {
        let found = format!("the loop constraint has {} constraint_axes", axes.len());
        diagnostics.error(seventh.span, found, "at most six", "remove those that the others imply");
    }
    let mut names: BTreeSet<String> = BTreeSet::new();
    for axis in axes {
        row(axis, &mut names, diagnostics);
    }
    let rows = axes.iter().map(|axis| axis.span).chain(of_type).collect();
    Some(LoopEntry { span: node.span, cut_joint, predecessor, successor, is_placed, rows })
}

/// Checks the placements of the cut frames and returns whether both are present.
fn placements(node: &Node, diagnostics: &mut Diagnostics) -> bool {
    let given = ["predecessor_placement", "successor_placement"].map(|key| (key, node.get(key)));
    for (key, placement) in given {
        let Some(placement) = placement else { continue };
        if keys(placement, key, PLACEMENT, diagnostics) {
            for part in PLACEMENT {
                numbers::<3>(placement, key, part, diagnostics);
            }
        }
    }
    if let [(given, Some(placement)), (missing, None)]
    | [(missing, None), (given, Some(placement))] = given
    {
        let found = format!("the loop has `{given}` but no `{missing}`");
        let help = format!("add `{missing}`");
        diagnostics.error(placement.span, found, "both or neither", help);
    }
    given.iter().all(|(_, placement)| placement.is_some())
}

/// The two links of `frames`, whose frames are the cut frames; no other key may then place the cut.
/// The inner `None` is a malformed value.
fn frames(node: &Node, diagnostics: &mut Diagnostics) -> Option<Option<[Named; 2]>> {
    let value = node.get("frames")?;
    let others =
        ["predecessor_body", "successor_body", "predecessor_placement", "successor_placement"];
    for (key, other) in others.iter().filter_map(|key| Some((key, node.get(key)?))) {
        let found = format!("the loop has `frames` and `{key}`");
        diagnostics.error(other.span, found, "one of them", "remove the other");
    }
    let Some(names) = words(node, "frames", diagnostics) else { return Some(None) };
    let count = names.len();
    let names = <[Named; 2]>::try_from(names).ok();
    if names.is_none() {
        let found = format!("`frames` holds {count} names");
        diagnostics.error(value.span, found, "two links", "write `frames: [LINK, LINK]`");
    }
    Some(names)
}

fn row(node: &Node, names: &mut BTreeSet<String>, diagnostics: &mut Diagnostics) {
    if !keys(node, "a constraint axis", ROW, diagnostics) {
        return;
    }
    for key in ["name", "axis"] {
        if node.get(key).is_none() {
            missing(node, "the constraint axis", key, "name and axis", diagnostics);
        }
    }
    if let Some((name, span)) = word(node, "name", diagnostics)
        && !names.insert(name.clone())
    {
        diagnostics.second(span, "axis of this loop", &name);
    }
    baumgarte(node, diagnostics);
    let span = node.get("axis").map_or(node.span, |axis| axis.span);
    if numbers(node, "a constraint axis", "axis", diagnostics) == Some([0.0; 6]) {
        let expected = "a direction [wx, wy, wz, vx, vy, vz]";
        diagnostics.error(span, "the constraint axis is zero", expected, "correct it");
    }
}

fn baumgarte(node: &Node, diagnostics: &mut Diagnostics) {
    const KEY: &str = "baumgarte_stabilization_parameter";
    if let Some(value) = node.get(KEY) {
        number(value, KEY, diagnostics);
    }
}
