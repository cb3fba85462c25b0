//! Rewrites a description so that a closed pose becomes its zero pose.

use nalgebra::{Vector3, Vector6};

use crate::compile::{link_pose, loops_of, pose_of, unit_of};
use crate::description::{Cut, Description, Joint, JointKind, Limits, Loop, Placement, Row};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::{Matrix, Pose, from_quaternion, zero};

/// Makes the pose q (n_q, in the order of the submechanisms' trees) the zero pose of a robot:
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
    next.zero_pose.clear();
    for (j, joint) in next.joints.iter_mut().enumerate() {
        if let Some(coupling) = &mut joint.coupling {
            let masters: f64 =
                coupling.terms.iter().map(|(master, multiplier)| multiplier * moved[*master]).sum();
            coupling.offset += masters - moved[j];
            coupling.curves.iter_mut().for_each(|(of, f)| *f = f.moved(moved[*of]));
        }
    }
    // cuts in frames of the old zero pose stay where they were on both links
    let joints = Description { submechanisms: Vec::new(), ..next.clone() };
    for submechanism in &mut next.submechanisms {
        let at_rest = submechanism
            .spanning_tree
            .iter()
            .all(|j| joints.joints[*j].origin == description.joints[*j].origin);
        for cycle in submechanism.loops.iter_mut().filter(|_| !at_rest) {
            let link = match cycle.cut {
                Cut::AtJoint(j) => description.joints.get(j)?.child,
                Cut::AtLink(link) => link,
                Cut::Placed { .. } => continue,
            };
            let ends = [cycle.predecessor, cycle.successor];
            let on = |robot: &Description| {
                Some([seen_from(robot, ends[0], link)?, seen_from(robot, ends[1], link)?])
            };
            let ([predecessor, successor], there) = (on(description)?, on(&joints)?);
            // or the frame of the new zero pose is equivalent
            let moved =
                [predecessor.inverse().then(&there[0]), successor.inverse().then(&there[1])];
            let gap = moved[0].inverse().then(&moved[1]);
            if is_closed(&cycle.rows, &gap) && moved.iter().all(|by| is_same_cut(&cycle.rows, by)) {
                continue;
            }
            cycle.cut = Cut::Placed {
                predecessor: placement(&predecessor),
                successor: placement(&successor),
            };
        }
    }
    Some(next)
}

/// The robot with every cut placed on both of its links, and with displaced origins of joints and
/// placements of cuts: θ with the names of `ModelInfo::geometry`, by six. Loops may be open at its
/// zero pose. `None` for names of another robot.
pub fn displaced(
    description: &Description,
    names: &[String],
    theta: &[f64],
) -> Option<Description> {
    let mut next = description.clone();
    for (s, of) in next.submechanisms.iter_mut().enumerate() {
        of.loops = loops_of(description, s);
        for cycle in &mut of.loops {
            if let Some(cut) = placed(description, cycle) {
                cycle.cut = cut;
            }
        }
    }
    for (name, by) in names.chunks_exact(6).zip(theta.chunks_exact(6)) {
        let place = name[0].strip_suffix("/rx")?;
        let at = match next.joints.iter_mut().find(|joint| joint.name == place) {
            Some(joint) => &mut joint.origin,
            None => {
                let (cut, end) = place.rsplit_once('/')?;
                let mut loops = next.submechanisms.iter_mut().flat_map(|of| &mut of.loops);
                match &mut loops.find(|cycle| cycle.name == cut)?.cut {
                    Cut::Placed { predecessor, .. } if end == "predecessor" => predecessor,
                    Cut::Placed { successor, .. } => successor,
                    _ => return None,
                }
            }
        };
        if by.iter().any(|x| *x != 0.0) {
            let by = Placement { rpy: [by[0], by[1], by[2]], xyz: [by[3], by[4], by[5]] };
            *at = placement(&pose_of(at).then(&pose_of(&by)));
        }
    }
    Some(next)
}

/// Rounding of the difference of two frames, in metres and radians; and of two frames computed from
/// the same numbers.
const SAME: f64 = 1e-9;
const MOVED: f64 = 1e-13;

/// True where the rows hold at this pose of the successor's cut frame in the predecessor's: a cut
/// that is taken at the new zero pose is closed there by construction.
fn is_closed(rows: &[Row], gap: &Pose<Dd>) -> bool {
    let R = gap.R.map(Dd::to_f64);
    let p = gap.p.map(Dd::to_f64);
    let turn = [R[(2, 1)] - R[(1, 2)], R[(0, 2)] - R[(2, 0)], R[(1, 0)] - R[(0, 1)]];
    let gap = Vector6::new(0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2], p[0], p[1], p[2]);
    rows.iter().all(|row| Vector6::from(row.axis).dot(&gap).abs() < SAME)
}

/// True if the rows constrain the same motions when their cut frame is moved on its link: rows
/// (w, v) at a frame moved by (R, p) are (R w + p × R v, R v), and span the same.
fn is_same_cut(rows: &[Row], by: &Pose<Dd>) -> bool {
    let R = by.R.map(Dd::to_f64);
    let p = by.p.map(Dd::to_f64);
    let is_still = (R - nalgebra::Matrix3::identity()).norm() + p.norm() < SAME;
    if is_still || rows.iter().any(|row| row.against.is_some()) {
        return is_still;
    }
    let mut basis: Vec<Vector6<f64>> = Vec::new();
    let rest = |basis: &[Vector6<f64>], row: Vector6<f64>| {
        (0..2).fold(row, |rest, _| basis.iter().fold(rest, |rest, e| rest - e * e.dot(&rest)))
    };
    for row in rows.iter().map(|row| Vector6::from(row.axis)) {
        let left = rest(&basis, row);
        if left.norm() > SAME * row.norm() {
            basis.push(left.normalize());
        }
    }
    rows.iter().all(|row| {
        let axis = Vector6::from(row.axis);
        let v: Vector3<f64> = R * axis.fixed_rows::<3>(3);
        let w: Vector3<f64> = R * axis.fixed_rows::<3>(0) + Vector3::cross(&p, &v);
        let there = Vector6::new(w[0], w[1], w[2], v[0], v[1], v[2]);
        rest(&basis, there).norm() <= SAME * axis.norm()
    })
}

/// For each placed loop (submechanism, loop) the successor's placement that coincides with the
/// predecessor's at the zero pose.
pub fn closing_placements(description: &Description) -> Vec<(usize, usize, Placement)> {
    let mut found = Vec::new();
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        for (l, cycle) in submechanism.loops.iter().enumerate() {
            let Cut::Placed { predecessor, .. } = &cycle.cut else { continue };
            let frames = link_pose(description, cycle.predecessor)
                .zip(link_pose(description, cycle.successor));
            if let Some((P, S)) = frames {
                found.push((s, l, placement(&S.inverse().then(&P).then(&pose_of(predecessor)))));
            }
        }
    }
    found
}

pub(crate) const fn n_q(kind: JointKind) -> usize {
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
                e * c + axis.cross(e) * s + axis * (axis[i] * (Dd::ONE - c))
            };
            Pose {
                R: nalgebra::Matrix3::from_columns(&[column(0), column(1), column(2)]),
                p: zero(),
            }
        }
        (JointKind::Prismatic, [x]) => Pose { R: Matrix::identity(), p: unit_of(joint.axis)? * *x },
        (JointKind::Spherical, [x, y, z, w]) => {
            Pose { R: from_quaternion(*x, *y, *z, *w), p: zero() }
        }
        (JointKind::Floating, [a, b, c, x, y, z, w]) => {
            Pose { R: from_quaternion(*x, *y, *z, *w), p: Vector3::new(*a, *b, *c) }
        }
        _ => return None,
    })
}

/// Pose of a link at zero of all joints {another link}.
fn seen_from(description: &Description, from: usize, link: usize) -> Option<Pose<Dd>> {
    Some(link_pose(description, from)?.inverse().then(&link_pose(description, link)?))
}

/// The link in whose frame at zero a cut lies.
fn cut_link(description: &Description, cut: &Cut) -> Option<usize> {
    match cut {
        Cut::AtJoint(j) => description.joints.get(*j).map(|joint| joint.child),
        Cut::AtLink(link) => Some(*link),
        Cut::Placed { .. } => None,
    }
}

/// The cut of a loop by its placements on both links, where it lay in a frame of the zero pose.
pub(crate) fn placed(description: &Description, cycle: &Loop) -> Option<Cut> {
    let link = cut_link(description, &cycle.cut)?;
    Some(Cut::Placed {
        predecessor: placement(&seen_from(description, cycle.predecessor, link)?),
        successor: placement(&seen_from(description, cycle.successor, link)?),
    })
}

/// True where a cut in a frame of the zero pose lies elsewhere on one of its links in the other
/// description, which differs in origins.
pub(crate) fn has_moved(description: &Description, other: &Description, cycle: &Loop) -> bool {
    let Some(link) = cut_link(description, &cycle.cut) else { return false };
    [cycle.predecessor, cycle.successor].into_iter().any(|end| {
        let both = seen_from(description, end, link).zip(seen_from(other, end, link));
        both.is_none_or(|(a, b)| {
            let by = a.inverse().then(&b);
            let R = by.R.map(Dd::to_f64);
            let p = by.p.map(Dd::to_f64);
            (R - nalgebra::Matrix3::identity()).norm() + p.norm() > MOVED
        })
    })
}

/// The origin of a joint whose child stands still at coordinates of it; `None` for coordinates of
/// another kind.
pub(crate) fn moved(joint: &Joint, q: &[f64]) -> Option<Placement> {
    match is_rest(joint.kind, q) {
        true => Some(joint.origin),
        false => Some(placement(&pose_of(&joint.origin).then(&motion(joint, q)?))),
    }
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
