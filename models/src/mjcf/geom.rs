//! Geoms as far as they give mass.

use super::compiler::Compiler;
use super::item::Item;
use super::solid::{Tensor, capsule, cuboid, cylinder, ellipsoid, of_point, sphere, turned};
use super::source::Source;
use crate::pose::{Pose, from_z, minus, plus};
use crate::report::{Diagnostics, quoted};
use crate::rotation::dot;

/// A rigid part of a body: its pose is that of its centre of mass and the axes of its inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) mass: f64,
    pub(super) pose: Pose,
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
    Source { compiler, meshes, .. }: &Source<'_>,
    groups: [f64; 2],
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
    if !(groups[0]..=groups[1]).contains(&group)
        || mass.map_or(density == 0.0, |mass| mass == 0.0)
        || ["plane", "hfield"].contains(&kind)
    {
        return None;
    }
    let wrong = match (mass.is_some_and(|mass| mass < 0.0), half_length) {
        (true, _) => Some(("mass", "0 or more")),
        _ if density < 0.0 => Some(("density", "0 or more")),
        (_, Some(_)) if kind == "sphere" => Some(("fromto", "`pos`, for a sphere has no ends")),
        _ => None,
    };
    if let Some((name, expected)) = wrong {
        let found = format!("`{name}` of a {kind} is {}", item.text(name).unwrap_or_default());
        return diagnostics.refused(item.at(name), found, expected, "correct it");
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
            return diagnostics.refused(item.at("size"), found, expected, "correct it");
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

/// All parts of a body as one, in the body's axes.
pub(super) fn sum(parts: &[Part]) -> Option<Part> {
    match parts {
        [] => None,
        [part] => Some(*part),
        parts => {
            let mass: f64 = parts.iter().map(|part| part.mass).sum();
            let moment = parts
                .iter()
                .fold([0.0; 3], |sum, part| plus(sum, part.pose.p.map(|x| x * part.mass)));
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
