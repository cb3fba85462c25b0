//! Meshes as far as they give mass: STL, OBJ and meshes within the model, integrated in MuJoCo's
//! ways.

use std::path::{Path, PathBuf};

use super::compiler::Compiler;
use super::document::{Element, Files};
use super::item::{Classes, Item};
use super::solid::{Solid, of_point};
use crate::pose::{Pose, minus, plus, unit};
use crate::report::{Diagnostics, Span, quoted};
use crate::rotation::{cross, dot, rotated};
use crate::triangles::{Triangle as Face, binary_stl, obj};

/// Most triangles of a mesh.
const MOST_FACES: usize = 5_000_000;

/// The meshes of a model; a file is opened when a body needs its inertia.
pub(super) struct Meshes<'e> {
    items: Vec<Item<'e>>,
    files: &'e Files,
    folder: PathBuf,
    /// As the first file says.
    pub(super) strips: bool,
}

impl<'e> Meshes<'e> {
    pub(super) fn new(
        root: &'e Element,
        classes: &Classes<'e>,
        compiler: &Compiler,
        (files, folder): (&'e Files, &Path),
        diagnostics: &mut Diagnostics,
    ) -> Meshes<'e> {
        let all = root.children.iter().filter(|of| of.name == "asset").flat_map(|of| &of.children);
        let items = all
            .filter(|of| of.name == "mesh")
            .map(|of| classes.item(of, &["mesh"], None, diagnostics))
            .collect();
        Meshes { items, files, folder: folder.join(&compiler.folder), strips: compiler.strips }
    }

    /// The solid of a mesh in the frame of its geom; `None` after an error.
    pub(super) fn solid(
        &self,
        name: &str,
        span: Span,
        is_shell: bool,
        diagnostics: &mut Diagnostics,
    ) -> Option<Solid> {
        let is_it = |item: &&Item<'_>| match item.text("name") {
            Some(own) => own == name,
            None => item.text("file").is_some_and(|file| {
                Path::new(file).file_stem().is_some_and(|stem| stem.to_string_lossy() == name)
            }),
        };
        let Some(item) = self.items.iter().find(is_it) else {
            let found = format!("the mesh {}, which does not exist", quoted(name));
            return diagnostics.refused(span, found, "a mesh of this file", "correct the name");
        };
        let way = item.text("inertia").unwrap_or("legacy");
        let refuse = |what: &str, expected: &str, diagnostics: &mut Diagnostics| {
            let found = format!("the mesh {} {what}", quoted(name));
            let help = "write <inertial> of the body, as MuJoCo saves it";
            diagnostics.dynamics(span, found, expected, help);
            None
        };
        if is_shell || !["legacy", "exact", "shell"].contains(&way) {
            let way = if is_shell { "shellinertia" } else { way };
            let what = format!("with the inertia {}", quoted(way));
            return refuse(&what, "legacy, exact or shell", diagnostics);
        }
        let faces = self.faces(item, diagnostics)?;
        if faces.is_empty() {
            let what = "has no faces: MuJoCo takes the hull of its vertices";
            return refuse(what, "faces", diagnostics);
        }
        integrated(&faces, way).or_else(|| refuse("has no volume", "a closed surface", diagnostics))
    }

    /// The triangles of a mesh, placed and scaled.
    fn faces(&self, item: &Item<'_>, diagnostics: &mut Diagnostics) -> Option<Vec<Face>> {
        let refpos = item.numbers::<3>("refpos", diagnostics).unwrap_or_default();
        let [w, x, y, z] = item.numbers("refquat", diagnostics).unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let back = unit([-x, -y, -z, w]).unwrap_or(Pose::NONE.r);
        let scale = item.numbers("scale", diagnostics).unwrap_or([1.0; 3]);
        let mut faces = match item.get("file") {
            Some(file) => {
                let written = Path::new(file.value.trim());
                let stripped = written.file_name().map(Path::new).filter(|_| self.strips);
                let path = self.folder.join(stripped.unwrap_or(written));
                let (_, name, bytes) = self.files.open(&path, file.span, diagnostics)?;
                let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
                let faces = match ending.to_str() {
                    Some("stl") => binary_stl(&bytes),
                    Some("obj") => obj(&bytes),
                    _ => None,
                };
                let faces = faces.filter(|faces| faces.len() <= MOST_FACES);
                if faces.is_none() {
                    let found = format!("the mesh {} cannot be read", quoted(&name));
                    let help = "convert it, or write <inertial> of its bodies";
                    diagnostics.error(file.span, found, "binary STL or OBJ", help);
                }
                faces?
            }
            None => {
                let vertices = item.list("vertex", 3 * MOST_FACES, diagnostics)?;
                let indices = item.list("face", 3 * MOST_FACES, diagnostics).unwrap_or_default();
                let point = |k: &f64| {
                    let at = (*k as usize).checked_mul(3)?;
                    let point = <[f64; 3]>::try_from(vertices.get(at..at + 3)?).ok()?;
                    // MuJoCo keeps them in single precision, as those of files
                    Some(point.map(|x| f64::from(x as f32)))
                };
                let of = |of: &[f64]| Some([point(&of[0])?, point(&of[1])?, point(&of[2])?]);
                indices.chunks_exact(3).filter_map(of).collect()
            }
        };
        let is_mirrored = scale.iter().product::<f64>() < 0.0;
        for face in &mut faces {
            for point in face.iter_mut() {
                let placed = rotated(back, minus(*point, refpos));
                *point = std::array::from_fn(|k| placed[k] * scale[k]);
            }
            if is_mirrored {
                face.swap(1, 2);
            }
        }
        Some(faces)
    }
}

/// Twice the area vector of a triangle.
fn normal([a, b, c]: &Face) -> [f64; 3] {
    cross(minus(*b, *a), minus(*c, *a))
}

fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

/// Volume or area, centre and inertia. `legacy` counts each pyramid from the centre of the surface,
/// and again from the centre of mass, as positive: too much where the mesh is not convex.
fn integrated(faces: &[Face], way: &str) -> Option<Solid> {
    let third = |[a, b, c]: &Face| plus(plus(*a, *b), *c).map(|x| x / 3.0);
    // the centre of the surface
    let area: f64 = faces.iter().map(|face| length(normal(face)) / 2.0).sum();
    let mut middle = [0.0; 3];
    for face in faces {
        middle = plus(middle, third(face).map(|x| x * length(normal(face)) / 2.0 / area));
    }
    if !area.is_finite() || area <= 0.0 {
        return None;
    }
    let is_shell = way == "shell";
    let weight = |face: &Face, from: [f64; 3]| {
        if is_shell {
            return length(normal(face)) / 2.0;
        }
        let volume = dot(minus(face[0], from), normal(face)) / 6.0;
        if way == "legacy" { volume.abs() } else { volume }
    };
    let mut centre = middle;
    if !is_shell {
        let volume: f64 = faces.iter().map(|face| weight(face, middle)).sum();
        centre = [0.0; 3];
        for face in faces {
            let own = third(face);
            let part = weight(face, middle) / volume;
            centre = std::array::from_fn(|k| centre[k] + part * (0.75 * own[k] + 0.25 * middle[k]));
        }
    }
    // second moments about the centre: the corners and their sum
    let mut size = 0.0;
    let mut inertia = [0.0; 6];
    let divisor = if is_shell { 12.0 } else { 20.0 };
    for face in faces {
        let weight = weight(face, centre);
        let corners = face.map(|corner| minus(corner, centre));
        let all = plus(plus(corners[0], corners[1]), corners[2]);
        size += weight;
        for point in corners.into_iter().chain([all]) {
            let of = of_point(point);
            inertia.iter_mut().zip(of).for_each(|(sum, of)| *sum += weight / divisor * of);
        }
    }
    (size > 0.0 && size.is_finite()).then_some(Solid { size, centre, inertia })
}
