//! A loop as the ring of its joints, the cut one among them.

use nalgebra::Vector3;

use crate::compile::closed_forms::{Deviation, Reading, sign};
use crate::compile::geometry::{axis, direction, norm, unit};
use crate::mechanism::{Cut, Motion};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::zero;

/// One joint of a ring.
#[derive(Clone)]
pub(super) struct Ring {
    /// `None`: the cut.
    pub(super) joint: Option<usize>,
    pub(super) slides: bool,
    /// Its position and axis at zero {cluster's parent body}; the cut has no axis.
    pub(super) point: Vector3<Dd>,
    pub(super) axis: Vector3<Dd>,
    /// +1 where the link after it is the joint's child, −1 where it is the parent.
    pub(super) direction: Dd,
}

/// The joints on the path from the predecessor's and the successor's common parent to the cut and
/// back, each of one freedom; of a coupling the cut alone.
pub(super) fn ring(of: &Reading<'_>, cut: &Cut<Dd>) -> Vec<Ring> {
    let path = if cut.is_coupling() { &[] } else { &cut.path[..] };
    let (p, s) = path.split_at(path.partition_point(|(_, on_successor)| !on_successor));
    let member = |&(j, on_successor): &(usize, bool)| {
        let pose = &of.zero[j + 1];
        let slides = of.bodies[j].motion == Motion::Prismatic;
        let direction = if on_successor { -Dd::ONE } else { Dd::ONE };
        Ring { joint: Some(j), slides, point: pose.p, axis: axis(pose), direction }
    };
    let point = of.zero[cut.predecessor].point(&cut.x_p_cut.p);
    let cut = Ring { joint: None, slides: false, point, axis: zero(), direction: Dd::ONE };
    p.iter().rev().map(member).chain([cut]).chain(s.iter().map(member)).collect()
}

/// Rotates a ring to begin with a joint.
pub(super) fn starting_at(mut ring: Vec<Ring>, joint: usize) -> Result<Vec<Ring>, String> {
    let at = ring
        .iter()
        .position(|x| x.joint == Some(joint))
        .ok_or("independent joint is not in the loop")?;
    ring.rotate_left(at);
    Ok(ring)
}

/// Reverses a ring but for its first joint.
pub(super) fn reversed(ring: &[Ring]) -> Vec<Ring> {
    let n = ring.len();
    (0..n)
        .map(|k| &ring[(n - k) % n])
        .map(|x| Ring { direction: -x.direction, ..x.clone() })
        .collect()
}

/// How far the axes are from perpendicular to the plane, or in it for a slider; for each turning
/// joint ±1, the sign of its axis against n.
pub(super) fn senses(ring: &[Ring], n: &Vector3<Dd>, deviations: &mut Vec<Deviation>) -> Vec<Dd> {
    let mut sense = Vec::new();
    for member in ring {
        let Some(j) = member.joint else {
            sense.push(member.direction);
            continue;
        };
        let along = member.axis.dot(*n);
        if member.slides {
            deviations.push(("slider not in the plane, axis", Some(j), along.abs().to_f64()));
            sense.push(member.direction);
        } else {
            let off = norm(&member.axis.cross(*n)).to_f64();
            deviations.push(("axis not parallel to the others of its loop, axis", Some(j), off));
            sense.push(member.direction * sign(along));
        }
    }
    sense
}

/// A cut that ties the two directions of the plane and leaves the turn about its normal: two rows
/// in the plane, three in any directions, and angular rows in the plane.
pub(super) fn pin_in_plane(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    n: &Vector3<Dd>,
    deviations: &mut Vec<Deviation>,
) -> Result<(), String> {
    let turn =
        |v: &Vector3<Dd>| unit(&direction(&of.zero[cut.predecessor], &direction(&cut.x_p_cut, v)));
    let mut linear = Vec::new();
    let mut off = 0.0f64;
    for row in &cut.rows {
        match (turn(&row.angular), turn(&row.linear)) {
            _ if row.against.is_some() => {
                return Err("loop holds two directions perpendicular".into());
            }
            (Some(angular), None) => off = off.max(angular.dot(*n).abs().to_f64()),
            (None, Some(x)) => linear.push(x),
            _ => return Err("loop has a constraint axis that turns and slides".into()),
        }
    }
    let spans = match linear.as_slice() {
        [x, y] => {
            off = off.max((*x).dot(*n).abs().to_f64()).max((*y).dot(*n).abs().to_f64());
            norm(&(*x).cross(*y)).to_f64()
        }
        [x, y, z] => (*x).dot((*y).cross(*z)).abs().to_f64(),
        _ => 0.0,
    };
    if spans < 1e-3 {
        return Err("loop does not tie both directions of its plane".into());
    }
    deviations.push(("a constraint axis of the loop not in the plane", None, off));
    Ok(())
}
