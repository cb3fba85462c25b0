//! The loops that a type defines when a file gives none: where each leg is cut and in which directions it is tied.

use nalgebra::Vector3;

use super::geometry::{pose, unit, vector};
use crate::description::{Cut, Description, Loop, Row, Submechanism, SubmechanismKind};
use crate::fault::{Fault, Site};
use crate::scalar::{Dd, Scalar};
use crate::spatial::{Pose, cross, mul, t_mul};

/// The loops of a submechanism: those given, or those of its type.
pub(super) fn loops(description: &Description, s: usize, errors: &mut Vec<Fault>) -> Vec<Loop> {
    let submechanism = &description.submechanisms[s];
    if !submechanism.loops.is_empty() {
        return submechanism.loops.clone();
    }
    let coupled = submechanism.spanning_tree.iter().filter(|j| description.joints[**j].coupling.is_some()).count();
    if submechanism.independent.len() + coupled == submechanism.spanning_tree.len() {
        return Vec::new();
    }
    let of_type = match submechanism.kind {
        SubmechanismKind::Rrpr => lambda(description, submechanism),
        SubmechanismKind::Spu2U1 => legs(description, submechanism, 2, 2),
        SubmechanismKind::Ups6 => legs(description, submechanism, submechanism.independent.len(), 6),
        _ => None,
    };
    of_type.unwrap_or_else(|| {
        errors.push(Fault {
            site: Site::Submechanism(s),
            found: format!("dependent joints in {} (type {}) that nothing determines", submechanism.name, submechanism.type_name),
            expected: "loop_constraints, couplings, or a type that defines its loops for these joints".into(),
            help: "add loop_constraints".into(),
        });
        Vec::new()
    })
}

/// RRPR: rocker, stator, slider; the pin is the slider's origin, tied to the rocker along the slider and across it in the plane that is
/// perpendicular to the rocker's axis.
fn lambda(description: &Description, submechanism: &Submechanism) -> Option<Vec<Loop>> {
    let [rocker, _, slider] = submechanism.spanning_tree[..] else { return None };
    let normal = direction_in_root(description, rocker)?;
    let along = direction_in_root(description, slider)?;
    let frame = in_root(description, description.joints[slider].child)?.R;
    let row = |name: &str, v: Vector3<Dd>| {
        let v = t_mul(&frame, &v).map(Dd::to_f64);
        Row { name: name.into(), axis: [0.0, 0.0, 0.0, v[0], v[1], v[2]], against: None }
    };
    let across = unit(&cross(&normal, &along))?;
    Some(vec![Loop {
        name: description.joints[slider].name.clone(),
        predecessor: description.joints[rocker].child,
        successor: description.joints[slider].child,
        cut: Cut::AtJoint(slider),
        rows: vec![row("along", unit(&along)?), row("across", across)],
    }])
}

/// Independent joints that carry a platform, then three joints a leg; each slider's origin is a point of the platform.
fn legs(description: &Description, submechanism: &Submechanism, chain: usize, legs: usize) -> Option<Vec<Loop>> {
    let joints = &submechanism.spanning_tree;
    if joints.len() != chain + 3 * legs {
        return None;
    }
    // the independent joint that carries no other one carries the platform
    let carries = |j: &usize| submechanism.independent.iter().any(|other| other != j && is_above(description, *j, *other));
    let platform = description.joints[*submechanism.independent.iter().find(|j| !carries(j))?].child;
    Some(joints[chain..].chunks_exact(3).map(|leg| spherical(description, leg[2], platform)).collect())
}

/// A ball joint between a slider's body and another link, at the slider's origin.
fn spherical(description: &Description, slider: usize, successor: usize) -> Loop {
    let row =
        |name: &str, k: usize| Row { name: name.into(), axis: std::array::from_fn(|i| if i == 3 + k { 1.0 } else { 0.0 }), against: None };
    Loop {
        name: description.joints[slider].name.clone(),
        predecessor: description.joints[slider].child,
        successor,
        cut: Cut::AtJoint(slider),
        rows: vec![row("x", 0), row("y", 1), row("z", 2)],
    }
}

/// True when a joint lies on the way from the root to another.
fn is_above(description: &Description, j: usize, other: usize) -> bool {
    let mut link = description.joints[other].parent;
    for _ in 0..=description.joints.len() {
        let Some(at) = description.joints.iter().position(|joint| joint.child == link) else { return false };
        if at == j {
            return true;
        }
        link = description.joints[at].parent;
    }
    false
}

/// Pose of a link at zero {root}.
fn in_root(description: &Description, mut link: usize) -> Option<Pose<Dd>> {
    let mut x = Pose::identity();
    for _ in 0..=description.joints.len() {
        let Some(joint) = description.joints.iter().find(|joint| joint.child == link) else { return Some(x) };
        x = pose(&joint.origin).then(&x);
        link = joint.parent;
    }
    None
}

/// Axis of a joint at zero {root}.
fn direction_in_root(description: &Description, j: usize) -> Option<Vector3<Dd>> {
    let joint = &description.joints[j];
    Some(mul(&in_root(description, joint.child)?.R, &vector(joint.axis)))
}
