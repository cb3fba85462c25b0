//! Checks for masses in grams and lengths in millimetres. A robot may have any size, so this is a
//! warning, and machines from micrometres to kilometres pass the rules: bodies denser than any
//! metal, and robots lighter than the surrounding air.

use std::f64::consts::PI;

use sarrus_dynamics::Site;
use sarrus_dynamics::description::{Description, Inertial};

use crate::build::Spans;
use crate::report::{Diagnostics, quoted};

/// A large mass for a link `[kg]`.
const HEAVY: f64 = 50.0;
/// A density that no body reaches: osmium has 2.3e4 `[kg/m³]`.
const IMPOSSIBLE: f64 = 6e4;
/// Mass of heavy links alone in the cube of the robot's reach that is dense `[kg/m³]`.
const DENSE: f64 = 5e3;
/// All mass in the cube of the robot's reach, where that is too large `[kg/m³]`, and the least
/// offset `[m]`.
const THIN: f64 = 1e-5;
const LONG: f64 = 10.0;
/// A joint offset that is longer than any robot `[m]`.
const LONGEST: f64 = 100.0;

/// Warns of masses that may be in grams and lengths that may be in millimetres.
pub(crate) fn check(description: &Description, spans: &Spans, diagnostics: &mut Diagnostics) {
    let distance = distances(description);
    let links = description.links.iter().enumerate();
    let bodies: Vec<(usize, &Inertial)> = links
        .filter_map(|(i, link)| Some((i, link.inertial.as_ref().filter(|of| of.mass > 0.0)?)))
        .collect();
    let far = bodies
        .iter()
        .map(|(i, of)| distance.get(*i).unwrap_or(&0.0) + length(of.origin.xyz) + gyration(of));
    let reach = far.chain(distance.iter().copied()).fold(0.0, f64::max);
    let total: f64 = bodies.iter().map(|(_, of)| of.mass).sum();
    let density = total / reach.powi(3);

    // grams
    let heaviest = bodies.iter().max_by(|a, b| a.1.mass.total_cmp(&b.1.mass));
    let mut densities: Vec<f64> =
        bodies.iter().map(|(_, of)| least_density(of).unwrap_or(f64::INFINITY)).collect();
    densities.sort_by(f64::total_cmp);
    let median = densities.get(densities.len() / 2).copied().filter(|x| x.is_finite());
    let all_heavy = bodies.iter().all(|(_, of)| of.mass >= HEAVY);
    if let Some((i, of)) = heaviest.filter(|(_, of)| of.mass >= HEAVY)
        && (median.is_some_and(|median| median > IMPOSSIBLE) || (all_heavy && density > DENSE))
    {
        let name = description.links.get(*i).map(|link| quoted(&link.name)).unwrap_or_default();
        let found = format!("{} kg of link {name} in a robot of {reach:.2} m", of.mass);
        let help = "divide the masses and inertias by 1000 if they are in grams";
        diagnostics.warning(spans.of(Site::Link(*i)), found, "masses in kilograms", help);
    }

    // one body among others
    let is_dense = |of: &Inertial| least_density(of).filter(|density| *density > IMPOSSIBLE);
    if median.is_none_or(|median| median <= IMPOSSIBLE) {
        for (i, density) in bodies.iter().filter_map(|(i, of)| Some((*i, is_dense(of)?))) {
            let name = description.links.get(i).map(|link| quoted(&link.name)).unwrap_or_default();
            let found = format!("link {name} is denser than {density:.1e} kg/m³");
            let help = "correct its mass or its inertia";
            let expected = "at most 2.3e4, the density of osmium";
            diagnostics.warning(spans.of(Site::Link(i)), found, expected, help);
        }
    }

    // millimetres
    let offsets = description.joints.iter().map(|joint| length(joint.origin.xyz)).enumerate();
    let longest = offsets.max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((j, offset)) = longest
        && (offset > LONGEST || (offset > LONG && total > 0.0 && density < THIN))
    {
        let name = description.joints.get(j).map(|joint| quoted(&joint.name)).unwrap_or_default();
        let found = format!("an offset of {offset} m at the joint {name}");
        let help = "divide the lengths by 1000 if they are in millimetres";
        diagnostics.warning(spans.of(Site::Joint(j)), found, "lengths in metres", help);
    }
}

/// Length of the joint offsets between the root and each link.
fn distances(description: &Description) -> Vec<f64> {
    let n = description.links.len();
    let mut above = vec![None; n];
    for joint in &description.joints {
        if let Some(slot) = above.get_mut(joint.child) {
            *slot = Some((joint.parent, length(joint.origin.xyz)));
        }
    }
    let distance = |start: usize| {
        let next = |(link, _): &(usize, f64)| above.get(*link).copied().flatten();
        let path: Vec<(usize, f64)> =
            std::iter::successors(Some((start, 0.0)), next).take(n + 1).collect();
        path.iter().rev().map(|(_, offset)| offset).sum()
    };
    (0..n).map(distance).collect()
}

/// The density of a ball with the mass and the largest moment of the diagonal of a body: no body
/// with these is less dense `[kg/m³]`. `None` without a moment.
pub(crate) fn least_density(of: &Inertial) -> Option<f64> {
    // r² = 2/5 R²
    let radius = 2.5_f64.sqrt() * gyration(of);
    (radius > 0.0).then(|| of.mass / (4.0 / 3.0 * PI * radius.powi(3)))
}

/// Radius of gyration about the axis of the largest moment of the diagonal.
fn gyration(of: &Inertial) -> f64 {
    let [xx, _, _, yy, _, zz] = of.inertia;
    (xx.max(yy).max(zz).max(0.0) / of.mass).sqrt()
}

fn length(xyz: [f64; 3]) -> f64 {
    xyz.iter().map(|x| x * x).sum::<f64>().sqrt()
}
