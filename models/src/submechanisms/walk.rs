//! The shape of a submechanism file: which keys, what kind of values.

use std::collections::BTreeSet;

use super::cut;
use crate::report::{Diagnostics, Span, quoted};
use crate::urdf::Urdf;
use crate::yaml::{Named, Node, Value, keys, list, number, numbers, word, words};

/// A submechanism as it stands in the file; `None` for what is absent or malformed, which has been
/// reported.
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
    /// Puts the parts of joints of several axes in the place of their names.
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

/// A loop constraint as it stands in the file.
pub(crate) struct LoopEntry {
    pub(crate) span: Span,
    pub(crate) cut_joint: Option<Named>,
    pub(crate) predecessor: Option<Named>,
    pub(crate) successor: Option<Named>,
    pub(crate) is_placed: bool,
    pub(crate) rows: Vec<Span>,
}

const TOP: &[&str] = &["submechanisms", "exoskeletons"];
const ENTRY: &[&str] = &[
    "type",
    "contextual_name",
    "name",
    "file_path",
    "jointnames",
    "jointnames_spanningtree",
    "jointnames_independent",
    "jointnames_active",
    "loop_constraints",
];
const LOOP: &[&str] = &[
    "cut_joint",
    "predecessor_body",
    "successor_body",
    "frames",
    "constraint_axes",
    "cut_joint_type",
    "axis",
    "axis2",
    "baumgarte_stabilization_parameter",
    "predecessor_placement",
    "successor_placement",
];
const ROW: &[&str] = &["name", "axis", "baumgarte_stabilization_parameter"];
const PLACEMENT: &[&str] = &["xyz", "rpy"];

/// The submechanisms of a file.
pub(crate) fn walk(root: &Node, diagnostics: &mut Diagnostics) -> Vec<Entry> {
    if !keys(root, "the file", TOP, diagnostics) {
        return Vec::new();
    }
    if let Some(exoskeletons) = root.get("exoskeletons").filter(|node| !node.items().is_empty()) {
        let help = "couple their joints by <mimic> in the URDF";
        diagnostics.warning(
            exoskeletons.span,
            "`exoskeletons` is not used",
            "submechanisms only",
            help,
        );
    }
    let Some(list) = root.get("submechanisms") else {
        diagnostics.error(
            root.span,
            "the file has no `submechanisms`",
            "a list of at least one",
            "add it",
        );
        return Vec::new();
    };
    if matches!(list.value, Value::Null)
        || matches!(&list.value, Value::List(items) if items.is_empty())
    {
        diagnostics.error(
            list.span,
            "`submechanisms` is empty",
            "at least one",
            "list the joints in submechanisms",
        );
    } else if !matches!(list.value, Value::List(_)) {
        diagnostics.error(
            list.span,
            format!("`submechanisms` is {}", list.describe()),
            "a list",
            "write each submechanism as a list item",
        );
    }
    list.items().iter().filter_map(|node| entry(node, diagnostics)).collect()
}

fn entry(node: &Node, diagnostics: &mut Diagnostics) -> Option<Entry> {
    if !keys(node, "a submechanism", ENTRY, diagnostics) {
        return None;
    }
    let contextual_name = word(node, "contextual_name", diagnostics);
    let other_name = word(node, "name", diagnostics);
    if node.get("contextual_name").is_none() && node.get("name").is_none() {
        diagnostics.error(
            node.span,
            "the submechanism has no `contextual_name`",
            "a name of its own",
            "add it",
        );
    }
    let type_name = word(node, "type", diagnostics);
    if node.get("type").is_none() {
        diagnostics.error(
            node.span,
            "the submechanism has no `type`",
            "a type as 3R, RRPR or NUMERICAL",
            "add it",
        );
    }
    let file_path = word(node, "file_path", diagnostics);
    for key in ["jointnames_spanningtree", "jointnames_independent", "jointnames_active"] {
        if node.get(key).is_none() {
            diagnostics.error(
                node.span,
                format!("the submechanism has no `{key}`"),
                "a list of joints, which may be empty",
                "add it",
            );
        }
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
    if !keys(node, "a loop constraint", LOOP, diagnostics) {
        return None;
    }
    let frames = frames(node, diagnostics);
    let [cut_joint, predecessor, successor] = ["cut_joint", "predecessor_body", "successor_body"]
        .map(|key| {
            if node.get(key).is_none() && frames.is_none() {
                diagnostics.error(
                    node.span,
                    format!("the loop constraint has no `{key}`"),
                    format!("`{key}: NAME`"),
                    "add it",
                );
            }
            word(node, key, diagnostics)
        });
    let (predecessor, successor) = match frames.clone().flatten() {
        Some([first, second]) => (Some(first), Some(second)),
        None => (predecessor, successor),
    };
    baumgarte(node, diagnostics);
    let placements =
        ["predecessor_placement", "successor_placement"].map(|key| (key, node.get(key)));
    for (key, placement) in placements {
        let Some(placement) =
            placement.filter(|placement| keys(placement, key, PLACEMENT, diagnostics))
        else {
            continue;
        };
        for part in PLACEMENT {
            numbers::<3>(placement, key, part, diagnostics);
        }
    }
    if let [(given, Some(placement)), (missing, None)]
    | [(missing, None), (given, Some(placement))] = placements
    {
        diagnostics.error(
            placement.span,
            format!("the loop has `{given}` but no `{missing}`"),
            "both or neither",
            format!("add `{missing}`"),
        );
    }
    let (axes, of_type) =
        (list(node, "constraint_axes", diagnostics), cut::walk(node, diagnostics));
    let no_axes = axes.is_empty() && node.get("cut_joint_type").is_none();
    if no_axes
        && !matches!(
            node.get("constraint_axes").map(|axes| &axes.value),
            Some(Value::Scalar { .. } | Value::Map(_))
        )
    {
        let help = "list the constrained directions, or give a cut_joint_type";
        diagnostics.error(
            node.span,
            "the loop constraint has no `constraint_axes`",
            "at least one",
            help,
        );
    }
    if let Some(seventh) = axes.get(6) {
        let found = format!("the loop constraint has {} constraint_axes", axes.len());
        diagnostics.error(seventh.span, found, "at most six", "remove those that the others imply");
    }
    let mut names: BTreeSet<String> = BTreeSet::new();
    for axis in axes {
        row(axis, &mut names, diagnostics);
    }
    let is_placed = frames.is_some() || placements.iter().all(|(_, placement)| placement.is_some());
    let rows = axes.iter().map(|axis| axis.span).chain(of_type).collect();
    Some(LoopEntry { span: node.span, cut_joint, predecessor, successor, is_placed, rows })
}

/// The two links of `frames`, whose frames are the cut frames; nothing else may place the cut then.
/// The inner `None` stands for what is malformed.
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
            diagnostics.error(
                node.span,
                format!("the constraint axis has no `{key}`"),
                "name and axis",
                "add it",
            );
        }
    }
    if let Some((name, span)) = word(node, "name", diagnostics)
        && !names.insert(name.clone())
    {
        diagnostics.error(
            span,
            format!("a second axis of this loop is named {}", quoted(&name)),
            "a name of its own",
            "rename one of them",
        );
    }
    baumgarte(node, diagnostics);
    let axis = numbers::<6>(node, "a constraint axis", "axis", diagnostics);
    if let Some(span) =
        axis.filter(|axis| *axis == [0.0; 6]).and_then(|_| node.get("axis")).map(|node| node.span)
    {
        diagnostics.error(
            span,
            "the constraint axis is zero",
            "a direction [wx, wy, wz, vx, vy, vz]",
            "correct it",
        );
    }
}

fn baumgarte(node: &Node, diagnostics: &mut Diagnostics) {
    const KEY: &str = "baumgarte_stabilization_parameter";
    if let Some(value) = node.get(KEY) {
        number(value, KEY, diagnostics);
    }
}
