//! SDF, the format of Gazebo, as a URDF and a submechanism file.
//!
//! Links and joints keep their names, those of nested models behind the name of the model and `::`.
//! The zero pose is the pose of the file. A link is in the tree by the first joint whose child it
//! is: by one with a coupling, a spring, damping, a rotor or an actuator before the others, then by
//! one with a range. The other joints close loops. A link without a joint is free. Each element is
//! read, or reported: by a note where it has no influence on the dynamics, and by an error where it
//! has one that cannot be expressed.

mod frames;
mod joint;
mod tree;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sarrus_dynamics::description::Inertial;

use crate::mjcf::body::Body;
use crate::mjcf::compiler;
use crate::mjcf::document::{self, Element, Files};
use crate::mjcf::item::Item;
use crate::mjcf::{Converted, converted, unread};
use crate::pose::{Pose, unit};
use crate::report::{Diagnostics, Span, quoted};
use crate::rotation::quaternion;
use frames::{Frame, MODEL, WORLD, full};

/// Elements and attributes without influence on mass, forces, loops, limits and actuators.
const HARMLESS: &str = include_str!("harmless.txt");

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
    let root = document::read(name, bytes, &mut Files::new(path, include), diagnostics)?;
    root.is_read.set(true);
    let minor = root.text("version").and_then(|of| of.strip_prefix("1.")?.parse::<u32>().ok());
    let model = model(&root, diagnostics)?;
    let name = model.text("name").filter(|of| !of.is_empty()).unwrap_or("robot").to_owned();
    let mut robot = Robot {
        frames: Vec::new(),
        found: BTreeMap::new(),
        links: vec![Body::new(WORLD.to_owned(), model.span, 0, Pose::NONE)],
        joints: Vec::new(),
        driven: Vec::new(),
        has_model_axes: minor.is_some_and(|minor| minor < 5),
        diagnostics,
    };
    robot.collect(model, ["", ""], WORLD);
    if robot.frames.len() > MOST_PARTS {
        let found = "the model has too many parts";
        let most = format!("at most {MOST_PARTS}");
        return diagnostics.refused(model.span, found, most, "remove some of them");
    }
    robot.place();
    let (tree, cuts) = robot.tree();
    unread::report(&root, HARMLESS, "remove it", diagnostics);
    converted(name, &tree, cuts, None, diagnostics)
}

/// The model that moves: that of the file, or the only one of its world.
fn model<'e>(root: &'e Element, diagnostics: &mut Diagnostics) -> Option<&'e Element> {
    let worlds: Vec<&Element> = root.all("world").collect();
    for world in worlds.iter().map(|world| Item::plain(world)) {
        world.get("name");
        compiler::gravity(&world, diagnostics);
        if !world.has("gravity") {
            let found = "the gravity of a world is 0 0 -9.8 where its file has none";
            diagnostics.note(world.span(), found, "give it as --gravity=0,0,-9.8");
        }
    }
    let models = worlds.into_iter().chain([root]).flat_map(|of| of.all("model"));
    let is_static = |of: &&Element| Item::plain(of).flag("static", diagnostics) == Some(true);
    let (still, moving): (Vec<&Element>, Vec<&Element>) = models.partition(is_static);
    for model in still {
        model.read_all();
        diagnostics.note(model.span, "a static model", "it is left out");
    }
    if moving.len() != 1 {
        let found = format!("{} models that move", moving.len());
        let at = moving.last().map_or(root.span, |model| model.span);
        diagnostics.error(at, found, "one", "give each of them in a file of its own");
    }
    moving.first().copied()
}

/// A number; without it the usual one, and that is unlimited also of ±1e16 or more.
fn number(of: Option<&Element>, name: &str, usual: f64, diagnostics: &mut Diagnostics) -> f64 {
    let written = of.and_then(|of| of.get(name));
    let written = written.filter(|of| usual.is_finite() || !of.value.contains("inf"));
    let found = written.and_then(|of| of.numbers(1, diagnostics)).map(|of| of[0]);
    found.filter(|of| of.abs() < 1e16 || usual.is_finite()).unwrap_or(usual)
}

/// The pose of an element, and the element that holds it.
fn pose<'e>(of: &'e Element, diagnostics: &mut Diagnostics) -> (Pose, &'e Element) {
    let of = of.one("pose").unwrap_or(of);
    let item = Item::plain(of);
    let in_degrees = item.flag("degrees", diagnostics) == Some(true);
    let format = item.text("rotation_format").unwrap_or("euler_rpy");
    let values = item.list("pose", 7, diagnostics);
    let found = match (format, values.as_deref()) {
        (_, None) => Some(Pose::NONE),
        ("euler_rpy", Some(&[x, y, z, roll, pitch, yaw])) => {
            let angles = [roll, pitch, yaw];
            let angles = if in_degrees { angles.map(f64::to_radians) } else { angles };
            Some(Pose { p: [x, y, z], r: quaternion(angles) })
        }
        ("quat_xyzw", Some(&[x, y, z, a, b, c, d])) if !in_degrees => {
            unit([a, b, c, d]).map(|r| Pose { p: [x, y, z], r })
        }
        _ => None,
    };
    if found.is_none() {
        let expected = "x y z roll pitch yaw, or quat_xyzw without degrees";
        diagnostics.error(item.at("pose"), "numbers that are no pose", expected, "correct them");
    }
    (found.unwrap_or(Pose::NONE), of)
}

/// The parts of a model.
struct Robot<'e, 'd> {
    frames: Vec<Frame>,
    /// Link and pose in the world of each frame.
    found: BTreeMap<String, (usize, Pose)>,
    /// With poses in the world, which is the first one.
    links: Vec<Body>,
    /// With their scopes.
    joints: Vec<(&'e Element, String)>,
    /// The joints that plug-ins drive.
    driven: Vec<(String, Span)>,
    /// Axes are given in the frame of the model.
    has_model_axes: bool,
    diagnostics: &'d mut Diagnostics,
}

/// The link with which the frame of a model moves.
fn canonical(model: &Element, scope: &str) -> String {
    let name = |of: &Element| full(scope, of.text("name").unwrap_or_default());
    let first = |kind: &str| model.children.iter().find(|of| of.name == kind);
    match (model.text("canonical_link"), first("link"), first("model")) {
        (Some(of), ..) => full(scope, of),
        (None, Some(link), _) => name(link),
        (None, None, Some(inner)) => canonical(inner, &format!("{}::", name(inner))),
        _ => String::new(),
    }
}

impl<'e> Robot<'e, '_> {
    /// Reads the parts of a model within an outer and with an inner scope.
    fn collect(&mut self, model: &'e Element, [outer, scope]: [&str; 2], base: &str) {
        let own = format!("{scope}{MODEL}");
        let name = scope.strip_suffix("::").unwrap_or(&own).to_owned();
        self.add(name, (model, outer), [base, &canonical(model, scope)]);
        for part in &model.children {
            let whole = full(scope, part.text("name").unwrap_or_default());
            match part.name.as_str() {
                "link" => {
                    self.link(part, &whole);
                    self.add(whole.clone(), (part, scope), [&own, &whole]);
                }
                "joint" => {
                    let child = full(scope, part.text("child").unwrap_or_default());
                    self.add(whole, (part, scope), [&child, &child]);
                    self.joints.push((part, scope.to_owned()));
                }
                "frame" => {
                    let attached = part.text("attached_to").filter(|of| !of.is_empty());
                    let attached = full(scope, attached.unwrap_or(MODEL));
                    self.add(whole, (part, scope), [&attached, &attached]);
                }
                "model" => self.collect(part, [scope, &format!("{whole}::")], &own),
                "plugin" => self.plugin(part, scope),
                _ => continue,
            }
        }
    }

    /// A link with its mass and inertia, by default those of SDF.
    fn link(&mut self, link: &'e Element, name: &str) {
        link.one("velocity_decay");
        let of = link.one("inertial");
        if of.is_none() {
            let found = format!("the link {} has no inertial", quoted(name));
            let help = "it weighs 1 kg and its moments are 1 kg m², as SDF has it";
            self.diagnostics.note(link.span, found, help);
        }
        let origin = of.map_or(Pose::NONE, |of| pose(of, self.diagnostics).0).placement();
        let mass = number(of, "mass", 1.0, self.diagnostics);
        let of = of.and_then(|of| of.one("inertia"));
        let usual = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        let inertia = std::array::from_fn(|k| number(of, names[k], usual[k], self.diagnostics));
        let mut body = Body::new(name.to_owned(), link.span, 0, Pose::NONE);
        body.inertial = Some(Inertial { origin, mass, inertia });
        self.links.push(body);
    }

    fn fault(&mut self, at: Span, found: String, expected: &str) {
        self.diagnostics.error(at, found, expected, "correct it");
    }

    /// The joints that a controller drives.
    fn plugin(&mut self, of: &'e Element, scope: &str) {
        let name = of.text("name").or(of.text("filename")).unwrap_or_default();
        if name.contains("Controller") || name.contains("ApplyJointForce") {
            let joints = of.attributes.iter().filter(|of| of.name == "joint_name");
            self.driven.extend(joints.map(|joint| (full(scope, joint.value.trim()), joint.span)));
            of.read_all();
        }
    }
}
