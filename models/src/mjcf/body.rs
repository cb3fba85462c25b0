//! The tree of bodies: frames, joints, inertia and sites.

use std::collections::BTreeMap;

use sarrus_dynamics::description::{Inertial, Terms};

use super::compiler::{Compiler, FromGeoms};
use super::document::{Element, Files, MOST_FILES};
use super::geom::{self, Part};
use super::item::Item;
use super::source::Source;
use crate::inertia::principal_moments;
use crate::pose::{Pose, unit};
use crate::report::{Diagnostics, Span, quoted};
use crate::rotation::rotated;

/// Most bodies, joints, geoms and sites of a model with its repetitions.
const MOST_PARTS: usize = 10_000;
/// Most elements of attached files, with their repetitions.
const MOST_ELEMENTS: usize = 100_000;

/// The motion of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Kind {
    #[default]
    Hinge,
    Slide,
    Ball,
    Free,
}

/// A joint; its coordinate is zero in the file's pose, MuJoCo's is `reference` there.
#[derive(Clone, Default)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) body: usize,
    pub(crate) kind: Kind,
    /// Anchor and unit axis {body}.
    pub(crate) pos: [f64; 3],
    pub(crate) axis: [f64; 3],
    pub(crate) reference: f64,
    pub(crate) range: Option<[f64; 2]>,
    pub(crate) effort: f64,
    pub(crate) velocity: f64,
    pub(crate) terms: Terms,
    /// The joints that it follows, and the offset.
    pub(crate) coupling: Option<(Vec<(String, f64)>, f64)>,
    /// A joint that it follows besides, by the coefficients of a polynomial.
    pub(crate) curve: Option<(String, Vec<f64>)>,
    /// Where an equality holds it.
    pub(crate) held: Option<f64>,
    /// The sum of its actuators' largest forces; `None` where it is not driven.
    pub(crate) drive: Option<f64>,
}

/// A body.
pub(crate) struct Body {
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) parent: usize,
    /// In the parent's frame, in the file's pose.
    pub(crate) pose: Pose,
    /// Indices of its joints, in the order in which they act.
    pub(crate) joints: Vec<usize>,
    pub(crate) inertial: Option<Inertial>,
    explicit: Option<Inertial>,
    parts: Vec<Part>,
}

impl Joint {
    /// A joint in the origin of the world along z, free of all else.
    pub(crate) fn new(name: String, span: Span, kind: Kind) -> Joint {
        Joint {
            name,
            span,
            kind,
            axis: [0.0, 0.0, 1.0],
            effort: f64::INFINITY,
            velocity: f64::INFINITY,
            ..Joint::default()
        }
    }

    /// Whether it has one coordinate.
    pub(crate) fn is_single(&self) -> bool {
        matches!(self.kind, Kind::Hinge | Kind::Slide)
    }
}

impl Body {
    pub(crate) fn new(name: String, span: Span, parent: usize, pose: Pose) -> Body {
        Body {
            name,
            span,
            parent,
            pose,
            joints: Vec::new(),
            inertial: None,
            explicit: None,
            parts: Vec::new(),
        }
    }
}

/// The bodies of a model; the first one is the world.
pub(crate) struct Tree {
    pub(crate) bodies: Vec<Body>,
    pub(crate) joints: Vec<Joint>,
    /// Body and pose of each site.
    pub(crate) sites: BTreeMap<String, (usize, Pose)>,
}

impl Tree {
    pub(crate) fn body(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|body| body.name == name)
    }

    /// Whether a joint, a body or a site has this name.
    pub(crate) fn has(&self, tag: &str, name: &str) -> bool {
        match tag {
            "joint" => self.joint(name).is_some(),
            "body" => self.body(name).is_some(),
            _ => tag == "site" && self.sites.contains_key(name),
        }
    }

    pub(crate) fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// A body and those that carry it.
    fn chain(&self, mut body: usize) -> Vec<usize> {
        let mut chain = vec![body];
        while let Some(of) = self.bodies.get(body).filter(|_| body != 0) {
            body = of.parent;
            chain.push(body);
        }
        chain
    }

    /// The moving joints between two bodies.
    pub(crate) fn between(&self, bodies: [usize; 2]) -> Vec<usize> {
        let chains = bodies.map(|body| self.chain(body));
        let only = |k: usize| {
            let other = &chains[1 - k];
            chains[k].iter().filter(|body| !other.contains(body))
        };
        let path = only(0).chain(only(1)).filter_map(|body| self.bodies.get(*body));
        let moves = |j: &usize| self.joints.get(*j).is_some_and(|joint| joint.held.is_none());
        path.flat_map(|of| &of.joints).copied().filter(moves).collect()
    }

    /// Adds a body without mass, on the nearest one that carries all of these joints.
    pub(crate) fn add_body(&mut self, name: String, span: Span, on: &[(String, f64)]) -> usize {
        let joints = on.iter().filter_map(|(name, _)| self.joints.get(self.joint(name)?));
        let chains: Vec<_> = joints.map(|joint| self.chain(joint.body)).collect();
        let carries = |body: &&usize| chains.iter().all(|chain| chain[1..].contains(*body));
        let parent = chains.first().and_then(|chain| chain.iter().find(carries));
        self.bodies.push(Body::new(name, span, parent.copied().unwrap_or(0), Pose::NONE));
        self.bodies.len() - 1
    }

    /// Puts the joints into the order of their bodies.
    fn sort_joints(&mut self) {
        self.joints.sort_by_key(|joint| joint.body);
        self.bodies.iter_mut().for_each(|body| body.joints.clear());
        for (j, joint) in self.joints.iter().enumerate() {
            if let Some(body) = self.bodies.get_mut(joint.body) {
                body.joints.push(j);
            }
        }
    }

    /// A joint of its body, behind the others.
    pub(crate) fn add_joint(&mut self, joint: Joint) {
        if let Some(body) = self.bodies.get_mut(joint.body) {
            body.joints.push(self.joints.len());
        }
        self.joints.push(joint);
    }

    /// The pose of a body in the world, in the file's pose.
    pub(crate) fn pose(&self, body: usize) -> Pose {
        let mut pose = Pose::NONE;
        let mut body = body;
        while let Some(of) = self.bodies.get(body).filter(|_| body != 0) {
            pose = of.pose.then(pose);
            body = of.parent;
        }
        pose
    }
}

/// The place of an element: its body, the frame within it, class and suffix of names.
#[derive(Clone)]
struct Place<'e> {
    body: usize,
    /// Whether the body is of the file that is read.
    is_own: bool,
    /// Groups of the geoms that have mass in the body's file.
    groups: [f64; 2],
    frame: Pose,
    class: Option<&'e str>,
    suffix: String,
}

/// Reads the bodies of a model.
pub(super) struct Walk<'e, 'd> {
    source: Source<'e>,
    files: &'e Files,
    /// The files that were attached.
    attached: Vec<Source<'e>>,
    diagnostics: &'d mut Diagnostics,
    tree: Tree,
    n_parts: usize,
    n_elements: usize,
}

impl<'e, 'd> Walk<'e, 'd> {
    pub(super) fn new(
        source: Source<'e>,
        files: &'e Files,
        diagnostics: &'d mut Diagnostics,
    ) -> Walk<'e, 'd> {
        let world = Body::new("world".to_owned(), Span::start(0), 0, Pose::NONE);
        let tree = Tree { bodies: vec![world], joints: Vec::new(), sites: BTreeMap::new() };
        Walk { source, files, attached: Vec::new(), diagnostics, tree, n_parts: 0, n_elements: 0 }
    }

    /// The tree of a model, and the files that it has parts of.
    pub(super) fn read(mut self) -> (Tree, Vec<Source<'e>>) {
        let groups = self.source.compiler.groups;
        let frame = Pose::NONE;
        let suffix = String::new();
        self.place(&Place { body: 0, is_own: true, groups, frame, class: None, suffix });
        self.tree.sort_joints();
        self.scale_mass();
        self.attached.insert(0, self.source);
        (self.tree, self.attached)
    }

    /// The part of a file that is placed, or all that its worlds hold.
    fn place(&mut self, place: &Place<'e>) {
        if let Some((part, class)) = self.source.part {
            let class = Some(class).filter(|of| !of.is_empty());
            return self.content(std::slice::from_ref(part), &Place { class, ..place.clone() });
        }
        let root = self.source.root;
        for world in root.all("worldbody") {
            let class = world.text("childclass");
            self.content(&world.children, &Place { class, ..place.clone() });
        }
    }

    fn content(&mut self, children: &'e [Element], place: &Place<'e>) {
        for child in children {
            self.n_parts += 1;
            if self.n_parts > MOST_PARTS {
                if self.n_parts == MOST_PARTS + 1 {
                    let found = "the model has too many parts";
                    let most = format!("at most {MOST_PARTS}");
                    self.diagnostics.error(child.span, found, most, "repeat fewer of them");
                }
                return;
            }
            let tag = child.name.as_str();
            if matches!(tag, "site" | "geom" | "camera" | "light") {
                let name = self.source.name(child.unread("name"), &place.suffix);
                self.diagnostics.named(child.span, tag, &name);
            }
            match tag {
                "body" => self.body(child, place),
                "frame" => {
                    let item = Item::plain(child);
                    let pose = self.source.compiler.angles.pose(&item, self.diagnostics);
                    let class = item.text("childclass").or(place.class);
                    let frame = place.frame.then(pose);
                    item.get("name");
                    self.content(&child.children, &Place { frame, class, ..place.clone() });
                }
                "attach" => self.attach(child, place),
                "replicate" => self.replicate(child, place),
                "joint" | "freejoint" => self.joint(child, place),
                "inertial" => self.inertial(child, place),
                "geom" if place.body != 0 => {
                    let item =
                        self.source.classes.item(child, &["geom"], place.class, self.diagnostics);
                    let part = geom::part(&item, &self.source, place.groups, self.diagnostics);
                    let frame = place.frame;
                    let part = part.map(|part| Part { pose: frame.then(part.pose), ..part });
                    self.tree.bodies[place.body].parts.extend(part);
                }
                "site" => {
                    let item =
                        self.source.classes.item(child, &["site"], place.class, self.diagnostics);
                    let pose = geom::placed(&item, &self.source.compiler, self.diagnostics).0;
                    if let Some(name) = item.text("name") {
                        let name = self.source.name(name, &place.suffix);
                        let at = (place.body, place.frame.then(pose));
                        self.tree.sites.insert(name, at);
                    }
                }
                _ => {}
            }
        }
    }

    /// A name with its suffix, or a new one.
    fn name(&mut self, item: &Item<'_>, kind: &str, suffix: &str) -> String {
        let (n, known): (usize, &dyn Fn(&str) -> bool) = match kind {
            "body" => (self.tree.bodies.len(), &|name| self.tree.body(name).is_some()),
            _ => (self.tree.joints.len() + 1, &|name| self.tree.joint(name).is_some()),
        };
        let Some(name) = item.text("name").filter(|name| !name.is_empty()) else {
            let mut name = format!("{kind}_{n}");
            while known(&name) {
                name.push('_');
            }
            return name;
        };
        let name = self.source.name(name, suffix);
        if known(&name) {
            self.diagnostics.second(item.span(), kind, &name);
        }
        name
    }

    fn body(&mut self, element: &'e Element, place: &Place<'e>) {
        let item = Item::plain(element);
        let name = self.name(&item, "body", &place.suffix);
        let pose = self.source.compiler.angles.pose(&item, self.diagnostics);
        if item.number("gravcomp", self.diagnostics).unwrap_or(0.0) != 0.0 {
            let found = format!("the body {} has `gravcomp`", quoted(&name));
            self.diagnostics.dynamics(item.at("gravcomp"), found, "none", "remove it");
        }
        if item.flag("mocap", self.diagnostics) == Some(true) {
            let found = format!("the body {} is moved by motion capture", quoted(&name));
            let help = "remove `mocap`; the body is fixed";
            self.diagnostics.dynamics(item.at("mocap"), found, "a body of the tree", help);
        }
        let body = self.tree.bodies.len();
        let pose = place.frame.then(pose);
        self.tree.bodies.push(Body::new(name, item.span(), place.body, pose));
        let class = item.text("childclass").or(place.class);
        let place = Place {
            body,
            is_own: true,
            groups: self.source.compiler.groups,
            frame: Pose::NONE,
            class,
            suffix: place.suffix.clone(),
        };
        self.content(&element.children, &place);
        self.tree.bodies[body].inertial = self.inertial_of(body);
    }

    /// The parts of another file, in this place.
    fn attach(&mut self, element: &'e Element, place: &Place<'e>) {
        let item = Item::plain(element);
        let source = self.source.attached(&item, &place.suffix, self.files, self.diagnostics);
        let Some(source) = source else {
            element.read_all();
            self.n_elements += MOST_ELEMENTS / 16;
            return;
        };
        self.n_elements += source.root.size();
        if self.attached.len() >= MOST_FILES || self.n_elements > MOST_ELEMENTS {
            self.n_parts = self.n_parts.max(MOST_PARTS);
        }
        let outer = std::mem::replace(&mut self.source, source);
        self.place(&Place { class: None, is_own: false, ..place.clone() });
        self.attached.push(std::mem::replace(&mut self.source, outer));
    }

    /// The elements of a `<replicate>`, each time one step further.
    fn replicate(&mut self, element: &'e Element, place: &Place<'e>) {
        let item = Item::plain(element);
        let count = item.number("count", self.diagnostics).unwrap_or(0.0).max(0.0) as usize;
        let offset = item.numbers("offset", self.diagnostics).unwrap_or_default();
        let euler = item.numbers::<3>("euler", self.diagnostics).unwrap_or_default();
        let sep = item.text("sep").unwrap_or_default();
        // each suffix has the digits of the last one
        let width = count.saturating_sub(1).max(1).to_string().len();
        // each step is along the axes of the frame before it, which has so many times the angles
        let mut at = Pose::NONE;
        for k in 0..count.min(MOST_PARTS) {
            let suffix = format!("{sep}{k:0width$}{}", place.suffix);
            at.r = self.source.compiler.angles.of_euler(euler.map(|angle| angle * k as f64));
            let frame = place.frame.then(at);
            self.content(&element.children, &Place { frame, suffix, ..place.clone() });
            at.p = at.apply(offset);
        }
    }

    fn joint(&mut self, element: &'e Element, place: &Place<'e>) {
        let is_free = element.name == "freejoint";
        let tags: &[&str] = if is_free { &[] } else { &["joint"] };
        let item = self.source.classes.item(element, tags, place.class, self.diagnostics);
        let name = self.name(&item, "joint", &place.suffix);
        let kinds = [("hinge", Kind::Hinge), ("slide", Kind::Slide), ("ball", Kind::Ball)];
        let written = if is_free { "free" } else { item.text("type").unwrap_or("hinge") };
        let mut known = kinds.into_iter().chain([("free", Kind::Free)]);
        let Some((_, kind)) = known.find(|(name, _)| *name == written) else {
            let found = format!("the joint type {}", quoted(written));
            let expected = "hinge, slide, ball or free";
            self.diagnostics.error(item.at("type"), found, expected, "choose one of them");
            return;
        };
        if kind == Kind::Free && self.tree.bodies[place.body].parent != 0 || place.body == 0 {
            let found = format!("the joint {} in this place", quoted(&name));
            let help = "move it to a body; a free one below the world";
            self.diagnostics.error(item.span(), found, "a joint of a body", help);
            return;
        }
        if item.flag("align", self.diagnostics) == Some(true) {
            let found = format!("`align` of the joint {} moves the body's frame", quoted(&name));
            self.diagnostics.dynamics(item.at("align"), found, "false", "remove it");
        }
        let angles = &self.source.compiler.angles;
        let is_turn = matches!(kind, Kind::Hinge | Kind::Ball);
        let number = |name: &str, of: &mut Diagnostics| {
            let number = item.number(name, of).unwrap_or(0.0);
            if is_turn { angles.radians(number) } else { number }
        };
        let reference = number("ref", self.diagnostics);
        let rest = number("springref", self.diagnostics) - reference;
        let axis = item.numbers::<3>("axis", self.diagnostics).unwrap_or([0.0, 0.0, 1.0]);
        let axis = unit(axis);
        if axis.is_none() {
            let found = format!("the axis of the joint {} is zero", quoted(&name));
            self.diagnostics.error(item.at("axis"), found, "a direction as 0 0 1", "correct it");
        }
        let pos = item.numbers("pos", self.diagnostics).unwrap_or_default();
        let range = self.source.compiler.range(&item, "range", "limited", self.diagnostics);
        let range = range.map(|range| {
            range.map(|of| if is_turn { angles.radians(of) - reference } else { of - reference })
        });
        let effort = self.source.compiler.range(
            &item,
            "actuatorfrcrange",
            "actuatorfrclimited",
            self.diagnostics,
        );
        let terms = Terms {
            damping: item.linear("damping", self.diagnostics),
            stiffness: item.linear("stiffness", self.diagnostics),
            rest,
            rotor_inertia: item.number("armature", self.diagnostics).unwrap_or(0.0),
            friction: item.dry_friction(self.diagnostics),
            ..Terms::default()
        };
        let joint = Joint {
            body: place.body,
            pos: if kind == Kind::Free { [0.0; 3] } else { place.frame.apply(pos) },
            axis: rotated(place.frame.r, axis.unwrap_or([0.0, 0.0, 1.0])),
            reference: if kind == Kind::Ball { 0.0 } else { reference },
            range,
            effort: effort.map_or(f64::INFINITY, largest),
            terms,
            ..Joint::new(name, item.span(), kind)
        };
        self.check_joint(&item, &joint);
        self.tree.add_joint(joint);
    }

    /// Reports terms that a joint of this kind lacks.
    fn check_joint(&mut self, item: &Item<'_>, joint: &Joint) {
        let springdamper = item.numbers::<2>("springdamper", self.diagnostics);
        let Joint { kind, terms, .. } = joint;
        let is_single = joint.is_single();
        let faults = [
            ("springdamper", springdamper.is_some_and(|of| of != [0.0; 2])),
            ("damping", *kind == Kind::Free && terms.damping != 0.0),
            ("stiffness", !is_single && terms.stiffness != 0.0),
            ("armature", !is_single && terms.rotor_inertia != 0.0),
            ("range", *kind == Kind::Ball && joint.range.is_some()),
        ];
        for (name, _) in faults.into_iter().filter(|(_, is_there)| *is_there) {
            let found = format!("`{name}` of the joint {}", quoted(&joint.name));
            let help = match name {
                "springdamper" => "write stiffness and damping as numbers",
                _ => "remove it; a joint of this type has no such term here",
            };
            self.diagnostics.dynamics(item.at(name), found, "none", help);
        }
    }

    /// `<inertial>`, the explicit one of its body.
    fn inertial(&mut self, element: &'e Element, place: &Place<'e>) {
        if !place.is_own {
            // it stays with the body that is not attached
            return element.read_all();
        }
        let item = Item::plain(element);
        let pose = self.source.compiler.angles.pose(&item, self.diagnostics);
        let mass = item.number("mass", self.diagnostics);
        let diagonal = item.numbers::<3>("diaginertia", self.diagnostics);
        let full = item.numbers::<6>("fullinertia", self.diagnostics);
        for name in ["pos", "mass"] {
            if !item.has(name) {
                let found = format!("`inertial` has no `{name}`");
                self.diagnostics.error(item.span(), found, "both", "add it");
            }
        }
        if full.is_some() && (diagonal.is_some() || pose.r != Pose::NONE.r) {
            let found = "`fullinertia` beside `diaginertia` or an orientation";
            let help = "remove one of them";
            self.diagnostics.error(item.at("fullinertia"), found, "one of them", help);
        }
        let inertia = match (full, diagonal) {
            (Some([xx, yy, zz, xy, xz, yz]), _) => [xx, xy, xz, yy, yz, zz],
            (None, diagonal) => {
                let [x, y, z] = diagonal.unwrap_or_default();
                [x, 0.0, 0.0, y, 0.0, z]
            }
        };
        let origin = place.frame.then(pose).placement();
        let body = &mut self.tree.bodies[place.body];
        body.explicit = Some(Inertial { origin, mass: mass.unwrap_or(0.0), inertia });
    }

    /// The mass and the inertia of a body, by the rules of the compiler.
    fn inertial_of(&mut self, body: usize) -> Option<Inertial> {
        let Body { explicit, parts, name, span, pose, .. } = self.tree.bodies.get(body)?;
        let from_geoms = match self.source.compiler.from_geoms {
            FromGeoms::Never => false,
            FromGeoms::WithoutInertial => explicit.is_none(),
            FromGeoms::Always => true,
        };
        let of_parts = geom::sum(parts).filter(|_| from_geoms).map(|part| Inertial {
            origin: part.pose.placement(),
            mass: part.mass,
            inertia: part.inertia,
        });
        let Compiler { least_mass, least_inertia, balances, .. } = self.source.compiler;
        // MuJoCo has it in the body's frame where the body is in that of its parent
        let none = Inertial { origin: pose.placement(), mass: 0.0, inertia: [0.0; 6] };
        let bounded = (least_mass > 0.0 || least_inertia > 0.0).then_some(none);
        let mut inertial = of_parts.or(*explicit).or(bounded)?;
        inertial.mass = inertial.mass.max(least_mass);
        let [a, b, c] = principal_moments(&inertial.inertia);
        if a < least_inertia {
            let [x, xy, xz, y, yz, z] = &mut inertial.inertia;
            if [*xy, *xz, *yz] == [0.0; 3] {
                [x, y, z].into_iter().for_each(|of| *of = of.max(least_inertia));
            } else {
                let found = format!("`boundinertia` bounds the inertia of {}", quoted(name));
                let help = "write its inertia about its principal axes";
                self.diagnostics.dynamics(*span, found, "a diagonal inertia", help);
            }
        }
        if balances && a + b < c {
            let mean = (a + b + c) / 3.0;
            inertial.inertia = [mean, 0.0, 0.0, mean, 0.0, mean];
        }
        Some(inertial)
    }

    /// Scales all masses to a given sum.
    fn scale_mass(&mut self) {
        let all = || self.tree.bodies.iter().filter_map(|body| body.inertial);
        let sum: f64 = all().map(|of| of.mass).sum();
        let wanted = self.source.compiler.total_mass;
        if wanted > 0.0 && sum > 0.0 {
            for inertial in self.tree.bodies.iter_mut().filter_map(|body| body.inertial.as_mut()) {
                inertial.mass *= wanted / sum;
                inertial.inertia = inertial.inertia.map(|of| of * wanted / sum);
            }
        }
    }
}

/// The largest size in a range.
pub(crate) fn largest(range: [f64; 2]) -> f64 {
    range[0].abs().max(range[1].abs())
}
