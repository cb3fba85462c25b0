//! MJCF, the format of MuJoCo, as a URDF and a submechanism file.
//!
//! Bodies and joints keep their names. The zero pose is the pose of the file, in which MuJoCo's
//! coordinate of a joint is its `ref`. Each element is read, or reported: by a note where it has no
//! influence on the dynamics, and by an error where it has one that cannot be expressed.

mod angles;
pub(crate) mod body;
pub(crate) mod compiler;
pub(crate) mod document;
mod drive;
pub(crate) mod equality;
mod geom;
pub(crate) mod item;
mod mesh;
mod solid;
mod source;
pub(crate) mod unread;
mod write;

use std::path::{Path, PathBuf};

use body::{Body, Joint, Kind, Tree, Walk};
use document::{Element, Files};
use equality::{Cut, Equalities};
use item::Item;
use source::Source;

use crate::export;
use crate::pose::{Pose, unit};
use crate::report::{Diagnostics, Span, quoted};

/// A converted model.
pub(crate) struct Converted {
    pub(crate) name: String,
    pub(crate) urdf: String,
    /// Its submechanisms, still without independent joints.
    pub(crate) submechanisms: String,
    /// The first keyframe: its name, and coordinates by name.
    pub(crate) pose: Option<(String, Vec<(String, f64)>)>,
    /// Whether the file has actuators.
    pub(crate) is_driven: bool,
}

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
    let stem = path.and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
    let model = root.text("model").filter(|name| !name.is_empty());
    let robot = model.map(str::to_owned).or(stem).unwrap_or_else(|| "robot".to_owned());
    let first = Source::new(&root, &files, Path::new(""), diagnostics);
    let enforces = compiler::options(&root, diagnostics);
    let (mut tree, mut sources) = Walk::new(first, &files, diagnostics).read();
    let pose = keyframe(&root, &tree, diagnostics);
    let mut tendons = Vec::new();
    for source in &mut sources {
        drive::tendons(source, &tree, &mut tendons, diagnostics);
    }
    let mut cuts = Vec::new();
    for source in &mut sources {
        drive::actuators(source, &mut tree, &mut tendons, diagnostics);
        if enforces {
            Equalities {
                source,
                tree: &mut tree,
                tendons: &mut tendons,
                diagnostics,
                cuts: &mut cuts,
            }
            .read();
        } else {
            source.root.all("equality").for_each(Element::read_all);
        }
    }
    drive::into_joints(tendons, &mut tree, diagnostics);
    shifted(&tree, diagnostics);
    let help = "remove it, or expand it in MuJoCo (mj_saveLastXML)";
    unread::report(&root, unread::HARMLESS, help, diagnostics);
    converted(robot, &tree, cuts, pose, diagnostics)
}

/// The files of a tree with its cuts; `None` after an error.
pub(crate) fn converted(
    name: String,
    tree: &Tree,
    mut cuts: Vec<Cut>,
    pose: Option<(String, Vec<(String, f64)>)>,
    diagnostics: &mut Diagnostics,
) -> Option<Converted> {
    cuts.retain(|cut| {
        let is_needed = !tree.between(cut.bodies).is_empty();
        if !is_needed {
            let found = format!("no joint moves between the bodies of {}", quoted(&cut.name));
            diagnostics.note(cut.span, found, "nothing to do: it is left out");
        }
        is_needed
    });
    let is_driven = tree.joints.iter().any(|joint| joint.drive.is_some());
    if !is_driven {
        let found = "the model has no actuators";
        let help = "each independent joint of one freedom is active";
        diagnostics.note(Span::start(0), found, help);
    }
    let description = write::description(&name, tree, &cuts);
    (!diagnostics.has_errors()).then(|| Converted {
        urdf: export::urdf::text(&description),
        submechanisms: export::yaml::text(&description),
        name,
        pose,
        is_driven,
    })
}

/// Notes the joints whose coordinate is not MuJoCo's.
fn shifted(tree: &Tree, diagnostics: &mut Diagnostics) {
    for joint in &tree.joints {
        let name = quoted(&joint.name);
        if joint.reference != 0.0 {
            let found = format!("q of {name} is that of MuJoCo less {}", joint.reference);
            let help = "limits and springs are shifted with it";
            diagnostics.note(joint.span, found, help);
        }
        let at = tree.bodies.get(joint.body).map_or(Pose::NONE, |body| body.pose);
        if joint.kind == Kind::Free && at != Pose::NONE {
            let found = format!("q of the free joint {name} counts from the pose of its body");
            let help = "MuJoCo's pose of the body is that pose, then q";
            diagnostics.note(joint.span, found, help);
        }
        if let Some(at) = joint.held {
            let found = format!("an equality holds the joint {name}: it is fixed at {at}");
            diagnostics.note(joint.span, found, "nothing to do");
        }
    }
}

/// The coordinates of the first keyframe with a `qpos`.
fn keyframe(
    root: &Element,
    tree: &Tree,
    diagnostics: &mut Diagnostics,
) -> Option<(String, Vec<(String, f64)>)> {
    let mut keys = root.all("keyframe").flat_map(|of| of.all("key")).map(Item::plain);
    let key = keys.find(|key| key.has("qpos"))?;
    let mut values = key.list("qpos", 1 << 16, diagnostics)?;
    // those of the file's pose, which stand for the numbers that it lacks
    let of_pose = |joint: &Joint| match (joint.kind, tree.bodies.get(joint.body)) {
        (Kind::Ball, _) => vec![1.0, 0.0, 0.0, 0.0],
        (Kind::Free, Some(Body { pose: Pose { p: [x, y, z], r: [a, b, c, w] }, .. })) => {
            vec![*x, *y, *z, *w, *a, *b, *c]
        }
        _ => vec![joint.reference],
    };
    let of_pose: Vec<Vec<f64>> = tree.joints.iter().map(of_pose).collect();
    let needed = of_pose.iter().map(Vec::len).sum();
    if values.len() > needed {
        let found = format!("`qpos` of `key` holds {} numbers", values.len());
        let expected = format!("at most {needed}");
        return diagnostics.refused(key.at("qpos"), found, expected, "correct the value");
    }
    let given = values.len();
    values.extend(of_pose.iter().flatten().skip(given));
    let name = key.text("name").unwrap_or("1").to_owned();
    let mut pose = Vec::new();
    let mut at = 0;
    // bodies are in the order of their depth first, as MuJoCo's
    for (joint, of_pose) in tree.joints.iter().zip(of_pose) {
        let own = values.get(at..at + of_pose.len())?;
        at += own.len();
        let mut add =
            |suffix: &str, value: f64| pose.push((format!("{}{suffix}", joint.name), value));
        match own {
            [value] => add("", value - joint.reference),
            [rest @ .., w, x, y, z] => {
                let r = unit([*x, *y, *z, *w])?;
                let body = tree.bodies.get(joint.body)?.pose;
                let p = <[f64; 3]>::try_from(rest);
                let of = match p {
                    Ok(p) => body.inverse().then(Pose { p, r }),
                    Err(_) => Pose { p: [0.0; 3], r },
                };
                if p.is_ok() {
                    ["/x", "/y", "/z"].into_iter().zip(of.p).for_each(|(k, x)| add(k, x));
                }
                ["/qx", "/qy", "/qz", "/qw"].into_iter().zip(of.r).for_each(|(k, x)| add(k, x));
            }
            _ => return None,
        }
    }
    Some((name, pose))
}
