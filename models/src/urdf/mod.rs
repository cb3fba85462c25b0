//! URDF: a strict walk over the text with positions, and the numbers by urdf-rs.

mod compound;
mod dynamics;
mod guard;
mod joint;
mod link;
mod topology;
mod transmission;
mod values;
mod xml;

use std::collections::{BTreeMap, BTreeSet};

use sarrus_dynamics::description::JointKind;

pub(crate) use joint::JointEntry;
pub(crate) use link::{LinkEntry, Weight};
pub(crate) use values::{Values, values};

use crate::report::{Diagnostics, Span, quoted};
use crate::text::Text;
use dynamics::Rotor;
use transmission::Dependence;
use xml::{Reader, Shape};

const ROBOT: Shape = Shape {
    attributes: &["name", "version"],
    once: &[],
    many: &["link", "joint", "transmission"],
    ignored: &[
        "material",
        "gazebo",
        "ros2_control",
        "sensor",
        "loop_joint",
        "group",
        "self_collision_checking",
    ],
};

/// Largest robot: its matrices are dense.
const MOST_LINKS: usize = 4096;
const MOST_JOINTS: usize = 1024;

/// A URDF file as it stands, with positions; the numbers follow in [`Values`].
pub(crate) struct Urdf {
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) links: Vec<LinkEntry>,
    pub(crate) joints: Vec<JointEntry>,
    pub(crate) link_index: BTreeMap<String, usize>,
    pub(crate) joint_index: BTreeMap<String, usize>,
    /// The joints that a joint of several axes consists of, by its name.
    pub(crate) parts: BTreeMap<String, Vec<String>>,
    /// Names of joints as they stand in the file.
    written_joints: Vec<String>,
    /// Byte ranges that no part of sarrus reads.
    unread: Vec<core::ops::Range<usize>>,
    /// Byte ranges of values that urdf-rs knows by another name.
    replaced: Vec<(core::ops::Range<usize>, &'static str)>,
}

/// The version that the robot element states; before 1.1 there are no quaternions, before 1.2
/// limits are not optional.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Version(u32, u32);

impl Version {
    fn parse(written: Option<&str>) -> Option<Version> {
        let Some(written) = written else { return Some(Version(1, 0)) };
        let (major, minor) = written.trim().split_once('.')?;
        Some(Version(major.parse().ok()?, minor.parse().ok()?))
    }

    fn has_quaternions(self) -> bool {
        self >= Version(1, 1)
    }

    fn has_optional_limits(self) -> bool {
        self >= Version(1, 2)
    }
}

impl Urdf {
    /// Walks the text; `None` when it is no URDF file at all, which has been reported.
    pub(crate) fn read(text: &Text, diagnostics: &mut Diagnostics) -> Option<Urdf> {
        let document = xml::parse(text, diagnostics)?;
        let mut reader = Reader::new(text, diagnostics, Version(1, 0));
        let root = document.root_element();
        let span = reader.span(root);
        if !root.has_tag_name("robot") {
            let found = format!("the outermost element is {}", quoted(root.tag_name().name()));
            reader.diagnostics.error(
                span,
                found,
                "`robot`",
                "give a URDF file (expand xacro files, convert SDF or MJCF first)",
            );
            return None;
        }
        let name = reader.required(root, "name").map(|(name, _)| name).unwrap_or_default();
        reader.version = Version::parse(root.attribute("version"))
            .filter(|version| version.0 == 1)
            .unwrap_or_else(|| {
                let found = format!(
                    "the version {} of `robot`",
                    quoted(root.attribute("version").unwrap_or_default())
                );
                reader.diagnostics.error(span, found, "1.0, 1.1 or 1.2", "correct it");
                Version(1, 0)
            });
        let mut urdf = Urdf {
            name,
            span,
            links: Vec::new(),
            joints: Vec::new(),
            link_index: BTreeMap::new(),
            joint_index: BTreeMap::new(),
            parts: BTreeMap::new(),
            written_joints: Vec::new(),
            unread: Vec::new(),
            replaced: Vec::new(),
        };
        let mut rotors: Vec<Rotor> = Vec::new();
        let mut dependences: Vec<Dependence> = Vec::new();
        for node in reader.children(root, &ROBOT) {
            match node.tag_name().name() {
                "link" => urdf.links.push(link::read(&mut reader, node)),
                "joint" => {
                    let source = urdf.joints.len();
                    urdf.joints.push(joint::read(&mut reader, node, source));
                }
                _ => {
                    dependences.extend(transmission::read(&mut reader, node));
                    rotors.extend(dynamics::rotors(&mut reader, node));
                    reader.unread.push(node.range());
                }
            }
        }
        urdf.written_joints = urdf.joint_names().map(str::to_owned).collect();
        (urdf.joints, urdf.parts) =
            compound::expand(std::mem::take(&mut urdf.joints), &mut urdf.links, reader.diagnostics);
        urdf.index_names(reader.diagnostics);
        urdf.couple(dependences, reader.diagnostics);
        urdf.add_rotors(&rotors, &mut reader);
        let moving = (0..urdf.joints.len()).filter(|joint| urdf.moves(*joint)).count();
        for (count, most, what) in
            [(urdf.links.len(), MOST_LINKS, "links"), (moving, MOST_JOINTS, "moving joints")]
        {
            if count > most {
                let help = "split it into robots of their own, or leave out what does not move";
                reader.diagnostics.error(
                    span,
                    format!("the robot has {count} {what}"),
                    format!("at most {most}"),
                    help,
                );
            }
        }
        let is_root = topology::check(&urdf, reader.diagnostics);
        for (link, is_root) in urdf.links.iter().zip(is_root) {
            link::check(&mut reader, link, is_root);
        }
        (urdf.unread, urdf.replaced) = (reader.unread, reader.replaced);
        Some(urdf)
    }

    /// Takes over the couplings of another URDF, that of a submechanism alone, for those of
    /// `joints` that have none yet.
    pub(crate) fn couple_from(
        &mut self,
        text: &Text,
        joints: &BTreeSet<&str>,
        diagnostics: &mut Diagnostics,
    ) {
        let Some(document) = xml::parse(text, diagnostics) else { return };
        let mut reader = Reader::new(text, diagnostics, Version(1, 2));
        let mut dependences: Vec<Dependence> = Vec::new();
        for node in document.root_element().children() {
            if node.has_tag_name("transmission") {
                dependences.extend(transmission::read(&mut reader, node));
            } else if node.has_tag_name("joint") {
                dependences.extend(transmission::of_mimic(&mut reader, node));
            }
        }
        let missing = |dependence: &Dependence| {
            joints.contains(dependence.joint.as_str())
                && self.joint(&dependence.joint).is_some_and(|joint| joint.masters.is_empty())
        };
        dependences.retain(missing);
        self.couple(dependences, diagnostics);
    }

    /// Whether this joint moves; a joint of unknown type may.
    pub(crate) fn moves(&self, joint: usize) -> bool {
        self.joints.get(joint).is_some_and(|joint| joint.kind != Some(JointKind::Fixed))
    }

    /// The joint of a name.
    pub(crate) fn joint(&self, name: &str) -> Option<&JointEntry> {
        self.joint_index.get(name).and_then(|joint| self.joints.get(*joint))
    }

    /// Names of the links in the order of the file.
    pub(crate) fn link_names(&self) -> impl Iterator<Item = &str> {
        self.links.iter().map(|link| link.name.as_str())
    }

    /// Names of the joints in the order of the file.
    pub(crate) fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.joints.iter().map(|joint| joint.name.as_str())
    }

    fn index_names(&mut self, diagnostics: &mut Diagnostics) {
        for (i, link) in self.links.iter().enumerate().filter(|(_, link)| !link.name.is_empty()) {
            if self.link_index.contains_key(&link.name) {
                diagnostics.error(
                    link.span,
                    format!("a second link is named {}", quoted(&link.name)),
                    "a name of its own",
                    "rename one of them",
                );
            } else {
                self.link_index.insert(link.name.clone(), i);
            }
        }
        for (i, joint) in self.joints.iter().enumerate().filter(|(_, joint)| !joint.name.is_empty())
        {
            if self.joint_index.contains_key(&joint.name) {
                let found = format!("a second joint is named {}", quoted(&joint.name));
                diagnostics.error(joint.span, found, "a name of its own", "rename one of them");
            } else {
                self.joint_index.insert(joint.name.clone(), i);
            }
        }
        // the frame of the whole is that of its last part
        for (name, parts) in &self.parts {
            let last = parts.last().and_then(|last| self.joint_index.get(last)).copied();
            if self.joint_index.contains_key(name) {
                let found = format!("a second joint is named {}", quoted(name));
                diagnostics.error(self.span, found, "a name of its own", "rename one of them");
            } else if let Some(last) = last {
                self.joint_index.insert(name.clone(), last);
            }
        }
    }

    /// Whether a name is that of a joint of several axes, which couples nothing; reports it.
    fn is_compound(&self, name: &str, span: Span, diagnostics: &mut Diagnostics) -> bool {
        let Some(parts) = self.parts.get(name) else { return false };
        let found = format!("the joint {}, which has several axes", quoted(name));
        let help = "name one of them";
        diagnostics.error(span, found, format!("one of {}", parts.join(", ")), help);
        true
    }

    /// Hands the dependences of transmissions to their joints.
    fn couple(&mut self, dependences: Vec<Dependence>, diagnostics: &mut Diagnostics) {
        for dependence in dependences {
            if self.is_compound(&dependence.joint, dependence.span, diagnostics) {
                continue;
            }
            let joint = self.joint_index.get(&dependence.joint).copied();
            match joint.and_then(|joint| self.joints.get_mut(joint)) {
                None => {
                    let found = format!(
                        "the transmission names the joint {}, which does not exist",
                        quoted(&dependence.joint)
                    );
                    let help = diagnostics.did_you_mean(
                        &dependence.joint,
                        self.joint_names(),
                        "correct the name",
                    );
                    diagnostics.error(dependence.span, found, "a joint of this file", help);
                }
                Some(joint) if !joint.masters.is_empty() => {
                    let found =
                        format!("the joint {} is coupled a second time", quoted(&joint.name));
                    diagnostics.error(
                        dependence.span,
                        found,
                        "one mimic or one transmission",
                        "remove one of them",
                    );
                }
                Some(joint) => joint.masters = dependence.masters,
            }
        }
    }

    /// Hands the rotors of transmissions to their joints.
    fn add_rotors(&mut self, rotors: &[Rotor], reader: &mut Reader<'_, '_>) {
        for rotor in rotors {
            if self.is_compound(&rotor.joint, rotor.span, reader.diagnostics) {
                continue;
            }
            let joint = self.joint_index.get(&rotor.joint).copied();
            let Some(joint) = joint.and_then(|joint| self.joints.get_mut(joint)) else {
                let found = format!(
                    "the rotor belongs to the joint {}, which does not exist",
                    quoted(&rotor.joint)
                );
                let help = reader.diagnostics.did_you_mean(
                    &rotor.joint,
                    self.joint_names(),
                    "correct the name",
                );
                reader.diagnostics.error(rotor.span, found, "a joint of this file", help);
                continue;
            };
            let mut terms = joint.terms;
            if !rotor.join(&mut terms) {
                let found = format!("the joint {} has a second rotor", quoted(&joint.name));
                reader.diagnostics.error(
                    rotor.span,
                    found,
                    "one",
                    "add both inertias up, each times its ratio squared",
                );
            } else if dynamics::accepts(reader, rotor.span, joint.kind, &joint.name, &terms) {
                joint.terms = terms;
            }
        }
    }

    /// Checks every coupling; what is left of one on a joint that does not move is taken off.
    pub(crate) fn check_couplings(&mut self, diagnostics: &mut Diagnostics) {
        for joint in &mut self.joints {
            if joint.kind == Some(JointKind::Fixed) && !joint.masters.is_empty() {
                let found = format!("the fixed joint {} is coupled", quoted(&joint.name));
                let help = "remove the mimic or change the type; the coupling is not read";
                diagnostics.warning(joint.span, found, "a joint that moves", help);
                joint.masters.clear();
            }
        }
        for joint in &self.joints {
            for master in &joint.masters {
                if self.is_compound(&master.joint, master.span, diagnostics) {
                    continue;
                }
                let who =
                    format!("the joint {} follows {}", quoted(&joint.name), quoted(&master.joint));
                let known = self.joint_index.get(&master.joint);
                let (found, help) = match known {
                    None => {
                        let help = diagnostics.did_you_mean(
                            &master.joint,
                            self.joint_names(),
                            "correct the name",
                        );
                        (format!("{who}, which does not exist"), help)
                    }
                    Some(_) if master.joint == joint.name => {
                        (format!("{who}, which is itself"), "name another joint".to_owned())
                    }
                    Some(i) if !self.moves(*i) => {
                        (format!("{who}, which is fixed"), "name a joint that moves".to_owned())
                    }
                    Some(_) => continue,
                };
                diagnostics.error(master.span, found, "another moving joint of this robot", help);
            }
            if !joint.masters.is_empty()
                && matches!(joint.kind, Some(JointKind::Floating | JointKind::Spherical))
            {
                let found = format!("the joint {} is coupled", quoted(&joint.name));
                diagnostics.error(
                    joint.span,
                    found,
                    "a coupling of joints with one axis",
                    "remove the mimic or change the type",
                );
            }
        }
    }
}
