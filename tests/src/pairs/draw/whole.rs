//! A drawn robot gets its sizes, springs, limits and base as a whole.

use sarrus_dynamics::description::{
    Coupling, Curve, Cut, Description, Inertial, Joint, JointKind, Limits, Link, Placement,
    Submechanism, SubmechanismKind as Kind, Terms,
};

use super::Z;
use crate::seed::Seeded;

/// Every length times `lengths` and every mass times `masses`.
pub(super) fn resize(of: &mut Description, lengths: f64, masses: f64) {
    let place = |x: &mut Placement| x.xyz = x.xyz.map(|x| lengths * x);
    for inertial in of.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
        place(&mut inertial.origin);
        inertial.mass *= masses;
        inertial.inertia = inertial.inertia.map(|x| masses * lengths * lengths * x);
    }
    of.gravity = of.gravity.map(|x| lengths * x);
    let slides: Vec<bool> = of.joints.iter().map(|j| j.kind == JointKind::Prismatic).collect();
    let unit = |j: usize| if slides[j] { lengths } else { 1.0 };
    for (j, joint) in of.joints.iter_mut().enumerate() {
        place(&mut joint.origin);
        if let Some(coupling) = &mut joint.coupling {
            coupling.offset *= unit(j);
            coupling.terms.iter_mut().for_each(|(k, ratio)| *ratio *= unit(j) / unit(*k));
            for (of, curve) in &mut coupling.curves {
                let from = unit(*of);
                match curve {
                    Curve::Polynomial { about, coefficients } => {
                        *about *= from;
                        let scale = (0..).map(|k| unit(j) / from.powi(k));
                        coefficients.iter_mut().zip(scale).for_each(|(c, scale)| *c *= scale);
                    }
                    Curve::Table(points) => {
                        points.iter_mut().for_each(|[x, y]| (*x, *y) = (from * *x, unit(j) * *y));
                    }
                }
            }
        }
    }
    for cut in of.submechanisms.iter_mut().flat_map(|part| &mut part.loops) {
        if let Cut::Placed { predecessor, successor } = &mut cut.cut {
            place(predecessor);
            place(successor);
        }
    }
}

/// The inertia that is typical of the links, about a joint.
fn inertia_of(of: &Description, length: f64) -> f64 {
    let masses: Vec<f64> = of.links.iter().filter_map(|x| Some(x.inertial?.mass)).collect();
    let mass = masses.iter().sum::<f64>() / masses.len().max(1) as f64;
    mass * length * length
}

pub(super) fn springs(of: &mut Description, seeded: &mut Seeded, length: f64) {
    let inertia = inertia_of(of, length);
    for joint in &mut of.joints {
        let slides = joint.kind == JointKind::Prismatic;
        let unit = if slides { length } else { 1.0 };
        let size = inertia / (unit * unit);
        match joint.kind {
            JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => {
                let mut number =
                    |most: f64| if seeded.chance(0.4) { seeded.within(0.0, most) } else { 0.0 };
                joint.terms = Terms {
                    damping: number(size),
                    stiffness: number(10.0 * size),
                    rest: number(3.0) * unit,
                    rotor_inertia: number(0.01 * size),
                    gear_ratio: 1.0 + number(20.0),
                    ..Terms::default()
                };
            }
            JointKind::Spherical if seeded.chance(0.5) => {
                joint.terms.damping = seeded.within(0.0, inertia);
            }
            _ => {}
        }
    }
}

pub(super) fn limits(of: &mut Description, seeded: &mut Seeded, length: f64) {
    for joint in &mut of.joints {
        let unit = match joint.kind {
            JointKind::Revolute => 1.0,
            JointKind::Prismatic => length,
            _ => continue,
        };
        if seeded.chance(0.6) {
            let mut number = |low: f64, high: f64| {
                if seeded.chance(0.7) { unit * seeded.within(low, high) } else { f64::INFINITY }
            };
            joint.limits = Some(Limits {
                lower: -number(0.0, 7.0),
                upper: number(0.0, 7.0),
                velocity: number(0.5, 4.0),
                effort: number(0.1, 100.0),
            });
        }
    }
}

/// Rows of one kind lean against those before them, by angles down to a thousandth.
pub(super) fn lean(of: &Description, seeded: &mut Seeded) -> Description {
    let mut of = of.clone();
    for cut in of.submechanisms.iter_mut().flat_map(|part| &mut part.loops) {
        let rows = cut.rows.iter().map(|row| row.axis).collect::<Vec<_>>();
        let linear = |axis: &[f64; 6]| axis[..3].iter().all(|x| *x == 0.0);
        for (k, row) in cut.rows.iter_mut().enumerate().filter(|(_, row)| row.against.is_none()) {
            let by = 10f64.powf(seeded.within(-2.7, 0.0));
            let mut axis = row.axis.map(|x| by * x);
            for before in rows[..k].iter().filter(|axis| linear(axis) == linear(&row.axis)) {
                let part = seeded.within(-1.0, 1.0);
                (0..6).for_each(|i| axis[i] += part * before[i]);
            }
            row.axis = axis;
        }
    }
    of
}

/// Puts the robot on a joint of a kind, up to this far from a new root.
pub(super) fn on_base(of: &mut Description, kind: JointKind, seeded: &mut Seeded, size: f64) {
    let mut has_parent = vec![false; of.links.len()];
    of.joints.iter().for_each(|joint| has_parent[joint.child] = true);
    let root = has_parent.iter().position(|has| !has).unwrap_or(0);
    if kind == JointKind::Floating && of.links[root].inertial.is_none() {
        let mass = of.links.iter().filter_map(|x| Some(x.inertial?.mass)).fold(0.0, f64::max);
        let i = 0.1 * mass * size * size;
        of.links[root].inertial =
            Some(Inertial::new(mass, [0.1 * size; 3], [i, 0.0, 0.0, i, 0.0, i]));
    }
    let name = format!("world{}", of.links.len());
    of.links.push(Link { name: name.clone(), inertial: None });
    let at = seeded.pose(size);
    of.joints.push(Joint {
        name: format!("{name}_joint"),
        kind,
        parent: of.links.len() - 1,
        child: root,
        origin: Placement { xyz: at.p, rpy: at.rpy() },
        axis: Z,
        limits: None,
        coupling: None::<Coupling>,
        terms: Terms::default(),
        motor: None,
    });
    if kind != JointKind::Fixed {
        let joint = of.joints.len() - 1;
        of.submechanisms.push(Submechanism {
            name: "base".into(),
            kind: Kind::Serial,
            type_name: "SERIAL".into(),
            spanning_tree: vec![joint],
            independent: vec![joint],
            active: vec![],
            loops: vec![],
            closed_forms: true,
        });
    }
}
