//! `check --suggest`: a submechanism file that fits a URDF, from one that may not.
//!
//! Names, trees, actuated joints and loops come from the given file; independents are found at
//! generic closed poses, and each type with a closed form that fits the joints is tried on the
//! geometry. Joints in no submechanism become serial ones.

use std::collections::BTreeSet;

use sarrus_dynamics::description::{Description, Joint, JointKind, Submechanism, SubmechanismKind};
use sarrus_dynamics::{
    CLOSED_FORMS, ClosureKind, Diagnostic, Model, fitting_types, joint_orders, suggest_independents,
};

use crate::build;
use crate::contents::Contents;
use crate::error::{LoadError, Outcome};
use crate::load::{Options, load_contents, urdf_alone};
use crate::open::open_contents;
use crate::report::{Diagnostics, Report};
use crate::submechanisms::kind::{KNOWN, Known, freedoms};
use crate::submechanisms::kind_named;
use crate::urdf::Urdf;
use crate::yaml::{self, Node, Value};

/// A submechanism file, and the faults that the robot still has with it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Suggestion {
    /// The file.
    pub yaml: String,
    /// The report of `check` on the robot with this file; no error if it is ready to use.
    pub report: Report,
    /// The robot, and its free joints that are independent in part.
    pub(crate) split: Option<(Description, Vec<usize>)>,
}

/// One submechanism of the new file.
#[derive(Default)]
struct Draft {
    name: String,
    type_name: String,
    tree: Vec<String>,
    independent: Vec<String>,
    active: Vec<String>,
    file_path: Option<String>,
    /// Written out, a line each.
    loops: Vec<String>,
    /// Loops of the URDF tie its joints.
    is_tied: bool,
}

/// The robot's files with a submechanism file of ours.
struct Files<'a> {
    contents: Contents,
    options: &'a Options,
}

impl Files<'_> {
    fn with(&self, drafts: &[Draft], idle: &[String]) -> Option<Contents> {
        let yaml = written(drafts, idle).into_bytes();
        Some(Contents {
            submechanisms: Some(("suggested.yml".to_owned(), yaml)),
            ..self.contents.clone()
        })
    }

    /// The robot with these submechanisms, whose loops may be open.
    fn opened(&self, drafts: &[Draft]) -> Outcome<Description> {
        let diagnostics = Diagnostics::new(self.options.lenient);
        Ok(open_contents(self.with(drafts, &[]), self.options, diagnostics)?.description)
    }

    /// These submechanisms as a file, with the report of `check`.
    fn suggestion(&self, drafts: &[Draft], idle: &[String]) -> Outcome<Suggestion> {
        let diagnostics = Diagnostics::new(self.options.lenient);
        let report = match load_contents(self.with(drafts, idle), self.options, diagnostics) {
            Ok(loaded) => loaded.report,
            Err(LoadError::Faults(report)) => report,
            Err(other) => return Err(other),
        };
        Ok(Suggestion { yaml: written(drafts, idle), report, split: None })
    }
}

/// As [`crate::suggest`]; where `drives_all`, each independent joint of one freedom is active.
pub(crate) fn suggest_for(
    contents: Contents,
    options: &Options,
    drives_all: bool,
) -> Outcome<Suggestion> {
    let (urdf, robot) = urdf_alone(contents.urdf.clone(), options)?;
    let mut drafts = match &contents.submechanisms {
        Some((name, bytes)) => drafts(name, bytes, &robot)?,
        None => Vec::new(),
    };
    let files = Files { contents, options };
    add_tied(&mut drafts, &urdf);
    add_rest(&mut drafts, &robot, &urdf.actuated);
    drafts.iter_mut().for_each(|draft| draft.relax(&robot));

    // types that define their own loops use their order; independents of the others are found
    for k in 0..drafts.len() {
        if drafts[k].defines_loops() {
            let of_type = drafts[k].candidates(&robot);
            let before = drafts[k].independent.clone();
            let found = of_type.into_iter().find(|independent| {
                drafts[k].independent.clone_from(independent);
                files.opened(&drafts).is_ok_and(|open| compiles(&open))
            });
            drafts[k].independent = found.unwrap_or(before);
        }
    }
    let Ok(description) = files.opened(&drafts) else { return files.suggestion(&drafts, &[]) };
    let first = description.submechanisms.len() - drafts.len();
    let Ok(found) = suggest_independents(&description) else {
        return files.suggestion(&drafts, &[]);
    };
    let name = |j: &usize| description.joints[*j].name.clone();
    for (draft, independent) in drafts.iter_mut().zip(found.independent.iter().skip(first)) {
        // couplings in a circle leave more joints independent than those that follow none
        if draft.has_loops() || draft.independent.len() != independent.len() {
            draft.independent = independent.iter().map(name).collect();
        }
    }
    let idle: Vec<String> = found.idle.iter().map(name).collect();
    for draft in drafts.iter_mut().filter(|_| drives_all) {
        let is_single = |name: &&String| {
            let is_it = |joint: &&Joint| joint.name == **name;
            let joint = description.joints.iter().find(is_it);
            joint.is_some_and(|joint| freedoms(Some(joint.kind)) == 1)
        };
        draft.active = draft.independent.iter().filter(is_single).cloned().collect();
    }

    // the closed forms that the geometry has
    for k in 0..drafts.len() {
        if let Some((type_name, tree)) = fitting(&drafts, k, &files) {
            (drafts[k].type_name, drafts[k].tree) = (type_name, tree);
        }
    }
    let mut suggestion = files.suggestion(&drafts, &idle)?;
    let is_free = |j: &usize| description.joints[*j].kind == JointKind::Floating;
    let split: Vec<usize> = found.split.into_iter().filter(is_free).collect();
    suggestion.split = (!split.is_empty()).then_some((description, split));
    Ok(suggestion)
}

fn compiles(description: &Description) -> bool {
    Model::compile(description).is_ok()
}

/// The submechanisms of a file, as far as they can be read.
fn drafts(name: &str, bytes: &[u8], robot: &Description) -> Outcome<Vec<Draft>> {
    let mut diagnostics = Diagnostics::new(false);
    let root = yaml::read(name, bytes.to_vec(), yaml::SUBMECHANISMS, &mut diagnostics);
    let Some(root) = root.filter(|_| !diagnostics.has_errors()) else {
        return Err(LoadError::Faults(diagnostics.into_report()));
    };
    let moves = |name: &String| {
        robot.joints.iter().any(|joint| joint.name == *name && joint.kind != JointKind::Fixed)
    };
    let mut seen = BTreeSet::new();
    let items = root.get("submechanisms").map_or(&[][..], Node::items);
    let of = |(k, node): (usize, &Node)| {
        let text = |node: &Node| node.text().map(str::to_owned);
        let word = |key: &str| node.get(key).and_then(text);
        let words = |key: &str| -> Vec<String> {
            let items = node.get(key).map_or(&[][..], Node::items);
            items.iter().filter_map(text).filter(moves).collect()
        };
        let listed = [words("jointnames_spanningtree"), words("jointnames")];
        let tree = listed.into_iter().find(|list| !list.is_empty()).unwrap_or_default();
        let tree: Vec<String> = tree.into_iter().filter(|name| seen.insert(name.clone())).collect();
        let within = |key: &str| {
            words(key).into_iter().filter(|name| tree.contains(name)).collect::<Vec<_>>()
        };
        let name = word("contextual_name").or(word("name"));
        Draft {
            name: name.unwrap_or_else(|| format!("submechanism_{}", k + 1)),
            type_name: word("type").unwrap_or_default(),
            independent: within("jointnames_independent"),
            active: within("jointnames_active"),
            file_path: word("file_path"),
            loops: node
                .get("loop_constraints")
                .map_or(&[][..], Node::items)
                .iter()
                .map(loop_lines)
                .collect(),
            is_tied: false,
            tree,
        }
    };
    Ok(items.iter().enumerate().map(of).filter(|draft| !draft.tree.is_empty()).collect())
}

/// The joints of the URDF's loops: in the submechanism that has one of them, else in their own.
fn add_tied(drafts: &mut Vec<Draft>, urdf: &Urdf) {
    let above = urdf.above();
    for closing in &urdf.closings {
        let links = closing.links.each_ref().map(|(name, _)| urdf.link_index.get(name).copied());
        let [Some(a), Some(b)] = links else { continue };
        let mut path = urdf.paths(&above, [a, b]).concat();
        path.sort_unstable();
        let names: Vec<String> = path.iter().map(|j| urdf.joints[*j].name.clone()).collect();
        let has_one = |draft: &&mut Draft| names.iter().any(|name| draft.tree.contains(name));
        let actuated = |name: &&String| urdf.actuated.contains(*name);
        let is_free =
            |drafts: &[Draft], name: &String| !drafts.iter().any(|of| of.tree.contains(name));
        let free: Vec<String> =
            names.iter().filter(|name| is_free(drafts, name)).cloned().collect();
        if let Some(draft) = drafts.iter_mut().find(has_one) {
            draft.is_tied = true;
            draft.active.extend(free.iter().filter(actuated).cloned());
            draft.tree.extend(free);
        } else if !names.is_empty() {
            drafts.push(Draft {
                name: closing.name.clone(),
                type_name: "NUMERICAL".to_owned(),
                active: names.iter().filter(actuated).cloned().collect(),
                tree: names,
                is_tied: true,
                ..Draft::default()
            });
        }
    }
}

/// Joints in no submechanism: those that move bodies of a loop belong to it, the others are serial.
fn add_rest(drafts: &mut Vec<Draft>, robot: &Description, actuated: &BTreeSet<String>) {
    let is_listed = |drafts: &[Draft], joint: &Joint| {
        drafts.iter().any(|draft| draft.tree.contains(&joint.name))
    };
    let rest: Vec<&Joint> = robot
        .joints
        .iter()
        .filter(|joint| joint.kind != JointKind::Fixed && !is_listed(drafts, joint))
        .collect();
    if rest.is_empty() {
        return;
    }
    // without an actuator in the file all are driven
    let is_driven = |joint: &&Joint| {
        !matches!(joint.kind, JointKind::Floating | JointKind::Spherical)
            && (actuated.is_empty() || actuated.contains(&joint.name))
    };
    let names = |of: &[&Joint]| of.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
    let free: Vec<&Joint> = rest.iter().copied().filter(|joint| joint.coupling.is_none()).collect();
    drafts.push(Draft {
        name: if drafts.is_empty() { robot.name.clone() } else { "others".to_owned() },
        type_name: "SERIAL".to_owned(),
        tree: names(&rest),
        independent: names(&free),
        active: names(&free.into_iter().filter(is_driven).collect::<Vec<_>>()),
        ..Draft::default()
    });
}

impl Draft {
    fn has_loops(&self) -> bool {
        self.is_tied || !self.loops.is_empty()
    }

    /// Chooses a type that accepts any independents.
    fn relax(&mut self, robot: &Description) {
        let joint = |name: &String| robot.joints.iter().find(|joint| joint.name == *name);
        let coupled = |name: &&String| joint(name).is_some_and(|joint| joint.coupling.is_some());
        if self.has_loops() {
            self.type_name = "NUMERICAL".to_owned();
        } else if self.tree.iter().any(|name| coupled(&name)) {
            self.type_name = "TRANSMISSION".to_owned();
            self.independent = self.tree.iter().filter(|name| !coupled(name)).cloned().collect();
        } else if let Some((type_name, tree)) = self.other_type(robot) {
            (self.type_name, self.tree) = (type_name, tree);
        } else if !self.needs_loops() && self.file_path.is_none() {
            self.type_name = "SERIAL".to_owned();
            self.independent.clone_from(&self.tree);
        }
    }

    /// True where the type, or the number of independents of an unknown one, says that there are
    /// loops.
    fn needs_loops(&self) -> bool {
        match kind_named(&self.type_name) {
            Some((kind, _)) => kind != SubmechanismKind::Serial,
            None => !self.independent.is_empty() && self.independent.len() < self.tree.len(),
        }
    }

    /// The type that defines the loops of these three joints, if it is not the given one, with the
    /// order of the joints.
    fn other_type(&self, robot: &Description) -> Option<(String, Vec<String>)> {
        let index = |name: &String| robot.joints.iter().position(|joint| joint.name == *name);
        let spanning_tree: Vec<usize> = self.tree.iter().map(index).collect::<Option<_>>()?;
        let is_free = !self.needs_loops() && [0, self.tree.len()].contains(&self.independent.len());
        if spanning_tree.len() != 3 || is_free {
            return None;
        }
        let part = build::group(self.name.clone(), SubmechanismKind::Numerical, spanning_tree);
        let submechanism = Submechanism { type_name: self.type_name.clone(), ..part };
        let (fitting, order) = fitting_types(robot, &submechanism).into_iter().next()?;
        let tree = order.iter().map(|j| robot.joints[*j].name.clone()).collect();
        let is_given = self.known().is_some_and(|known| {
            KNOWN.iter().any(|of| of.name == fitting && of.kind == known.kind)
        });
        (!is_given || self.tree != tree).then(|| (fitting.to_owned(), tree))
    }

    fn known(&self) -> Option<&'static Known> {
        KNOWN.iter().find(|known| known.name == self.type_name)
    }

    /// True if the loops are those of the type.
    fn defines_loops(&self) -> bool {
        use SubmechanismKind::{Rrpr, SliderCrank, Sprr2U1, Spu2U1, Ups6};
        !self.has_loops()
            && self.known().is_some_and(|known| {
                matches!(known.kind, Rrpr | SliderCrank | Spu2U1 | Sprr2U1 | Ups6)
            })
    }

    /// Independents that a type which defines its loops can have, the declared ones first.
    fn candidates(&self, robot: &Description) -> Vec<Vec<String>> {
        let count = self.known().and_then(|known| known.independent).unwrap_or_default();
        let mut found = vec![self.independent.clone()];
        if count == 1 {
            found.extend(self.tree.iter().map(|name| vec![name.clone()]));
        }
        // joints in no leg, where a leg is a slider and the two joints below it
        let joint = |name: &String| robot.joints.iter().find(|joint| joint.name == *name);
        let mut legs: BTreeSet<&str> = BTreeSet::new();
        for name in &self.tree {
            let Some(slider) = joint(name).filter(|joint| joint.kind == JointKind::Prismatic)
            else {
                continue;
            };
            let mut link = slider.parent;
            let mut carriers = 0;
            let carrier = |link: usize| robot.joints.iter().find(|joint| joint.child == link);
            legs.insert(name);
            while let Some(joint) = carrier(link).filter(|_| carriers < 2) {
                if joint.kind != JointKind::Fixed {
                    legs.insert(&joint.name);
                    carriers += 1;
                }
                link = joint.parent;
            }
        }
        let rest = self.tree.iter().filter(|name| !legs.contains(name.as_str()));
        found.push(rest.take(count).cloned().collect());
        found.push(self.tree.iter().take(count).cloned().collect());
        found
    }

    /// The entry in the file.
    fn lines(&self) -> String {
        let names = |of: &[String]| of.iter().map(|name| word(name)).collect::<Vec<_>>().join(", ");
        let mut text =
            format!("- type: {}\n  contextual_name: {}\n", self.type_name, word(&self.name));
        if let Some(path) = &self.file_path {
            text += &format!("  file_path: {}\n", word(path));
        }
        text += &format!("  jointnames_spanningtree: [{}]\n", names(&self.tree));
        text += &format!("  jointnames_independent: [{}]\n", names(&self.independent));
        text += &format!("  jointnames_active: [{}]\n", names(&self.active));
        if !self.loops.is_empty() {
            text += "  loop_constraints:\n";
            text += &self.loops.concat();
        }
        text
    }
}

/// The first type whose closed form fits the k-th submechanism, with the order of its joints.
fn fitting(drafts: &[Draft], k: usize, files: &Files<'_>) -> Option<(String, Vec<String>)> {
    if !drafts[k].has_loops() {
        return None;
    }
    let given = files.opened(drafts).ok()?;
    let s = given.submechanisms.len() - drafts.len() + k;
    // a comparison needs a robot that can be closed numerically
    if !compiles(&given) {
        return None;
    }
    let joints = &given.submechanisms[s].spanning_tree;
    let dofs: usize = joints.iter().map(|j| freedoms(Some(given.joints[*j].kind))).sum();
    let orders = joint_orders(joints);
    for (name, kind) in CLOSED_FORMS {
        let known = KNOWN.iter().find(|known| known.kind == kind)?;
        if !known.tree.is_empty() && !known.tree.contains(&dofs) {
            continue;
        }
        for order in &orders {
            let mut trial = given.clone();
            let of = &mut trial.submechanisms[s];
            (of.kind, of.type_name) = (kind, name.to_owned());
            of.spanning_tree.clone_from(order);
            let is_closed = Model::compile(&trial).is_ok_and(|compiled| {
                let is_other = |of: &Diagnostic| of.found.contains("its geometry is that of");
                compiled.model.closures()[s].kind == ClosureKind::Analytic
                    && !compiled.warnings.iter().any(is_other)
            });
            if is_closed {
                let tree = order.iter().map(|j| given.joints[*j].name.clone()).collect();
                return Some((name.to_owned(), tree));
            }
        }
    }
    None
}

/// The file.
fn written(drafts: &[Draft], idle: &[String]) -> String {
    let mut text = String::new();
    if !idle.is_empty() {
        let joints = idle.join(", ");
        text += &format!("# rods that spin idly, by the joint that stands still: {joints}\n");
    }
    text += "submechanisms:\n";
    text + &drafts.iter().map(Draft::lines).collect::<String>()
}

/// A loop constraint, key by key.
fn loop_lines(node: &Node) -> String {
    let Value::Map(entries) = &node.value else { return format!("  - {}\n", flow(node)) };
    let mut text = String::new();
    for (k, (key, value)) in entries.iter().enumerate() {
        text += if k == 0 { "  - " } else { "    " };
        text += &format!("{}:", flow(key));
        match &value.value {
            Value::List(items) if items.iter().any(|item| matches!(item.value, Value::Map(_))) => {
                text += "\n";
                items.iter().for_each(|item| text += &format!("    - {}\n", flow(item)));
            }
            _ => text += &format!(" {}\n", flow(value)),
        }
    }
    text
}

/// A value on one line.
fn flow(node: &Node) -> String {
    match &node.value {
        Value::Null => "~".to_owned(),
        Value::Scalar { text, plain: true } => word(text),
        Value::Scalar { text, .. } => in_quotes(text),
        Value::List(items) => {
            format!("[{}]", items.iter().map(flow).collect::<Vec<_>>().join(", "))
        }
        Value::Map(entries) => {
            let pair = |(key, value): &(Node, Node)| format!("{}: {}", flow(key), flow(value));
            format!("{{{}}}", entries.iter().map(pair).collect::<Vec<_>>().join(", "))
        }
    }
}

/// A word as a list item; in quotes if it is ambiguous.
pub(crate) fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-+./".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) { text.to_owned() } else { in_quotes(text) }
}

fn in_quotes(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}
