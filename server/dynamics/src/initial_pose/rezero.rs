//! What to write into the files so that a closed pose becomes the zero pose.

use nalgebra::Vector3;

use crate::compile::{pose_of, unit_of};
use crate::description::{Cut, Description, Joint, JointKind, Limits, Placement};
use crate::scalar::{Dd, Real, Scalar};
use crate::spatial::{Pose, cross, from_quaternion, identity, zero};

/// The same robot with the pose q (n_q, in the order of the submechanisms' trees) as its zero pose:
/// origins of the joints, placements of cuts that lay in frames of the zero pose, limits, offsets
/// of couplings and rests of springs. `None` when q has another length.
pub fn rezeroed(description: &Description, q: &[f64]) -> Option<Description> {
    let mut rest = q;
    let mut moved = vec![0.0; description.joints.len()];
    let mut next = description.clone();
    for &j in description.submechanisms.iter().flat_map(|s| &s.spanning_tree) {
        let joint = description.joints.get(j)?;
        let (own, others) = rest.split_at_checked(n_q(joint.kind))?;
        rest = others;
        if let [x] = own {
            moved[j] = *x;
        }
        if is_rest(joint.kind, own) {
            continue;
        }
        let to = &mut next.joints[j];
        to.origin = placement(&pose_of(&joint.origin).then(&motion(joint, own)?));
        to.limits = joint.limits.map(|x| Limits {
            lower: x.lower - moved[j],
            upper: x.upper - moved[j],
            ..x
        });
        to.terms.rest -= moved[j];
    }
    if !rest.is_empty() {
        return None;
    }
    for (j, joint) in next.joints.iter_mut().enumerate() {
        if let Some(coupling) = &mut joint.coupling {
            let masters: f64 =
                coupling.terms.iter().map(|(master, multiplier)| multiplier * moved[*master]).sum();
            coupling.offset += masters - moved[j];
        }
    }
    // cuts in frames of the old zero pose stay where they were on both links
    for submechanism in &mut next.submechanisms {
        let at_rest = submechanism
            .spanning_tree
            .iter()
            .all(|j| next.joints[*j].origin == description.joints[*j].origin);
        for of in submechanism.loops.iter_mut().filter(|_| !at_rest) {
            let frame = match of.cut {
                Cut::AtJoint(j) => in_root(description, description.joints.get(j)?.child)?,
                Cut::AtLink(link) => in_root(description, link)?,
                Cut::Placed { .. } => continue,
            };
            let on =
                |link: usize| Some(placement(&in_root(description, link)?.inverse().then(&frame)));
            of.cut = Cut::Placed { predecessor: on(of.predecessor)?, successor: on(of.successor)? };
        }
    }
    Some(next)
}

/// For each placed loop (submechanism, loop) the successor's placement that coincides with the
/// predecessor's at the zero pose.
pub fn closing_placements(description: &Description) -> Vec<(usize, usize, Placement)> {
    let mut found = Vec::new();
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        for (l, of) in submechanism.loops.iter().enumerate() {
            let Cut::Placed { predecessor, .. } = &of.cut else { continue };
            let frames =
                in_root(description, of.predecessor).zip(in_root(description, of.successor));
            if let Some((P, S)) = frames {
                found.push((s, l, placement(&S.inverse().then(&P).then(&pose_of(predecessor)))));
            }
        }
    }
    found
}

const fn n_q(kind: JointKind) -> usize {
    match kind {
        JointKind::Fixed => 0,
        JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => 1,
        JointKind::Spherical => 4,
        JointKind::Floating => 7,
    }
}

/// True where a joint has not moved.
fn is_rest(kind: JointKind, q: &[f64]) -> bool {
    let quaternion = matches!(kind, JointKind::Spherical | JointKind::Floating);
    q.iter().rev().enumerate().all(|(i, x)| *x == if quaternion && i == 0 { 1.0 } else { 0.0 })
}

/// Pose of the child in the joint's frame.
fn motion(joint: &Joint, q: &[f64]) -> Option<Pose<Dd>> {
    let q: Vec<Dd> = q.iter().map(|x| Dd::from_f64(*x)).collect();
    Some(match (joint.kind, q.as_slice()) {
        (JointKind::Revolute | JointKind::Continuous, [angle]) => {
            let axis = unit_of(joint.axis)?;
            // cos 1 + sin [a]× + (1 − cos) a aᵀ
            let (s, c) = angle.sin_cos();
            let column = |i: usize| {
                let e = Vector3::from_fn(|k, _| if k == i { Dd::ONE } else { Dd::ZERO });
                e * c + cross(&axis, &e) * s + axis * (axis[i] * (Dd::ONE - c))
            };
            Pose {
                R: nalgebra::Matrix3::from_columns(&[column(0), column(1), column(2)]),
                p: zero(),
            }
        }
        (JointKind::Prismatic, [x]) => Pose { R: identity(), p: unit_of(joint.axis)? * *x },
        (JointKind::Spherical, [x, y, z, w]) => {
            Pose { R: from_quaternion(*x, *y, *z, *w), p: zero() }
        }
        (JointKind::Floating, [a, b, c, x, y, z, w]) => {
            Pose { R: from_quaternion(*x, *y, *z, *w), p: Vector3::new(*a, *b, *c) }
        }
        _ => return None,
    })
}

/// Pose of a link at zero {root}.
fn in_root(description: &Description, mut link: usize) -> Option<Pose<Dd>> {
    let mut x = Pose::identity();
    for _ in 0..=description.joints.len() {
        let Some(joint) = description.joints.iter().find(|joint| joint.child == link) else {
            return Some(x);
        };
        x = pose_of(&joint.origin).then(&x);
        link = joint.parent;
    }
    None
}

/// Translation, roll, pitch and yaw of a pose.
pub(crate) fn placement(pose: &Pose<Dd>) -> Placement {
    let r = |i: usize, j: usize| pose.R[(i, j)];
    let level = (r(0, 0) * r(0, 0) + r(1, 0) * r(1, 0)).sqrt();
    let pitch = (-r(2, 0)).atan2(level);
    // straight up or down only roll ± yaw is determined
    let (roll, yaw) = if level.to_f64() < 1e-14 {
        (Dd::ZERO, (-r(0, 1)).atan2(r(1, 1)))
    } else {
        (r(2, 1).atan2(r(2, 2)), r(1, 0).atan2(r(0, 0)))
    };
    let number = |x: Dd| if x.to_f64() == 0.0 { 0.0 } else { x.to_f64() };
    Placement { xyz: [0, 1, 2].map(|i| number(pose.p[i])), rpy: [roll, pitch, yaw].map(number) }
}
