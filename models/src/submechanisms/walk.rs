//! The shape of a submechanism file: which keys, what kind of values.

use std::collections::HashSet;

use super::cut;
use super::tree::{Node, Value};
use crate::number;
use crate::report::{Findings, Place, quoted};

/// A name and where it stands.
pub(crate) type Named = (String, Place);

/// A submechanism as it stands in the file; `None` for what is absent or malformed, which has been told.
pub(crate) struct Entry {
    pub(crate) place: Place,
    pub(crate) name: Option<Named>,
    pub(crate) type_name: Option<Named>,
    pub(crate) file_path: Option<Named>,
    pub(crate) all: Option<Vec<Named>>,
    pub(crate) tree: Option<Vec<Named>>,
    pub(crate) independent: Option<Vec<Named>>,
    pub(crate) active: Option<Vec<Named>>,
    pub(crate) loops: Vec<LoopEntry>,
}

/// A loop constraint as it stands in the file.
pub(crate) struct LoopEntry {
    pub(crate) place: Place,
    pub(crate) cut_joint: Option<Named>,
    pub(crate) predecessor: Option<Named>,
    pub(crate) successor: Option<Named>,
    pub(crate) is_placed: bool,
    pub(crate) rows: Vec<Place>,
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
pub(crate) fn walk(root: &Node, findings: &mut Findings) -> Vec<Entry> {
    if !keys(root, "the file", TOP, findings) {
        return Vec::new();
    }
    if let Some(exoskeletons) = root.get("exoskeletons").filter(|node| !node.items().is_empty()) {
        let help = "couple their joints by <mimic> in the URDF";
        findings.warning(exoskeletons.place, "`exoskeletons` is not used", "submechanisms only", help);
    }
    let Some(list) = root.get("submechanisms") else {
        findings.error(root.place, "the file has no `submechanisms`", "a list of at least one", "add it");
        return Vec::new();
    };
    if matches!(list.value, Value::Null) || matches!(&list.value, Value::List(items) if items.is_empty()) {
        findings.error(list.place, "`submechanisms` is empty", "at least one", "list the joints in submechanisms");
    } else if !matches!(list.value, Value::List(_)) {
        findings.error(list.place, format!("`submechanisms` is {}", list.describe()), "a list", "write each submechanism as a list item");
    }
    list.items().iter().filter_map(|node| entry(node, findings)).collect()
}

fn entry(node: &Node, findings: &mut Findings) -> Option<Entry> {
    if !keys(node, "a submechanism", ENTRY, findings) {
        return None;
    }
    let contextual_name = word(node, "contextual_name", findings);
    let other_name = word(node, "name", findings);
    if node.get("contextual_name").is_none() && node.get("name").is_none() {
        findings.error(node.place, "the submechanism has no `contextual_name`", "a name of its own", "add it");
    }
    let type_name = word(node, "type", findings);
    if node.get("type").is_none() {
        findings.error(node.place, "the submechanism has no `type`", "a type as 3R, RRPR or NUMERICAL", "add it");
    }
    let file_path = word(node, "file_path", findings);
    for key in ["jointnames_spanningtree", "jointnames_independent", "jointnames_active"] {
        if node.get(key).is_none() {
            findings.error(node.place, format!("the submechanism has no `{key}`"), "a list of joints, which may be empty", "add it");
        }
    }
    Some(Entry {
        place: node.place,
        name: contextual_name.or(other_name),
        type_name,
        file_path,
        all: words(node, "jointnames", findings),
        tree: words(node, "jointnames_spanningtree", findings),
        independent: words(node, "jointnames_independent", findings),
        active: words(node, "jointnames_active", findings),
        loops: list(node, "loop_constraints", findings).iter().filter_map(|node| loop_entry(node, findings)).collect(),
    })
}

fn loop_entry(node: &Node, findings: &mut Findings) -> Option<LoopEntry> {
    if !keys(node, "a loop constraint", LOOP, findings) {
        return None;
    }
    let [cut_joint, predecessor, successor] = ["cut_joint", "predecessor_body", "successor_body"].map(|key| {
        if node.get(key).is_none() {
            findings.error(node.place, format!("the loop constraint has no `{key}`"), format!("`{key}: NAME`"), "add it");
        }
        word(node, key, findings)
    });
    baumgarte(node, findings);
    let placements = ["predecessor_placement", "successor_placement"].map(|key| (key, node.get(key)));
    for (key, placement) in placements {
        let Some(placement) = placement.filter(|placement| keys(placement, key, PLACEMENT, findings)) else { continue };
        for part in PLACEMENT {
            numbers::<3>(placement, key, part, findings);
        }
    }
    if let [(given, Some(placement)), (missing, None)] | [(missing, None), (given, Some(placement))] = placements {
        findings.error(
            placement.place,
            format!("the loop has `{given}` but no `{missing}`"),
            "both or neither",
            format!("add `{missing}`"),
        );
    }
    let (axes, of_type) = (list(node, "constraint_axes", findings), cut::walk(node, findings));
    let no_axes = axes.is_empty() && node.get("cut_joint_type").is_none();
    if no_axes && !matches!(node.get("constraint_axes").map(|axes| &axes.value), Some(Value::Scalar { .. } | Value::Map(_))) {
        let help = "list the constrained directions, or give a cut_joint_type";
        findings.error(node.place, "the loop constraint has no `constraint_axes`", "at least one", help);
    }
    if let Some(seventh) = axes.get(6) {
        let found = format!("the loop constraint has {} constraint_axes", axes.len());
        findings.error(seventh.place, found, "at most six", "remove those that the others imply");
    }
    let mut names: HashSet<String> = HashSet::new();
    for axis in axes {
        row(axis, &mut names, findings);
    }
    let is_placed = placements.iter().all(|(_, placement)| placement.is_some());
    let rows = axes.iter().map(|axis| axis.place).chain(of_type).collect();
    Some(LoopEntry { place: node.place, cut_joint, predecessor, successor, is_placed, rows })
}

fn row(node: &Node, names: &mut HashSet<String>, findings: &mut Findings) {
    if !keys(node, "a constraint axis", ROW, findings) {
        return;
    }
    for key in ["name", "axis"] {
        if node.get(key).is_none() {
            findings.error(node.place, format!("the constraint axis has no `{key}`"), "name and axis", "add it");
        }
    }
    if let Some((name, place)) = word(node, "name", findings)
        && !names.insert(name.clone())
    {
        findings.error(place, format!("a second axis of this loop is named {}", quoted(&name)), "a name of its own", "rename one of them");
    }
    baumgarte(node, findings);
    let axis = numbers::<6>(node, "a constraint axis", "axis", findings);
    if let Some(place) = axis.filter(|axis| *axis == [0.0; 6]).and_then(|_| node.get("axis")).map(|node| node.place) {
        findings.error(place, "the constraint axis is zero", "a direction [wx, wy, wz, vx, vy, vz]", "correct it");
    }
}

/// Checks the keys of a mapping; false when the node is none.
fn keys(node: &Node, of: &str, known: &[&str], findings: &mut Findings) -> bool {
    let Value::Map(entries) = &node.value else {
        let found = format!("{of} is {}", node.describe());
        findings.error(node.place, found, format!("a mapping with the keys {}", known.join(", ")), "correct it");
        return false;
    };
    let mut seen: Vec<&str> = Vec::new();
    for (key, _) in entries {
        let Value::Scalar { text, .. } = &key.value else {
            findings.error(key.place, format!("a key of {of} is {}", key.describe()), known.join(", "), "use a word");
            continue;
        };
        if !known.contains(&text.as_str()) {
            let help = findings.did_you_mean(text, known.iter().copied(), "remove it");
            findings.error(key.place, format!("the key {} of {of} is not known", quoted(text)), known.join(", "), help);
        } else if seen.contains(&text.as_str()) {
            findings.error(key.place, format!("the key {} of {of} is there twice", quoted(text)), "one", "remove one of them");
        } else {
            seen.push(text);
        }
    }
    true
}

/// The text of a key, if the key is there.
pub(super) fn word(node: &Node, key: &str, findings: &mut Findings) -> Option<Named> {
    let value = node.get(key)?;
    word_of(value, key, findings)
}

fn word_of(value: &Node, key: &str, findings: &mut Findings) -> Option<Named> {
    match &value.value {
        Value::Scalar { text, .. } if !text.trim().is_empty() => Some((text.clone(), value.place)),
        _ => {
            findings.error(value.place, format!("`{key}` holds {}", value.describe()), "a name", "write a name");
            None
        }
    }
}

/// The names of a list, if the key is there; nothing counts as an empty list.
fn words(node: &Node, key: &str, findings: &mut Findings) -> Option<Vec<Named>> {
    node.get(key)?;
    let items = list(node, key, findings);
    let names: Vec<Named> = items.iter().filter_map(|item| word_of(item, key, findings)).collect();
    (names.len() == items.len()).then_some(names)
}

fn list<'a>(node: &'a Node, key: &str, findings: &mut Findings) -> &'a [Node] {
    let Some(value) = node.get(key) else { return &[] };
    if !matches!(value.value, Value::List(_) | Value::Null) {
        findings.error(value.place, format!("`{key}` is {}", value.describe()), "a list", format!("write `{key}: [...]`"));
    }
    value.items()
}

/// `N` numbers of a key, if the key is there.
pub(super) fn numbers<const N: usize>(node: &Node, of: &str, key: &str, findings: &mut Findings) -> Option<[f64; N]> {
    let value = node.get(key)?;
    let Value::List(items) = &value.value else {
        findings.error(value.place, format!("`{key}` of {of} is {}", value.describe()), number::expected(N), "write them as a list");
        return None;
    };
    if items.len() != N {
        findings.error(value.place, format!("`{key}` of {of} holds {} values", items.len()), number::expected(N), "correct the list");
    }
    let mut numbers = [0.0; N];
    let mut good = items.len() == N;
    for (i, item) in items.iter().enumerate() {
        match scalar_number(item, key, findings) {
            Some(value) => numbers.get_mut(i).into_iter().for_each(|slot| *slot = value),
            None => good = false,
        }
    }
    good.then_some(numbers)
}

fn scalar_number(item: &Node, key: &str, findings: &mut Findings) -> Option<f64> {
    let fault = match &item.value {
        Value::Scalar { text, plain: true } => match number::number(text) {
            Ok(value) => return Some(value),
            Err(fault) => fault.to_string(),
        },
        Value::Scalar { .. } => format!("{} is a text in quotes", item.describe()),
        _ => format!("{} is not a number", item.describe()),
    };
    findings.error(item.place, format!("`{key}`: {fault}"), number::expected(1), "correct the value");
    None
}

fn baumgarte(node: &Node, findings: &mut Findings) {
    const KEY: &str = "baumgarte_stabilization_parameter";
    if let Some(value) = node.get(KEY) {
        scalar_number(value, KEY, findings);
    }
}
