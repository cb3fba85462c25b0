#![doc = include_str!("closures.md")]

use sarrus_dynamics::description::SubmechanismKind;

use crate::submechanisms::kind::KNOWN;

/// Where the closure of a type is singular: its dependents cannot be distinguished from its
/// independents there.
pub(crate) fn singular(kind: SubmechanismKind) -> &'static str {
    let name = KNOWN.iter().find(|known| known.kind == kind).map(|known| known.name);
    let mut rows = include_str!("singular.tsv").lines().filter_map(|row| row.split_once('\t'));
    rows.find(|(of, _)| Some(*of) == name).map_or("", |(_, poses)| poses)
}
