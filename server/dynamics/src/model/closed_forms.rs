//! Reads the geometry of closed forms off a cluster at its zero pose, and measures how well it fits.

use nalgebra::{Matrix3, Vector3};

use super::geometry::{axis, direction, norm, unit};
use super::{Body, Cluster, Motion};
use crate::closure::{Closure, Cut, Leg, Legs, Numerical, Rrpr};
use crate::description::SubmechanismKind;
use crate::scalar::{Dd, Real, Scalar};
use crate::spatial::{Pose, cross, dot, scale_add, t_mul};

/// A closed form and how far each assumption of it is from true.
pub(super) struct Form {
    closure: Closure<Dd>,
    deviations: Vec<(String, Subject, f64)>,
}

/// What an assumption is about.
enum Subject {
    Joint(usize),
    Loop,
}

impl Form {
    /// The worst deviation and what it is about.
    pub(super) fn misfit(&self, names: &[String]) -> (String, f64) {
        let worst = self.deviations.iter().max_by(|a, b| a.2.total_cmp(&b.2));
        worst.map_or((String::new(), 0.0), |(what, subject, size)| match subject {
            Subject::Joint(j) => (format!("{what} of {}", names[*j]), *size),
            Subject::Loop => (what.clone(), *size),
        })
    }

    /// Adds Newton's method on the true rows.
    pub(super) fn polish(&mut self, numerical: Numerical<Dd>) {
        match &mut self.closure {
            Closure::Rrpr(rrpr) => rrpr.polish = Some(numerical),
            Closure::Legs(legs) => legs.polish = Some(numerical),
            _ => {}
        }
    }

    pub(super) fn closure(self) -> Closure<Dd> {
        self.closure
    }
}

/// The closed form of a type on this cluster: `None` for a type without one, `Some(Err)` with what the cluster lacks for it.
pub(super) fn build(kind: SubmechanismKind, cluster: &Cluster<Dd>, bodies: &[Body<Dd>], order: &[usize]) -> Option<Result<Form, String>> {
    let zero = zero_poses(cluster, bodies);
    match kind {
        SubmechanismKind::Rrpr => Some(rrpr(cluster, bodies, order, &zero)),
        SubmechanismKind::Spu2U1 | SubmechanismKind::Ups6 => Some(legs(cluster, bodies, order, &zero)),
        _ => None,
    }
}

/// Pose of each local body at zero {cluster's parent body}.
fn zero_poses(cluster: &Cluster<Dd>, bodies: &[Body<Dd>]) -> Vec<Pose<Dd>> {
    let mut pose = vec![Pose::identity()];
    for (j, body) in bodies.iter().enumerate() {
        let next = pose[cluster.local_parent[j]].then(&Pose { R: body.E, p: body.r });
        pose.push(next);
    }
    pose
}

/// The lambda: joints rocker, stator, slider.
fn rrpr(cluster: &Cluster<Dd>, bodies: &[Body<Dd>], order: &[usize], zero: &[Pose<Dd>]) -> Result<Form, String> {
    let &[j1, j2, j3] = order else { return Err("joints are not three".into()) };
    let kinds = [j1, j2, j3].map(|j| bodies[j].motion);
    if kinds != [Motion::Revolute, Motion::Revolute, Motion::Prismatic] {
        return Err("joints are not revolute, revolute, prismatic".into());
    }
    if cluster.independent != [j1] || cluster.local_parent[j1] != 0 || cluster.local_parent[j2] != 0 || cluster.local_parent[j3] != j2 + 1 {
        return Err("rocker is not the independent joint beside a stator that carries the slider".into());
    }
    let [cut] = &cluster.cuts[..] else { return Err("loops are not one".into()) };
    if !ties(cut, j1 + 1, j3 + 1) || cut.angular || cut.rows.len() != 2 {
        return Err("loop does not tie rocker and slider in two directions".into());
    }

    // the plane of the mechanism: n along the rocker's axis, e1 along the stator's direction or any, e2 = n × e1
    let n = axis(&zero[j1 + 1]);
    let pin = zero[cut.predecessor].point(&cut.x_p_cut.p);
    let (to_stator, to_pin) = (zero[j2 + 1].p - zero[j1 + 1].p, pin - zero[j1 + 1].p);
    let in_plane = |v: &Vector3<Dd>| scale_add(&n, -dot(&n, v), v);
    let e1 = unit(&in_plane(&to_pin)).ok_or("pin lies on the rocker's axis")?;
    let e2 = cross(&n, &e1);
    let plane = |v: &Vector3<Dd>| [dot(&e1, v), dot(&e2, v)];
    let (d3, d1) = (plane(&to_pin), plane(&to_stator));
    let slider = axis(&zero[j3 + 1]);
    let t = in_plane(&slider);
    let t0 = plane(&unit(&t).ok_or("slider is perpendicular to the plane")?);
    let d = [d3[0] - d1[0], d3[1] - d1[1]];
    let length0 = d[0] * t0[0] + d[1] * t0[1];
    let eccentricity = t0[0] * d[1] - t0[1] * d[0];
    let square0 = d[0] * d[0] + d[1] * d[1];
    let stator = axis(&zero[j2 + 1]);
    let sense = dot(&stator, &n);
    let size = cluster.length;
    if length0.abs().to_f64() < 1e-6 * size {
        return Err("slider has no length at zero".into());
    }

    let mut deviations = vec![
        ("stator axis not parallel to the rocker's, axis".into(), Subject::Joint(j2), norm(&cross(&stator, &n)).to_f64()),
        ("slider not in the plane, axis".into(), Subject::Joint(j3), dot(&slider, &n).abs().to_f64()),
    ];
    for row in &cut.rows {
        let linear = direction(&zero[cut.predecessor], &direction(&cut.x_p_cut, &row.linear));
        deviations.push((
            "a constraint axis of the loop not in the plane".into(),
            Subject::Loop,
            (dot(&linear, &n).abs() / norm(&linear)).to_f64(),
        ));
    }
    let sign = |x: Dd| if x < Dd::ZERO { -Dd::ONE } else { Dd::ONE };
    let form =
        Rrpr { joints: [j1, j2, j3], d3, d1, t0, square0, length0, eccentricity, sense: sign(sense), side: sign(length0), polish: None };
    Ok(Form { closure: Closure::Rrpr(form), deviations })
}

/// A platform on a chain of independent joints with UPS legs: the chain's joints first, then three joints a leg.
fn legs(cluster: &Cluster<Dd>, bodies: &[Body<Dd>], order: &[usize], zero: &[Pose<Dd>]) -> Result<Form, String> {
    let legs = 3 * cluster.cuts.len();
    if order.len() <= legs || order.len() != cluster.n {
        return Err("joints are not those of the platform and three a leg".into());
    }
    // the chain: each independent joint on the one before
    let n_chain = order.len() - legs;
    let mut chain = order[..n_chain].to_vec();
    chain.sort_by_key(|j| depth(cluster, *j));
    let mut below = 0;
    for &j in &chain {
        if cluster.local_parent[j] != below || !cluster.independent.contains(&(bodies[j].v - cluster.v)) {
            return Err("independent joints do not carry the platform one on the other".into());
        }
        below = j + 1;
    }
    let platform = below;
    let mut freedoms: Vec<_> = cluster.independent.iter().enumerate().map(|(k, v)| (cluster.freedoms[*v], k)).collect();
    freedoms.sort_by_key(|(at, _)| (depth(cluster, at.body), at.k));
    let (mut built, mut deviations) = (Vec::new(), Vec::new());
    for joints in order[n_chain..].chunks_exact(3) {
        let cut = cluster.cuts.iter().find(|cut| ties(cut, joints[2] + 1, platform));
        let cut = cut.ok_or("slider is tied to something else than the platform")?;
        built.push(leg(cluster, bodies, [joints[0], joints[1], joints[2]], cut, platform, zero, &mut deviations)?);
    }
    Ok(Form { closure: Closure::Legs(Legs { chain: freedoms, legs: built, polish: None }), deviations })
}

/// One leg: turn, turn, slide, and a ball joint on the platform.
fn leg(
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    joints: [usize; 3],
    cut: &Cut<Dd>,
    platform: usize,
    zero: &[Pose<Dd>],
    deviations: &mut Vec<(String, Subject, f64)>,
) -> Result<Leg<Dd>, String> {
    let [j1, j2, j3] = joints;
    if joints.map(|j| bodies[j].motion) != [Motion::Revolute, Motion::Revolute, Motion::Prismatic] {
        return Err("leg is not universal joint and slider".into());
    }
    if cluster.local_parent[j1] != 0 || cluster.local_parent[j2] != j1 + 1 || cluster.local_parent[j3] != j2 + 1 {
        return Err("leg does not stand on the base".into());
    }
    if cut.angular || cut.rows.len() != 3 || !spans_space(cut) {
        return Err("loop does not tie all three directions of the pin".into());
    }
    let (a1, a2, a3) = (axis(&zero[j1 + 1]), axis(&zero[j2 + 1]), axis(&zero[j3 + 1]));
    let Y = unit(&scale_add(&a1, -dot(&a1, &a2), &a2)).ok_or("universal joint has parallel axes")?;
    let axes = Matrix3::from_columns(&[a1, Y, cross(&a1, &Y)]);

    // where the axes cross: the point of the second axis that is nearest to the first, and the gap between them
    let (p1, p2) = (zero[j1 + 1].p, zero[j2 + 1].p);
    let b = dot(&a1, &a2);
    let along = p1 - p2;
    let s = (dot(&a2, &along) - b * dot(&a1, &along)) / (Dd::ONE - b * b);
    let center = scale_add(&a2, s, &p2);
    let from_first = center - p1;
    let gap = norm(&scale_add(&a1, -dot(&a1, &from_first), &from_first)).to_f64() / cluster.length;
    deviations.push(("axis that does not cross the one before it, axis".into(), Subject::Joint(j2), gap));
    deviations.push(("axis not perpendicular to the one before it, axis".into(), Subject::Joint(j2), b.abs().to_f64()));

    let (end, x_cut) = if cut.predecessor == platform { (cut.successor, &cut.x_s_cut) } else { (cut.predecessor, &cut.x_p_cut) };
    let point = zero[end].point(&x_cut.p);
    let v = t_mul(&axes, &(point - center));
    let a = t_mul(&axes, &a3);
    let length0 = dot(&a, &v);
    let e = scale_add(&a, -length0, &v);
    if length0.abs().to_f64() < 1e-6 * cluster.length || (v[2].abs().to_f64()) < 1e-6 * cluster.length {
        return Err("leg is stretched along its first axis or has no length at zero".into());
    }
    let pin = zero[platform].inverse().point(&point);
    let sign = |x: Dd| if x < Dd::ZERO { -Dd::ONE } else { Dd::ONE };
    let joints = joints.map(|j| cluster.freedoms[bodies[j].v - cluster.v]);
    Ok(Leg { joints, axes, center, pin, e_square: dot(&e, &e), square0: dot(&v, &v), length0, side: sign(length0), root: sign(v[2]), a, e })
}

/// True when the cut is between these two local bodies, either way round.
fn ties(cut: &Cut<Dd>, a: usize, b: usize) -> bool {
    (cut.predecessor, cut.successor) == (a, b) || (cut.predecessor, cut.successor) == (b, a)
}

/// True when the three rows of a cut are independent directions.
fn spans_space(cut: &Cut<Dd>) -> bool {
    let [x, y, z] = [0, 1, 2].map(|r| cut.rows[r].linear);
    let volume = dot(&x, &cross(&y, &z)).abs();
    volume.to_f64() > 1e-3 * (norm(&x) * norm(&y) * norm(&z)).to_f64()
}

fn depth(cluster: &Cluster<Dd>, j: usize) -> usize {
    match cluster.local_parent[j] {
        0 => 0,
        parent => 1 + depth(cluster, parent - 1),
    }
}
