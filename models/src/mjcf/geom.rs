//! Geoms as far as they give mass: volume or area, centre of mass and inertia of each shape.

use core::f64::consts::PI;

use super::compiler::Compiler;
use super::item::Item;
use super::mesh::Meshes;
use super::pose::{Pose, from_z, minus, plus};
use crate::report::{Diagnostics, quoted};
use crate::rotation::dot;

/// Symmetric matrices are xx, xy, xz, yy, yz, zz.
pub(super) type Tensor = [f64; 6];

/// A rigid part of a body: its pose is that of its centre of mass and the axes of its inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) mass: f64,
    pub(super) pose: Pose,
    pub(super) inertia: Tensor,
}

/// Volume or area, centre, and the inertia about it of unit density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solid {
    pub(super) size: f64,
    pub(super) centre: [f64; 3],
    pub(super) inertia: Tensor,
}

/// The pose of a geom or a site, and its size where `fromto` gives it.
pub(super) fn placed(
    item: &Item<'_>,
    compiler: &Compiler,
    diagnostics: &mut Diagnostics,
) -> (Pose, Option<f64>) {
    let pose = compiler.angles.pose(item, diagnostics);
    let Some([a, b, c, d, e, f]) = item.numbers("fromto", diagnostics) else { return (pose, None) };
    let ends = [[a, b, c], [d, e, f]];
    // from the second end to the first
    let along = minus(ends[0], ends[1]);
    let p = plus(ends[0], ends[1]).map(|x| x / 2.0);
    (Pose { p, r: from_z(along) }, Some(dot(along, along).sqrt() / 2.0))
}

/// The part of a body that a geom is; `None` where it has no mass, and after an error.
pub(super) fn part(
    item: &Item<'_>,
    compiler: &Compiler,
    meshes: &mut Meshes<'_>,
    diagnostics: &mut Diagnostics,
) -> Option<Part> {
    let group = item.number("group", diagnostics).unwrap_or(0.0);
    let (pose, half_length) = placed(item, compiler, diagnostics);
    let mass = item.number("mass", diagnostics);
    let density = item.number("density", diagnostics).unwrap_or(1000.0);
    let is_shell = item.flag("shellinertia", diagnostics) == Some(true);
    let mut size = item.list("size", 3, diagnostics).unwrap_or_default();
    let mesh = item.text("mesh");
    let kind = item.text("type").unwrap_or("sphere");
    if !(compiler.groups[0]..=compiler.groups[1]).contains(&group)
        || mass.map_or(density == 0.0, |mass| mass == 0.0)
        || ["plane", "hfield"].contains(&kind)
    {
        return None;
    }
    if let Some(half_length) = half_length {
        size = match (kind, size.first()) {
            ("capsule" | "cylinder", Some(radius)) => vec![*radius, half_length],
            (_, Some(radius)) => vec![*radius, *radius, half_length],
            (_, None) => size,
        };
    }
    let number = |k: usize| size.get(k).copied().unwrap_or(0.0);
    let [a, b, c] = [0, 1, 2].map(number);
    let needed = match kind {
        "sphere" => 1,
        "capsule" | "cylinder" => 2,
        "box" | "ellipsoid" => 3,
        _ => 0,
    };
    let solid = match (kind, mesh) {
        ("mesh", Some(mesh)) => meshes.solid(mesh, item.at("mesh"), is_shell, diagnostics)?,
        (_, Some(_)) => {
            let found = format!("a geom of type {} around a mesh has mass", quoted(kind));
            let help = "write <inertial> of this body, as MuJoCo saves it";
            diagnostics.dynamics(item.span(), found, "type=\"mesh\"", help);
            return None;
        }
        _ if needed > 0 && (0..needed).any(|k| number(k) <= 0.0) => {
            let found = format!("the size of a {kind}: {size:?}");
            let expected = format!("{needed} positive");
            diagnostics.error(item.at("size"), found, expected, "correct it");
            return None;
        }
        ("sphere", _) => sphere(a, is_shell),
        ("capsule", _) => capsule(a, 2.0 * b, is_shell),
        ("cylinder", _) => cylinder(a, 2.0 * b, is_shell),
        ("box", _) => cuboid([a, b, c].map(|x| 2.0 * x), is_shell),
        ("ellipsoid", _) if !is_shell => ellipsoid([a, b, c]),
        _ => {
            let shell = if is_shell { " as a shell" } else { "" };
            let found = format!("a geom of type {}{shell} has mass", quoted(kind));
            let help = "write <inertial> of this body, as MuJoCo saves it";
            diagnostics.dynamics(item.span(), found, "a solid of another type", help);
            return None;
        }
    };
    let mass = mass.unwrap_or(density * solid.size);
    Some(Part {
        mass,
        pose: pose.then(Pose::at(solid.centre)),
        inertia: solid.inertia.map(|of| of * mass / solid.size),
    })
}

/// A solid of this volume or area, with its inertia as that of one kilogram.
fn solid(size: f64, [x, y, z]: [f64; 3]) -> Solid {
    let inertia = [x, 0.0, 0.0, y, 0.0, z].map(|of| of * size);
    Solid { size, centre: [0.0; 3], inertia }
}

fn sphere(r: f64, is_shell: bool) -> Solid {
    let (size, factor) =
        if is_shell { (4.0 * PI * r * r, 2.0 / 3.0) } else { (4.0 / 3.0 * PI * r * r * r, 0.4) };
    solid(size, [factor * r * r; 3])
}

/// Radius and length without the caps.
fn capsule(r: f64, length: f64, is_shell: bool) -> Solid {
    let square = r * r;
    // mass of the two halves of a sphere, and of the cylinder between them
    let (size, ball) = if is_shell {
        (2.0 * PI * r * (2.0 * r + length), 2.0 * r / (2.0 * r + length))
    } else {
        (PI * square * (length + 4.0 / 3.0 * r), 4.0 * r / (4.0 * r + 3.0 * length))
    };
    let tube = 1.0 - ball;
    let (across, along) = if is_shell {
        let of_ball = 2.0 / 3.0 * ball * square;
        let off = ball * length * (length + 2.0 * r) / 4.0;
        (tube * (6.0 * square + length * length) / 12.0 + of_ball + off, tube * square + of_ball)
    } else {
        let of_ball = 0.4 * ball * square;
        let off = ball * length * (3.0 * r + 2.0 * length) / 8.0;
        (
            tube * (3.0 * square + length * length) / 12.0 + of_ball + off,
            tube * square / 2.0 + of_ball,
        )
    };
    solid(size, [across, across, along])
}

fn cylinder(r: f64, length: f64, is_shell: bool) -> Solid {
    let square = r * r;
    if !is_shell {
        let across = (3.0 * square + length * length) / 12.0;
        return solid(PI * square * length, [across, across, square / 2.0]);
    }
    // the mantle, and the two discs at its ends
    let discs = r / (r + length);
    let mantle = 1.0 - discs;
    let across = mantle * (6.0 * square + length * length) / 12.0
        + discs * (square / 4.0 + length * length / 4.0);
    let along = mantle * square + discs * square / 2.0;
    solid(2.0 * PI * r * (r + length), [across, across, along])
}

/// Lengths of the edges.
fn cuboid([x, y, z]: [f64; 3], is_shell: bool) -> Solid {
    let sum = |a: f64, b: f64| (a * a + b * b) / 12.0;
    if !is_shell {
        return solid(x * y * z, [sum(y, z), sum(x, z), sum(x, y)]);
    }
    // pairs of faces across each axis: at a distance of half the edge, flat along it
    let edges = [x, y, z];
    let areas = [2.0 * y * z, 2.0 * x * z, 2.0 * x * y];
    let size: f64 = areas.iter().sum();
    let mut second = [0.0; 3];
    for (k, moment) in second.iter_mut().enumerate() {
        for (face, area) in areas.iter().enumerate() {
            let factor = if face == k { 0.25 } else { 1.0 / 12.0 };
            *moment += area / size * factor * edges[k] * edges[k];
        }
    }
    let [x, y, z] = second;
    solid(size, [y + z, x + z, x + y])
}

fn ellipsoid([x, y, z]: [f64; 3]) -> Solid {
    let sum = |a: f64, b: f64| (a * a + b * b) / 5.0;
    solid(4.0 / 3.0 * PI * x * y * z, [sum(y, z), sum(x, z), sum(x, y)])
}

/// The tensor of an inertia in the axes outside of a pose.
pub(super) fn turned(pose: Pose, [xx, xy, xz, yy, yz, zz]: Tensor) -> Tensor {
    let columns = pose.axes();
    let inner = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let entry = |i: usize, j: usize| {
        let mut sum = 0.0;
        for (a, row) in inner.iter().enumerate() {
            for (b, value) in row.iter().enumerate() {
                sum += columns[a][i] * value * columns[b][j];
            }
        }
        sum
    };
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

/// The inertia of a unit point mass about the origin.
pub(super) fn of_point([x, y, z]: [f64; 3]) -> Tensor {
    [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y]
}

/// All parts of a body as one, in the body's axes.
pub(super) fn sum(parts: &[Part]) -> Option<Part> {
    match parts {
        [] => None,
        [part] => Some(*part),
        parts => {
            let mass: f64 = parts.iter().map(|part| part.mass).sum();
            let moment = parts.iter().fold([0.0; 3], |sum, part| {
                plus(sum, part.pose.p.map(|x| x * part.mass))
            });
            let centre = moment.map(|x| x / mass);
            let mut inertia = [0.0; 6];
            for part in parts {
                let own = turned(part.pose, part.inertia);
                let off = of_point(minus(part.pose.p, centre));
                for (k, sum) in inertia.iter_mut().enumerate() {
                    *sum += own[k] + part.mass * off[k];
                }
            }
            Some(Part { mass, pose: Pose::at(centre), inertia })
        }
    }
}
