//! The shapes that a URDF draws on its links, for the page.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};
use sarrus_dynamics::description::{Description, Placement};
use sarrus_models::{Source, texts};
use serde_json::{Value, json};

use crate::mesh::{Mesh, Packed};
use crate::scene::placement;
use crate::{Meshes, Settings};

/// Files of meshes, read once, by the name in the URDF.
type Files = HashMap<String, (usize, Mesh)>;

/// Adds `visuals`, `meshes` of at most `room` letters, and `notes` on those that are not drawn.
pub(crate) fn add(robot: &mut Value, of: &Description, settings: &Settings, room: usize) {
    let mut notes = Vec::new();
    let mut visuals = Vec::new();
    let mut meshes = Vec::new();
    let text = settings.source.as_ref().filter(|_| settings.meshes != Meshes::None);
    let text = text.and_then(|source| String::from_utf8(texts(source).ok()?.0).ok());
    if let Some(document) = text.as_ref().and_then(|text| Document::parse(text).ok()) {
        let mut files = Files::new();
        let folder = settings.source.as_ref().and_then(folder);
        let is_link = |node: &Node<'_, '_>| node.has_tag_name("link");
        for node in document.root_element().children().filter(is_link) {
            let named = |link: &sarrus_dynamics::description::Link| {
                Some(link.name.as_str()) == node.attribute("name")
            };
            // links that were left out have none
            let Some(link) = of.links.iter().position(named) else { continue };
            for visual in node.children().filter(|node| node.has_tag_name("visual")) {
                match shape(visual, folder.as_deref(), &mut files) {
                    Ok(shape) => visuals.push(with(shape, link, visual)),
                    Err(why) => notes.push(why),
                }
            }
        }
        meshes = packed(files, settings.meshes, room, &mut notes);
    }
    notes.dedup();
    robot["visuals"] = visuals.into();
    robot["meshes"] = meshes.into();
    robot["notes"] = notes.into();
}

fn child<'a, 't>(node: Node<'a, 't>, name: &str) -> Option<Node<'a, 't>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn numbers<const N: usize>(node: Option<Node<'_, '_>>, name: &str) -> Option<[f64; N]> {
    let words = node?.attribute(name)?.split_whitespace();
    let list: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>().ok()?;
    list.try_into().ok().filter(|list: &[f64; N]| list.iter().all(|x| x.is_finite()))
}

/// The kind of a visual with its size: `middle` and `half` sides of its box, in its own frame.
fn shape(visual: Node<'_, '_>, folder: Option<&Path>, files: &mut Files) -> Result<Value, String> {
    let geometry = child(visual, "geometry").and_then(|node| node.first_element_child());
    let name = geometry.map_or("", |node| node.tag_name().name());
    let number = |name| numbers::<1>(geometry, name).map(|[x]| x);
    let unread = || format!("a visual `{name}` cannot be read");
    let whole =
        |kind: &str, half: [f64; 3]| json!({"kind": kind, "middle": [0, 0, 0], "half": half});
    match name {
        "box" => {
            let size: [f64; 3] = numbers(geometry, "size").ok_or_else(unread)?;
            Ok(whole("box", size.map(|x| x / 2.0)))
        }
        "cylinder" | "capsule" => {
            let radius = number("radius").ok_or_else(unread)?;
            let length = number("length").ok_or_else(unread)?;
            Ok(whole("cylinder", [radius, radius, length / 2.0]))
        }
        "sphere" => Ok(whole("sphere", [number("radius").ok_or_else(unread)?; 3])),
        "mesh" => {
            let written =
                geometry.and_then(|node| node.attribute("filename")).ok_or_else(unread)?;
            let scale = numbers(geometry, "scale").unwrap_or([1.0; 3]);
            let count = files.len();
            if !files.contains_key(written) {
                let path = folder.and_then(|folder| found(written, folder));
                let path = path.ok_or_else(|| format!("{written} is not there"))?;
                let mesh = Mesh::read(&path).map_err(|why| format!("{written} {why}"))?;
                files.insert(written.to_owned(), (count, mesh));
            }
            let (place, mesh) = files.get(written).ok_or_else(unread)?;
            let [low, high] = mesh.bounds();
            let at = |k: usize, sign: f64| (high[k] + sign * low[k]) / 2.0 * scale[k];
            let middle = [at(0, 1.0), at(1, 1.0), at(2, 1.0)];
            let half = [at(0, -1.0), at(1, -1.0), at(2, -1.0)].map(f64::abs);
            let value = json!({"kind": "mesh", "mesh": place, "scale": scale});
            Ok(merged(value, json!({"middle": middle, "half": half})))
        }
        _ => Err(unread()),
    }
}

/// A shape on a link, with its pose and colour.
fn with(shape: Value, link: usize, visual: Node<'_, '_>) -> Value {
    let origin = child(visual, "origin");
    let xyz = numbers(origin, "xyz").unwrap_or_default();
    let rpy = numbers(origin, "rpy").unwrap_or_default();
    let material = child(visual, "material");
    // a material without a colour is one of the robot's by that name
    let name = material.and_then(|node| node.attribute("name"));
    let named = visual.document().root_element().children().find(|node| {
        node.has_tag_name("material") && name.is_some() && node.attribute("name") == name
    });
    let colour = |node: Option<Node<'_, '_>>| numbers::<4>(child(node?, "color"), "rgba");
    let colour = colour(material).or_else(|| colour(named));
    let at = placement(&Placement { xyz, rpy });
    merged(shape, json!({"link": link, "at": at, "colour": colour}))
}

fn merged(mut value: Value, other: Value) -> Value {
    if let (Some(value), Value::Object(other)) = (value.as_object_mut(), other) {
        value.extend(other);
    }
    value
}

/// The folder of the URDF.
fn folder(source: &Source) -> Option<PathBuf> {
    match source {
        Source::Files { urdf, .. } => Some(std::path::absolute(urdf).ok()?.parent()?.to_owned()),
        _ => None,
    }
}

/// The file of a name in a URDF: beside it, or of a ROS package around it.
fn found(written: &str, folder: &Path) -> Option<PathBuf> {
    let plain = written.strip_prefix("file://").unwrap_or(written);
    let Some(inside) = plain.strip_prefix("package://").or(plain.strip_prefix("model://")) else {
        return Some(folder.join(plain)).filter(|path| path.is_file());
    };
    let rest = inside.split_once('/').map(|(_, rest)| rest)?;
    let places = folder.ancestors().flat_map(|above| [above.join(inside), above.join(rest)]);
    places.into_iter().find(|path| path.is_file())
}

/// The meshes in their order; the largest become hulls, then nothing, where there is no room.
fn packed(files: Files, choice: Meshes, room: usize, notes: &mut Vec<String>) -> Vec<Value> {
    let mut files: Vec<(String, usize, Mesh)> =
        files.into_iter().map(|(name, (place, mesh))| (name, place, mesh)).collect();
    files.sort_by_key(|(_, place, _)| *place);
    let pack = |(_, _, mesh): &(String, usize, Mesh)| match choice {
        Meshes::All => Some(mesh.packed()),
        _ => mesh.hull().or_else(|| Some(mesh.packed())),
    };
    let mut packed: Vec<Option<Packed>> = files.iter().map(pack).collect();
    let mut was_hull = vec![choice != Meshes::All; packed.len()];
    loop {
        let length = |of: &Option<Packed>| of.as_ref().map_or(0, Packed::len);
        if packed.iter().map(length).sum::<usize>() <= room {
            break;
        }
        let Some(most) = (0..packed.len()).max_by_key(|k| length(&packed[*k])) else { break };
        let (name, _, mesh) = &files[most];
        let hull = mesh.hull().filter(|_| !was_hull[most]);
        let state = if hull.is_some() { "is drawn as its hull" } else { "is not drawn" };
        notes.push(format!("{name} {state}: the page would be too long"));
        (packed[most], was_hull[most]) = (hull, true);
    }
    packed.iter().map(|of| of.as_ref().map_or(Value::Null, Packed::value)).collect()
}
