//! URDF: a strict walk over the text, which reads every value with its position; urdf-rs reads the
//! numbers a second time.

mod closing;
mod compound;
mod couplings;
mod dynamics;
mod gazebo;
mod guard;
mod joint;
mod link;
mod origin;
mod sdf;
mod second;
mod topology;
mod transmission;
mod xml;

use std::collections::{BTreeMap, BTreeSet};

use roxmltree::Node;
use sarrus_dynamics::description::JointKind;

pub(crate) use closing::{Closing, Place};
pub(crate) use joint::JointEntry;
pub(crate) use link::{LinkEntry, Weight};
pub(crate) use xml::{child, parse};

use crate::report::{Diagnostics, Span, quoted};
use crate::text::Text;
use dynamics::Rotor;
use gazebo::Extras;
use transmission::{Dependence, Gear};
use xml::{Reader, Shape};

const ROBOT: Shape = Shape {
    many: "link joint transmission coupling",
    ignored: "material gazebo ros2_control sensor loop loop_joint constraint group \
        self_collision_checking",
    ..Shape::of("name version")
};

/// Largest robot: its matrices are dense.
const MOST_LINKS: usize = 4096;
const MOST_JOINTS: usize = 1024;

/// A URDF file as written, with positions.
#[derive(Default)]
pub(crate) struct Urdf {
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) links: Vec<LinkEntry>,
    pub(crate) joints: Vec<JointEntry>,
    pub(crate) link_index: BTreeMap<String, usize>,
    pub(crate) joint_index: BTreeMap<String, usize>,
    /// The joints that a joint of several axes consists of, by its name.
    pub(crate) parts: BTreeMap<String, Vec<String>>,
    /// Loops in the file.
    pub(crate) closings: Vec<Closing>,
    /// Joints that the file declares actuated.
    pub(crate) actuated: BTreeSet<String>,
    /// The link that is no joint's child.
    pub(crate) root: Option<usize>,
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

/// The indices of names in their list; a second part with the same name is reported.
fn index<'a>(
    kind: &str,
    names: impl Iterator<Item = (&'a String, Span)>,
    diagnostics: &mut Diagnostics,
) -> BTreeMap<String, usize> {
    let mut index = BTreeMap::new();
    for (i, (name, span)) in names.enumerate().filter(|(_, (name, _))| !name.is_empty()) {
        // the first one keeps its name
        if *index.entry(name.clone()).or_insert(i) != i {
            diagnostics.second(span, kind, name);
        }
    }
    index
}

impl Urdf {
    /// Walks the text; `None` if it is no URDF file at all, which has been reported.
    pub(crate) fn read(text: &Text, diagnostics: &mut Diagnostics) -> Option<Urdf> {
        let document = xml::parse(text, diagnostics)?;
        let root = document.root_element();
        let mut reader = Reader { text, diagnostics, version: Version(1, 0) };
        let mut urdf = Urdf::of_robot(&mut reader, root)?;
        let mut rotors: Vec<Rotor> = Vec::new();
        let mut dependences: Vec<Dependence> = Vec::new();
        for node in root.children().filter(|node| node.is_element() && xml::is_closing(*node)) {
            urdf.closings.extend(closing::read(&mut reader, node));
        }
        urdf.name_closings(reader.diagnostics);
        closing::driven(&urdf.closings, &urdf.actuated, reader.diagnostics);
        let mut extras = Extras::default();
        root.children().for_each(|node| extras.read(&mut reader, node));
        let mut couplings: Vec<Gear> = Vec::new();
        for node in reader.children(root, &ROBOT) {
            match node.tag_name().name() {
                "link" => urdf.links.push(link::read(&mut reader, node)),
                "joint" => urdf.joints.push(joint::read(&mut reader, node)),
                "coupling" => couplings.extend(transmission::gear(&mut reader, node)),
                _ => {
                    dependences.extend(transmission::read(&mut reader, node));
                    rotors.extend(dynamics::rotors(&mut reader, node));
                }
            }
        }
        second::check(&mut reader, root, &urdf);
        (urdf.joints, urdf.parts) =
            compound::expand(std::mem::take(&mut urdf.joints), &mut urdf.links, reader.diagnostics);
        urdf.index_names(reader.diagnostics);
        urdf.couple(dependences, reader.diagnostics);
        urdf.couple_again(extras.couplings, reader.diagnostics);
        urdf.mesh(&couplings, reader.diagnostics);
        urdf.add_rotors(&rotors, reader.diagnostics);
        urdf.add_springs(&extras.springs, reader.diagnostics);
        urdf.check_size(reader.diagnostics);
        let is_root = topology::check(&urdf, reader.diagnostics);
        urdf.root = is_root.iter().position(|is_root| *is_root);
        for (link, is_root) in urdf.links.iter().zip(is_root) {
            link::check(link, is_root, reader.diagnostics);
        }
        Some(urdf)
    }

    /// The outermost element with its name and version, still without its parts.
    fn of_robot<'t>(reader: &mut Reader<'t, '_>, root: Node<'_, 't>) -> Option<Urdf> {
        let span = reader.span(root);
        if !root.has_tag_name("robot") {
            let found = format!("the outermost element is {}", quoted(root.tag_name().name()));
            let help = "give a file of URDF, MJCF or SDF (expand xacro files)";
            return reader.diagnostics.refused(span, found, "`robot`, `mujoco` or `sdf`", help);
        }
        let name = reader.required(root, "name").map(|(name, _)| name).unwrap_or_default();
        let version = Version::parse(root.attribute("version"));
        match version.filter(|version| version.0 == 1) {
            Some(version) => reader.version = version,
            None => {
                let written = root.attribute("version").unwrap_or_default();
                let found = format!("the version {} of `robot`", quoted(written));
                reader.diagnostics.error(span, found, "1.0, 1.1 or 1.2", "correct it");
            }
        }
        Some(Urdf { name, span, actuated: closing::actuated(root), ..Urdf::default() })
    }

    fn check_size(&self, diagnostics: &mut Diagnostics) {
        let moving = (0..self.joints.len()).filter(|joint| self.moves(*joint)).count();
        for (count, most, what) in
            [(self.links.len(), MOST_LINKS, "links"), (moving, MOST_JOINTS, "moving joints")]
        {
            if count > most {
                let found = format!("the robot has {count} {what}");
                let help = "split it into robots of their own, or leave out what does not move";
                diagnostics.error(self.span, found, format!("at most {most}"), help);
            }
        }
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
        let links = self.links.iter().map(|link| (&link.name, link.span));
        self.link_index = index("link", links, diagnostics);
        let joints = self.joints.iter().map(|joint| (&joint.name, joint.span));
        self.joint_index = index("joint", joints, diagnostics);
        // the frame of the whole is that of its last part
        for (name, parts) in &self.parts {
            let last = parts.last().and_then(|last| self.joint_index.get(last)).copied();
            if self.joint_index.contains_key(name) {
                diagnostics.second(self.span, "joint", name);
            } else if let Some(last) = last {
                self.joint_index.insert(name.clone(), last);
            }
        }
    }

    /// Each loop has a unique name; Drake's need none, and are numbered.
    fn name_closings(&mut self, diagnostics: &mut Diagnostics) {
        let mut names: BTreeSet<String> = BTreeSet::new();
        for closing in &mut self.closings {
            let mut name = closing.name.clone();
            let mut n = 2;
            while closing.is_unnamed && names.contains(&name) {
                name = format!("{}_{n}", closing.name);
                n += 1;
            }
            closing.name.clone_from(&name);
            if !names.insert(name) {
                diagnostics.second(closing.span, "loop", &closing.name);
            }
        }
        if let Some(closing) = self.closings.get(MOST_JOINTS) {
            let found = format!("the robot has {} loops", self.closings.len());
            let help = "split it into robots of their own";
            diagnostics.error(closing.span, found, format!("at most {MOST_JOINTS}"), help);
            self.closings.truncate(MOST_JOINTS);
        }
    }
}
