//! Links, joints and submechanisms as text; every pose is kept in root axes at the zero pose.

use std::fmt::Write as _;

use super::{TERMS, Text};
use crate::rigid::{Pose, Vector, add, norm};
use crate::seed::Seeded;

/// Index of a link in the robot.
pub(super) type Link = usize;

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Turn,
    Slide,
}

/// A robot under construction.
pub(super) struct Writer {
    pub(super) seeded: Seeded,
    pub(super) scale: f64,
    pub(super) rounded: bool,
    /// Closed forms are declared NUMERICAL.
    pub(super) numerical: bool,
    pub(super) square: bool,
    pub(super) floats: bool,
    pub(super) links: Vec<(String, Pose)>,
    /// Names of independent joints so far, for couplings.
    pub(super) masters: Vec<String>,
    slides: Vec<String>,
    urdf: String,
    yaml: String,
    holds: Vec<String>,
    reach: Vec<(String, f64)>,
    count: usize,
}

/// A submechanism of the YAML file.
pub(super) struct Entry<'a> {
    pub(super) type_name: &'a str,
    pub(super) tree: Vec<String>,
    pub(super) independent: Vec<(String, f64)>,
    pub(super) active: Vec<String>,
    pub(super) loops: Vec<Loop>,
}

/// A loop of the YAML file.
pub(super) struct Loop {
    pub(super) cut: String,
    pub(super) predecessor: Link,
    pub(super) successor: Link,
    pub(super) rows: Vec<[f64; 6]>,
}

impl Writer {
    pub(super) fn new(seeded: Seeded, scale: f64, rounded: bool, numerical: bool) -> Writer {
        let mut writer = Writer {
            seeded,
            scale,
            rounded,
            numerical,
            square: true,
            floats: false,
            links: Vec::new(),
            masters: Vec::new(),
            slides: Vec::new(),
            urdf: String::new(),
            yaml: String::new(),
            holds: Vec::new(),
            reach: Vec::new(),
            count: 0,
        };
        writer.link(Pose::IDENTITY, false);
        writer
    }

    /// A number in the file's precision, which is relative to `unit`.
    fn number(&self, x: f64, unit: f64) -> String {
        if self.rounded {
            format!("{:?}", (x / unit * 1e6).round() * 1e-6 * unit)
        } else {
            format!("{x:?}")
        }
    }

    fn vector(&self, v: Vector, unit: f64) -> String {
        v.map(|x| self.number(x, unit)).join(" ")
    }

    fn name(&mut self, what: &str) -> String {
        self.count += 1;
        format!("{what}{}", self.count)
    }

    /// Adds a link at a pose in the root; it has inertia unless it is to be massless.
    fn link(&mut self, at: Pose, with_inertia: bool) -> Link {
        let name = self.name("link");
        let size = self.scale;
        let mut inertial = String::new();
        if with_inertia {
            let mass = 20.0 * size.powi(3) * self.seeded.within(0.2, 2.0);
            // principal moments of a body with these squared radii
            let [a, b, c] = [(); 3].map(|()| mass * (size * self.seeded.within(0.05, 0.3)).powi(2));
            let [x, y, z] = [b + c, a + c, a + b];
            let R = self.seeded.pose(0.0).R;
            let entry = |i: usize, j: usize| {
                R[i][0] * x * R[j][0] + R[i][1] * y * R[j][1] + R[i][2] * z * R[j][2]
            };
            let origin = self.seeded.pose(0.3 * size);
            let xyz = self.vector(origin.p, size);
            let rpy = self.vector(origin.rpy(), 1.0);
            let _ = write!(
                inertial,
                "<inertial><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><mass value=\"{mass:?}\"/><inertia \
                 ixx=\"{:?}\" ixy=\"{:?}\" ixz=\"{:?}\" iyy=\"{:?}\" iyz=\"{:?}\" izz=\"{:?}\"/>\
                 </inertial>",
                entry(0, 0),
                entry(0, 1),
                entry(0, 2),
                entry(1, 1),
                entry(1, 2),
                entry(2, 2)
            );
        }
        let _ = writeln!(self.urdf, "  <link name=\"{name}\">{inertial}</link>");
        self.links.push((name, at));
        self.links.len() - 1
    }

    /// Adds a joint of any type with its child link at a pose in the root.
    fn place(
        &mut self,
        type_name: &str,
        parent: Link,
        at: Pose,
        axis: Option<Vector>,
        with_inertia: bool,
    ) -> (String, Link) {
        let child = self.link(at, with_inertia);
        let name = self.name("joint");
        let origin = self.links[parent].1.inverse().then(&at);
        let xyz = self.vector(origin.p, self.scale);
        let rpy = self.vector(origin.rpy(), 1.0);
        let axis_is_given = axis.is_some();
        let axis = axis
            .map_or(String::new(), |axis| format!("<axis xyz=\"{}\"/>", self.vector(axis, 1.0)));
        let limit = if matches!(type_name, "revolute" | "prismatic") {
            "<limit lower=\"-1e4\" upper=\"1e4\" effort=\"1e12\" velocity=\"1e4\"/>"
        } else {
            ""
        };
        let terms = if TERMS && axis_is_given && self.seeded.chance(0.3) {
            self.terms(type_name == "prismatic")
        } else {
            String::new()
        };
        let parent = &self.links[parent].0;
        let child_name = &self.links[child].0;
        let _ = writeln!(
            self.urdf,
            "  <joint name=\"{name}\" type=\"{type_name}\"><parent link=\"{parent}\"/><child \
             link=\"{child_name}\"/><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\
             {axis}{limit}{terms}</joint>"
        );
        (name, child)
    }

    /// Damping, a spring and a rotor, each now and then.
    fn terms(&mut self, slides: bool) -> String {
        let arm = if slides { 1.0 } else { self.scale };
        // the mass of a typical body, times the square of an arm for a turning joint
        let inertia = 20.0 * self.scale.powi(3) * arm * arm;
        let mut number =
            |size: f64| if self.seeded.chance(0.6) { self.seeded.within(0.0, size) } else { 0.0 };
        let damping = number(0.5 * inertia);
        let stiffness = number(5.0 * inertia);
        let rotor = number(2e-3 * inertia * (self.scale / arm).powi(2));
        let rest = self.seeded.within(-0.5, 0.5) * self.scale / arm;
        let ratio = self.seeded.within(1.0, 10.0) * self.seeded.sign() * arm / self.scale;
        format!(
            "<dynamics damping=\"{damping:?}\" spring_stiffness=\"{stiffness:?}\" \
             spring_reference=\"{rest:?}\" rotor_inertia=\"{rotor:?}\" gear_ratio=\"{ratio:?}\"/>"
        )
    }

    /// A joint through a point along an axis, both in the root, with an arbitrary joint frame and
    /// sometimes a fixed joint before it.
    pub(super) fn joint(
        &mut self,
        kind: Kind,
        parent: Link,
        origin: Vector,
        axis: Vector,
    ) -> (String, Link) {
        self.joint_with(kind, parent, origin, axis, true)
    }

    /// [`Self::joint`] with or without mass on the child link.
    pub(super) fn joint_with(
        &mut self,
        kind: Kind,
        parent: Link,
        origin: Vector,
        axis: Vector,
        mass: bool,
    ) -> (String, Link) {
        let mut parent = parent;
        if self.seeded.chance(0.15) {
            let at = self.links[parent].1.then(&self.seeded.pose(0.2 * self.scale));
            let heavy = self.seeded.chance(0.5);
            parent = self.place("fixed", parent, at, None, heavy).1;
        }
        let at = Pose { p: origin, ..self.seeded.pose(0.0) };
        let length = if self.seeded.chance(0.5) { 1.0 } else { self.seeded.within(0.5, 3.0) };
        let axis = add(
            [0.0; 3],
            length / norm(axis),
            at.inverse().then(&Pose { p: [0.0; 3], ..Pose::IDENTITY }).direction(axis),
        );
        let type_name = match kind {
            Kind::Slide => "prismatic",
            Kind::Turn if self.seeded.chance(0.3) => "continuous",
            Kind::Turn => "revolute",
        };
        let placed = self.place(type_name, parent, at, Some(axis), mass);
        if kind == Kind::Slide {
            self.slides.push(placed.0.clone());
        }
        placed
    }

    /// A ball joint at a point.
    pub(super) fn ball(&mut self, parent: Link, origin: Vector) -> (String, Link) {
        let at = Pose { p: origin, ..self.seeded.pose(0.0) };
        self.place("spherical", parent, at, None, true)
    }

    /// A fixed joint whose frame marks a cut.
    pub(super) fn mark(&mut self, on: Link, at: Pose) -> String {
        self.place("fixed", on, at, None, false).0
    }

    /// A quaternion joint between the root and the rest.
    pub(super) fn floating_base(&mut self) {
        let at = self.seeded.pose(self.scale);
        let (name, _) = self.place("floating", 0, at, None, true);
        self.floats = true;
        self.holds.push("floating base".into());
        let _ = writeln!(
            self.yaml,
            "- type: SERIAL\n  contextual_name: base\n  jointnames_spanningtree: [{name}]\n  \
             jointnames_independent: [{name}]\n  jointnames_active: []"
        );
    }

    /// Makes the joint written last follow another joint.
    pub(super) fn mimic(&mut self, master: &str, multiplier: f64, offset: f64) {
        let end = self.urdf.rfind("</joint>").unwrap_or(0);
        self.urdf.insert_str(
            end,
            &format!(
                "<mimic joint=\"{master}\" multiplier=\"{multiplier:?}\" offset=\"{offset:?}\"/>"
            ),
        );
    }

    /// Makes a joint follow another one by a polynomial whose slope has one sign.
    pub(super) fn curve(&mut self, name: &str, master: &str, multiplier: f64, offset: f64) {
        let [c, d] = [0.1, 0.02].map(|x| x * multiplier);
        let _ = writeln!(
            self.urdf,
            "<transmission name=\"{name}_curve\"><joint name=\"{name}\"><depends_on \
             joint=\"{master}\" polynomial=\"{offset:?} {multiplier:?} {c:?} {d:?}\"/></joint>\
             </transmission>"
        );
    }

    /// Adds a submechanism to the YAML file.
    pub(super) fn submechanism(&mut self, what: &str, entry: Entry<'_>) {
        let list = |names: &[String]| names.join(", ");
        let name = self.name("part");
        let independent: Vec<String> = entry.independent.iter().map(|x| x.0.clone()).collect();
        let _ = writeln!(
            self.yaml,
            "- type: {}\n  contextual_name: {name}\n  jointnames_spanningtree: [{}]\n  \
             jointnames_independent: [{}]\n  jointnames_active: [{}]",
            entry.type_name,
            list(&entry.tree),
            list(&independent),
            list(&entry.active)
        );
        if !entry.loops.is_empty() {
            self.yaml.push_str("  loop_constraints:\n");
        }
        for of in entry.loops {
            let p = &self.links[of.predecessor].0;
            let s = &self.links[of.successor].0;
            let _ = writeln!(
                self.yaml,
                "  - cut_joint: {}\n    predecessor_body: {p}\n    successor_body: {s}\n    \
                 constraint_axes:",
                of.cut
            );
            for (k, axis) in of.rows.iter().enumerate() {
                let axis = axis.map(|x| format!("{x:?}")).join(", ");
                let _ = writeln!(self.yaml, "    - {{name: row{k}, axis: [{axis}]}}");
            }
        }
        self.square &= entry.active.len() == entry.independent.len();
        // a ball joint cannot be followed, and a slider would be followed by an angle of its length
        // in m
        let leads = |x: &&(String, f64)| x.1 > 0.0 && !self.slides.contains(&x.0);
        self.masters.extend(entry.independent.iter().filter(leads).map(|x| x.0.clone()));
        self.holds.push(what.into());
        self.reach.extend(entry.independent);
    }

    /// Returns the text of both files.
    pub(super) fn finish(self, seed: u64) -> Text {
        let rounded = if self.rounded { ", rounded" } else { "" };
        Text {
            urdf: format!("<robot name=\"seed{seed}\">\n{}</robot>\n", self.urdf),
            yaml: format!("submechanisms:\n{}", self.yaml),
            holds: format!(
                "seed {seed}: {}; scale {:.3e}{rounded}",
                self.holds.join(", "),
                self.scale
            ),
            reach: self.reach,
            square: self.square,
            rounded: self.rounded,
            scale: self.scale,
        }
    }
}
