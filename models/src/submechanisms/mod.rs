//! Submechanism files: a walk over the text with positions, checks against the URDF, and the values
//! by serde.

pub(crate) mod cut;
pub(crate) mod kind;
mod values;
mod walk;

use std::collections::{BTreeMap, BTreeSet};

use sarrus_dynamics::description::{JointKind, SubmechanismKind};

pub(crate) use values::{Document, EntryValues, LoopValues, PlacementValues};
pub(crate) use walk::{Entry, LoopEntry, walk};

use crate::report::{Diagnostics, Span, quoted};
use crate::text::Text;
use crate::urdf::Urdf;
use crate::yaml::Named;
use kind::{KNOWN, Known, Letters, freedoms, letters};

/// Most rows of all loops together: their matrices are dense.
pub(crate) const MOST_ROWS: usize = 1024;

/// A submechanism file, checked against the robot.
pub(crate) struct Submechanisms {
    pub(crate) span: Span,
    pub(crate) entries: Vec<Entry>,
}

/// Checks the entries of a file and, given a robot, their names.
pub(crate) fn check(
    span: Span,
    mut entries: Vec<Entry>,
    urdf: Option<&Urdf>,
    diagnostics: &mut Diagnostics,
) -> Submechanisms {
    if let Some(urdf) = urdf.filter(|urdf| !urdf.parts.is_empty()) {
        entries.iter_mut().for_each(|entry| entry.expand(urdf));
    }
    let mut names: BTreeSet<&str> = BTreeSet::new();
    for (name, span) in entries.iter().filter_map(|entry| entry.name.as_ref()) {
        if !names.insert(name) {
            let found = format!("a second submechanism is named {}", quoted(name));
            diagnostics.error(*span, found, "a contextual_name of its own", "rename one of them");
        }
    }
    let mut owner: BTreeMap<&str, &Entry> = BTreeMap::new();
    for entry in &entries {
        let written = entry.type_name.as_ref();
        let kind = written.and_then(|(written, span)| kind_of(written, *span, diagnostics));
        Check { urdf, entry, kind, diagnostics }.run(&mut owner);
    }
    let all_read = !entries.is_empty() && entries.iter().all(|entry| entry.tree.is_some());
    for joint in urdf.into_iter().flat_map(|urdf| &urdf.joints).filter(|_| all_read) {
        let moves = joint.kind.is_some_and(|kind| kind != JointKind::Fixed);
        if moves && !joint.name.is_empty() && !owner.contains_key(joint.name.as_str()) {
            let found =
                format!("the joint {} moves but is in no submechanism", quoted(&joint.name));
            let help = "add it to a jointnames_spanningtree or make it fixed; it is read as \
                serial, independent and active";
            diagnostics.warning(joint.span, found, "every moving joint in one", help);
        }
    }
    let rows: usize =
        entries.iter().flat_map(|entry| &entry.loops).map(|each| each.rows.len()).sum();
    if rows > MOST_ROWS {
        let found = format!("the loops have {rows} constraint_axes");
        let help = "split the robot into robots of their own";
        diagnostics.error(span, found, format!("at most {MOST_ROWS}"), help);
    }
    Submechanisms { span, entries }
}

/// The values of a file whose walk found no error; `None` after an error.
pub(crate) fn values(text: &Text, diagnostics: &mut Diagnostics) -> Option<Vec<EntryValues>> {
    match serde_yaml::from_str::<Document>(&text.content) {
        Ok(document) => Some(document.submechanisms),
        Err(error) => {
            let span = error.location().map_or(Span::start(text.file), |at| Span {
                file: text.file,
                line: at.line() as u32,
                column: at.column() as u32,
            });
            let found = format!("the values cannot be read: {error}");
            let help = "correct it at this position";
            diagnostics.refused(span, found, "a submechanism file", help)
        }
    }
}

/// The kind of a type and, for letter runs, its letters.
pub(crate) fn kind_named(written: &str) -> Option<(SubmechanismKind, Option<Letters>)> {
    let known = KNOWN.iter().find(|known| known.name == written).map(|known| (known.kind, None));
    known.or_else(|| letters(written).map(|letters| (SubmechanismKind::Serial, Some(letters))))
}

fn kind_of(written: &str, span: Span, diagnostics: &mut Diagnostics) -> Option<SubmechanismKind> {
    let kind = kind_named(written).map(|(kind, _)| kind);
    if kind.is_none() {
        let names = KNOWN.iter().map(|known| known.name);
        let expected =
            names.clone().collect::<Vec<_>>().join(", ") + ", or joints in letters as 3R or 3T+3R";
        let found = format!("the submechanism type {} is not known", quoted(written));
        let help = "use NUMERICAL with loop_constraints for any other mechanism";
        diagnostics.unknown(span, found, expected, written, names, help);
    }
    kind
}

/// "1 joint", "2 joints".
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// The checks of one submechanism against the robot.
struct Check<'a, 'f> {
    urdf: Option<&'a Urdf>,
    entry: &'a Entry,
    kind: Option<SubmechanismKind>,
    diagnostics: &'f mut Diagnostics,
}

impl<'a> Check<'a, '_> {
    fn run(&mut self, owner: &mut BTreeMap<&'a str, &'a Entry>) {
        let entry = self.entry;
        self.names(entry.all.as_deref(), "jointnames", false);
        self.names(entry.tree.as_deref(), "jointnames_spanningtree", true);
        self.within_tree(entry.independent.as_deref(), "jointnames_independent");
        self.within_tree(entry.active.as_deref(), "jointnames_active");
        for (name, span) in entry.tree.iter().flatten() {
            match owner.get(name.as_str()) {
                Some(first) if !core::ptr::eq(*first, entry) => {
                    let other =
                        first.name.as_ref().map(|(name, _)| quoted(name)).unwrap_or_default();
                    let found = format!(
                        "the joint {} is already in the submechanism {other}",
                        quoted(name)
                    );
                    let help = "remove it from one of them";
                    self.diagnostics.error(*span, found, "each joint in one", help);
                }
                _ => {
                    owner.insert(name, entry);
                }
            }
        }
        self.counts();
        let mut cuts: BTreeSet<[Option<&str>; 3]> = BTreeSet::new();
        for each in &entry.loops {
            self.loop_names(each);
            let cut = [&each.cut_joint, &each.predecessor, &each.successor]
                .map(|name| name.as_ref().map(|(name, _)| name.as_str()));
            if !cuts.insert(cut) && cut.iter().all(Option::is_some) {
                let found = format!(
                    "a second loop is cut at {} between the same bodies",
                    quoted(cut[0].unwrap_or_default())
                );
                self.diagnostics.error(each.span, found, "one", "join their constraint_axes");
            }
        }
    }

    /// Each name exists, moves if it must, and occurs once.
    fn names(&mut self, names: Option<&'a [Named]>, key: &str, must_move: bool) {
        let mut seen: BTreeSet<&str> = BTreeSet::new();
        for (name, span) in names.into_iter().flatten() {
            if !seen.insert(name) {
                self.twice(name, *span, key);
                continue;
            }
            let Some(urdf) = self.urdf else { continue };
            match urdf.joint_index.get(name) {
                None => {
                    let found =
                        format!("`{key}` names the joint {}, which does not exist", quoted(name));
                    let known = urdf.joint_names();
                    let help = "correct the name or add the joint to the URDF";
                    let expected = "a joint of the URDF";
                    self.diagnostics.unknown(*span, found, expected, name, known, help);
                }
                Some(joint) if must_move && !urdf.moves(*joint) => {
                    let found = format!("`{key}` names the joint {}, which is fixed", quoted(name));
                    let help = "remove it from the list";
                    self.diagnostics.error(*span, found, "joints that move", help);
                }
                Some(_) => {}
            }
        }
    }

    /// Each name is in the spanning tree, once.
    fn within_tree(&mut self, names: Option<&'a [Named]>, key: &str) {
        let mut seen: BTreeSet<&str> = BTreeSet::new();
        let tree = self.entry.tree.as_ref();
        let tree: Option<BTreeSet<&str>> =
            tree.map(|tree| tree.iter().map(|(name, _)| name.as_str()).collect());
        for (name, span) in names.into_iter().flatten() {
            if !seen.insert(name) {
                self.twice(name, *span, key);
            } else if let Some(tree) = &tree
                && !tree.contains(name.as_str())
            {
                let found =
                    format!("`{key}` names {}, which is not in the spanning tree", quoted(name));
                let expected = "names of jointnames_spanningtree";
                // a name of the tree that the URDF lacks is the slip, not the help
                let exists =
                    |name: &str| self.urdf.is_none_or(|urdf| urdf.joint_index.contains_key(name));
                let is_slip = self.urdf.is_none() || !exists(name);
                let known = tree.iter().copied().filter(|other| is_slip && exists(other));
                let help = "add it to jointnames_spanningtree or remove it";
                self.diagnostics.unknown(*span, found, expected, name, known, help);
            }
        }
    }

    fn twice(&mut self, name: &str, span: Span, key: &str) {
        let found = format!("{} is in `{key}` twice", quoted(name));
        self.diagnostics.error(span, found, "once", "remove one of them");
    }

    /// The numbers of joints that the type requires.
    fn counts(&mut self) {
        let (Some(kind), Some(type_name), Some(tree), Some(independent)) =
            (self.kind, &self.entry.type_name, &self.entry.tree, &self.entry.independent)
        else {
            return;
        };
        let written = quoted(&type_name.0);
        let span = type_name.1;
        if tree.is_empty() {
            let expected = "at least one in jointnames_spanningtree";
            let found = "the submechanism has no joint";
            self.diagnostics.error(span, found, expected, "add joints or remove it");
            return;
        }
        if let Some(known) = KNOWN.iter().find(|known| known.name == type_name.0) {
            // a joint of several freedoms counts once for each
            let [in_tree, in_independent] = [tree, independent].map(|names| self.dofs(names));
            if !known.tree.is_empty() && !known.tree.contains(&in_tree) {
                let found = format!("{written} with {}", counted(in_tree, "spanning-tree joint"));
                let expected =
                    known.tree.iter().map(usize::to_string).collect::<Vec<_>>().join(" or ");
                let has = |of: &&Known| {
                    of.tree.contains(&in_tree) && of.independent == Some(in_independent)
                };
                let fits = KNOWN.iter().filter(has).map(|of| of.name).chain(["NUMERICAL"]);
                let fits: Vec<&str> = fits.collect();
                let help = format!("correct jointnames_spanningtree or use {}", fits.join(" or "));
                self.diagnostics.error(span, found, expected, help);
            }
            if let Some(count) = known.independent.filter(|count| *count != in_independent) {
                let found =
                    format!("{written} with {}", counted(in_independent, "independent joint"));
                let help = "correct jointnames_independent";
                self.diagnostics.error(span, found, count.to_string(), help);
            }
        }
        // the URDF may hold its loops
        if kind == SubmechanismKind::Numerical
            && self.entry.loops.is_empty()
            && self.coupled(tree) == 0
            && self.urdf.is_none_or(|urdf| urdf.closings.is_empty())
        {
            let found = "NUMERICAL without `loop_constraints`";
            let help = "add loop_constraints";
            self.diagnostics.error(self.entry.span, found, "at least one loop", help);
        }
        if kind == SubmechanismKind::Transmission && self.entry.loops.is_empty() {
            self.transmission(tree, independent);
        }
        if kind == SubmechanismKind::Serial {
            self.serial(&type_name.0, span, tree, independent);
        }
    }

    /// Each dependent joint of a transmission has a coupling.
    fn transmission(&mut self, tree: &'a [Named], independent: &'a [Named]) {
        let needed = tree.len().saturating_sub(independent.len());
        let is_short = self.urdf.is_some() && self.coupled(tree) < needed;
        let Some((name, span)) = self.entry.type_name.as_ref().filter(|_| is_short) else { return };
        let found = format!(
            "{} of {}, of which URDF couples {}",
            quoted(name),
            counted(needed, "dependent joint"),
            self.coupled(tree)
        );
        let help =
            "add <mimic> or <transmission> with <depends_on> to it, or to the file of `file_path`";
        self.diagnostics.error(*span, found, "a coupling for each", help);
    }

    /// A serial submechanism has no loop, every joint of it is independent or coupled, and its
    /// letters fit.
    fn serial(&mut self, written: &str, span: Span, tree: &'a [Named], independent: &'a [Named]) {
        if let Some(first) = self.entry.loops.first() {
            let found = format!("the serial type {} has loop constraints", quoted(written));
            let help = "use NUMERICAL or the type of the mechanism";
            self.diagnostics.error(first.span, found, "none", help);
        }
        let free = tree.len() - self.coupled(tree).min(tree.len());
        if self.urdf.is_some() && independent.len() != free && independent.len() != tree.len() {
            let found = format!(
                "the serial type {} with {} of {} joints independent",
                quoted(written),
                independent.len(),
                tree.len()
            );
            let help = "list every joint in jointnames_independent";
            self.diagnostics.error(span, found, "all of them", help);
        }
        let Some(letters) = letters(written) else { return };
        let Some(urdf) = self.urdf else { return };
        let kinds = tree.iter().filter_map(|(name, _)| urdf.joint(name)?.kind);
        let mut actual = Letters::default();
        let mut known = 0;
        for kind in kinds {
            known += 1;
            match kind {
                JointKind::Revolute | JointKind::Continuous => actual.rotations += 1,
                JointKind::Prismatic => actual.translations += 1,
                JointKind::Spherical => actual.rotations += 3,
                JointKind::Floating => {
                    actual.rotations += 3;
                    actual.translations += 3;
                }
                _ => {}
            }
        }
        if known != tree.len() || actual == letters {
            return;
        }
        let actual_counts =
            [counted(actual.rotations, "rotation"), counted(actual.translations, "translation")];
        let found =
            format!("the type {} stands over {}", quoted(written), actual_counts.join(" and "));
        let expected = format!("{} and {}", letters.rotations, letters.translations);
        if actual.rotations + actual.translations == letters.rotations + letters.translations {
            let help = "correct the type; it is read as serial";
            self.diagnostics.warning(span, found, expected, help);
        } else {
            let help = "correct the type or jointnames_spanningtree";
            self.diagnostics.error(span, found, expected, help);
        }
    }

    /// Number of freedoms of these joints.
    fn dofs(&self, names: &[Named]) -> usize {
        let kind = |name: &String| self.urdf.and_then(|urdf| urdf.joint(name)?.kind);
        names.iter().map(|(name, _)| freedoms(kind(name))).sum()
    }

    /// Number of these joints that follow others.
    fn coupled(&self, names: &[Named]) -> usize {
        let Some(urdf) = self.urdf else { return 0 };
        let joints = names.iter().filter_map(|(name, _)| urdf.joint(name));
        joints.filter(|joint| !joint.masters.is_empty()).count()
    }

    /// The bodies of a loop exist and differ; a cut joint without a frame is reported.
    fn loop_names(&mut self, each: &LoopEntry) {
        let Some(urdf) = self.urdf else { return };
        for (end, key) in
            [(&each.predecessor, "predecessor_body"), (&each.successor, "successor_body")]
        {
            let Some((name, span)) = end else { continue };
            if !urdf.link_index.contains_key(name) {
                let found =
                    format!("`{key}` names the link {}, which does not exist", quoted(name));
                let expected =
                    self.diagnostics.one_of("a link of the URDF", name, urdf.link_names());
                let known = urdf.link_names();
                self.diagnostics.unknown(*span, found, expected, name, known, "correct the name");
            }
        }
        let (Some((predecessor, _)), Some((successor, span))) =
            (&each.predecessor, &each.successor)
        else {
            return;
        };
        if predecessor == successor {
            let found = format!("{} is both predecessor and successor", quoted(successor));
            self.diagnostics.error(*span, found, "two bodies", "correct one of them");
        }
        let has_no_frame =
            |(cut, _): &&Named| !each.is_placed && !urdf.joint_index.contains_key(cut);
        if let Some((cut, span)) = each.cut_joint.as_ref().filter(has_no_frame) {
            let found = format!(
                "the cut joint {} is no joint of the URDF, so the frame of {} is taken",
                quoted(cut),
                quoted(predecessor)
            );
            let otherwise = "name a joint, or give predecessor_placement and successor_placement";
            let help = self.diagnostics.did_you_mean(cut, urdf.joint_names(), otherwise);
            self.diagnostics.warning(*span, found, "the frame of a joint", help);
        }
    }
}
