//! SDF, the format of Gazebo, as a URDF and a submechanism file.
//!
//! Links and joints keep their names, those of nested models behind the name of the model and `::`.
//! The zero pose is the pose of the file. A link is in the tree by the first joint whose child it
//! is: by one with a coupling, a spring, damping or an actuator before the others, then by one with
//! a range. The other joints close loops. A link without a joint is free. Each element is read, or
//! reported: by a note where it has no influence on the dynamics, and by an error where it has one
//! that cannot be expressed.

mod frames;
mod joint;
mod tree;
mod value;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sarrus_dynamics::description::{Inertial, Placement};

use crate::mjcf::compiler;
use crate::mjcf::document::{self, Element, Files};
use crate::mjcf::item::Item;
use crate::mjcf::{Converted, converted, unread};
use crate::pose::Pose;
use crate::report::{Diagnostics, Span, quoted};
use frames::{Frame, Frames, MODEL, WORLD, full};

/// Elements and attributes without influence on mass, forces, loops, limits and actuators.
const HARMLESS: &str = "
    sdf: *
    world: *
    model: canonical_link
    physics: *
    scene: *
    light: *
    gui: *
    atmosphere: *
    magnetic_field: *
    wind: *
    audio: *
    road: *
    spherical_coordinates: *
    actor: *
    state: *
    plugin: *
    self_collide: *
    allow_auto_disable: *
    enable_wind: *
    must_be_base_link: *
    gripper: *
    visual: *
    collision: *
    sensor: *
    projector: *
    audio_sink: *
    audio_source: *
    battery: *
    particle_emitter: *
    density: *
    axis: *
    axis2: *
    initial_position: *
    stiffness: *
    dissipation: *
";

/// Most links, joints and frames.
const MOST_PARTS: usize = 10_000;

/// Converts a model; files that it names are read below the folder of `path` or a folder of
/// `include`. `None` after an error.
pub(crate) fn convert(
    path: Option<&Path>,
    (name, bytes): (&str, Vec<u8>),
    include: &[PathBuf],
    diagnostics: &mut Diagnostics,
) -> Option<Converted> {
    let mut files = Files::new(path, include);
    let root = document::read(name, bytes, &mut files, diagnostics)?;
    root.is_read.set(true);
    let minor = root.text("version").and_then(|of| of.split('.').nth(1)?.parse::<u32>().ok());
    let model = model(&root, diagnostics)?;
    let name = value::name(model, diagnostics)?;
    let mut robot = Robot {
        frames: Frames::default(),
        links: vec![Link { name: WORLD.to_owned(), span: model.span, at: Pose::NONE, mass: None }],
        joints: Vec::new(),
        driven: BTreeMap::new(),
        has_model_axes: minor.is_some_and(|minor| minor < 5),
        diagnostics,
    };
    robot.collect(model, ["", ""], WORLD);
    robot.place();
    let (tree, cuts) = robot.tree();
    unread::report(&root, HARMLESS, "remove it", diagnostics);
    converted(name, &tree, cuts, None, diagnostics)
}

/// The model that moves: that of the file, or the only one of its world.
fn model<'e>(root: &'e Element, diagnostics: &mut Diagnostics) -> Option<&'e Element> {
    let worlds: Vec<&Element> = root.all("world").collect();
    for world in &worlds {
        match value::one(world, "gravity", diagnostics) {
            Some(of) => compiler::gravity(&Item::plain(of), diagnostics),
            None => {
                let found = "the gravity of a world is 0 0 -9.8 where its file has none";
                diagnostics.note(world.span, found, "give it as --gravity=0,0,-9.8");
            }
        }
    }
    let all = worlds.into_iter().chain([root]).flat_map(|of| of.all("model"));
    let mut moving = Vec::new();
    for model in all {
        if value::switch(model, "static", false, diagnostics) {
            model.read_all();
            let found = format!("the static model {}", quoted(model.text("name").unwrap_or("")));
            diagnostics.note(model.span, found, "it is left out");
        } else {
            moving.push(model);
        }
    }
    match moving[..] {
        [model] => return Some(model),
        [] => diagnostics.error(root.span, "no model that moves", "one", "add it"),
        [_, second, ..] => {
            let help = "give each of them in a file of its own";
            diagnostics.error(second.span, "a second model that moves", "one", help);
        }
    }
    None
}

/// A link; its pose in the world.
struct Link {
    name: String,
    span: Span,
    at: Pose,
    mass: Option<Inertial>,
}

/// The parts of a model.
struct Robot<'e, 'd> {
    frames: Frames<'e>,
    /// The first one is the world.
    links: Vec<Link>,
    /// With their scopes.
    joints: Vec<(&'e Element, String)>,
    /// The joints that plug-ins drive.
    driven: BTreeMap<String, Span>,
    /// Axes are given in the frame of the model.
    has_model_axes: bool,
    diagnostics: &'d mut Diagnostics,
}

impl<'e> Robot<'e, '_> {
    /// Reads the parts of a model within an outer and with an inner scope.
    fn collect(&mut self, model: &'e Element, [outer, scope]: [&str; 2], base: &str) {
        let own = format!("{scope}{MODEL}");
        let mut parts = model.children.iter();
        let first = parts.find(|of| ["link", "model"].contains(&of.name.as_str()));
        let canonical = model.text("canonical_link").or(first.and_then(|of| of.text("name")));
        let attached = full(scope, canonical.unwrap_or_default());
        if value::switch(model, "static", false, self.diagnostics) {
            let found = "a static model within another one";
            self.diagnostics.dynamics(model.span, found, "none", "fix its link by a joint");
        }
        self.add(own.clone(), Frame::new(model, outer, base, attached));
        for part in &model.children {
            let name = part.name.as_str();
            if name == "plugin" {
                self.plugin(part, scope);
            }
            if !["link", "joint", "frame", "model"].contains(&name) {
                continue;
            }
            part.is_read.set(true);
            let Some(short) = value::name(part, self.diagnostics) else { continue };
            let whole = full(scope, &short);
            match name {
                "link" => {
                    self.link(part, whole.clone());
                    self.add(whole.clone(), Frame::new(part, scope, &own, whole));
                }
                "joint" => {
                    let child = value::word(part, "child", self.diagnostics).unwrap_or_default();
                    let child = full(scope, child);
                    self.add(whole, Frame::new(part, scope, &child, child.clone()));
                    self.joints.push((part, scope.to_owned()));
                }
                "frame" => {
                    let attached = part.text("attached_to").filter(|of| !of.is_empty());
                    let attached = attached.map_or_else(|| own.clone(), |of| full(scope, of));
                    self.add(whole, Frame::new(part, scope, &attached, attached.clone()));
                }
                _ => self.collect(part, [scope, &format!("{whole}::")], &own),
            }
        }
    }

    fn add(&mut self, name: String, frame: Frame<'e>) {
        if self.frames.count() == MOST_PARTS {
            let most = format!("at most {MOST_PARTS}");
            let found = "the model has too many parts";
            self.diagnostics.error(frame.element.span, found, most, "remove some of them");
        }
        if self.frames.count() <= MOST_PARTS {
            self.frames.add(name, frame, self.diagnostics);
        }
    }

    fn link(&mut self, of: &'e Element, name: String) {
        for (effect, usual) in [("gravity", true), ("kinematic", false)] {
            if value::switch(of, effect, usual, self.diagnostics) != usual {
                let found = format!("`{effect}` of the link {}", quoted(&name));
                self.diagnostics.dynamics(of.span, found, format!("{usual}"), "remove it");
            }
        }
        let decay = value::one(of, "velocity_decay", self.diagnostics);
        let decays =
            ["linear", "angular"].map(|of| value::number(decay, of, 0.0, self.diagnostics));
        if decays != [0.0; 2] {
            let found = format!("`velocity_decay` of the link {}", quoted(&name));
            self.diagnostics.dynamics(of.span, found, "none", "damp joints instead");
        }
        let mass = Some(self.inertial(of, &name));
        self.links.push(Link { name, span: of.span, at: Pose::NONE, mass });
    }

    /// Mass and inertia, by default those of SDF.
    fn inertial(&mut self, link: &'e Element, name: &str) -> Inertial {
        let of = value::one(link, "inertial", self.diagnostics);
        if of.is_none() {
            let found = format!("the link {} has no inertial", quoted(name));
            let help = "it weighs 1 kg and its moments are 1 kg m², as SDF has it";
            self.diagnostics.note(link.span, found, help);
        }
        let diagnostics = &mut *self.diagnostics;
        let mut origin = Placement::default();
        if let Some(of) = of {
            let (pose, frame) = value::pose(of, diagnostics);
            origin = pose.placement();
            let is_auto = value::flag(of, "auto", false, diagnostics);
            for (is_there, what) in [(is_auto, "of collisions"), (frame.is_some(), "elsewhere")] {
                if is_there {
                    let found = format!("the inertia of the link {} is given {what}", quoted(name));
                    let help = "write it as numbers in the frame of the link";
                    diagnostics.dynamics(of.span, found, "numbers", help);
                }
            }
        }
        let mass = value::number(of, "mass", 1.0, diagnostics);
        let inertia = of.and_then(|of| value::one(of, "inertia", diagnostics));
        let mut moment = |name, usual| value::number(inertia, name, usual, diagnostics);
        let inertia = [
            moment("ixx", 1.0),
            moment("ixy", 0.0),
            moment("ixz", 0.0),
            moment("iyy", 1.0),
            moment("iyz", 0.0),
            moment("izz", 1.0),
        ];
        Inertial { origin, mass, inertia }
    }

    /// The joints that a controller drives.
    fn plugin(&mut self, of: &'e Element, scope: &str) {
        let name = of.text("name").or(of.text("filename")).unwrap_or_default();
        if name.contains("Controller") || name.contains("ApplyJointForce") {
            for joint in of.all("joint_name").filter_map(|joint| joint.text("joint_name")) {
                self.driven.insert(full(scope, joint), of.span);
            }
            of.read_all();
        }
    }

    /// Places frames and links.
    fn place(&mut self) {
        let links = self.links.iter().enumerate().map(|(k, link)| (link.name.clone(), k));
        self.frames.place(&links.collect(), self.diagnostics);
        for link in &mut self.links {
            // one that is not placed has been reported
            let found = self.frames.get(&link.name, link.span, self.diagnostics);
            link.at = found.map_or(Pose::NONE, |(_, at)| at);
        }
    }
}
