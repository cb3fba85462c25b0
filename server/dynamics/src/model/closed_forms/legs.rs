//! 2SPU+1U, 6UPS: a platform on a chain of independent joints, and legs of two crossing axes and a slider.

use nalgebra::Matrix3;

use super::super::geometry::{axis, norm, unit};
use super::{Deviation, Form, Reading, Subject, is_ball, sign, ties};
use crate::closure::{Closure, Cut, Leg, Legs};
use crate::scalar::{Dd, Real, Scalar};
use crate::spatial::{cross, dot, scale_add, t_mul};

/// The legs of a platform, three joints each, beside the joints that carry it.
pub(super) fn read(of: &Reading<'_>) -> Result<Form, String> {
    let cluster = of.cluster;
    let (chain, platform) = of.chain()?;
    let triples = of.triples()?;
    let carriers = chain.iter().filter(|(at, _)| at.k == 0).count();
    if cluster.n != carriers + 3 * triples.len() || triples.len() != cluster.cuts.len() {
        return Err("joints are not those of the platform and three a leg".into());
    }
    let (mut legs, mut deviations) = (Vec::new(), Vec::new());
    for joints in triples {
        let cut = cluster.cuts.iter().find(|cut| ties(cut, joints[2] + 1, platform));
        let cut = cut.ok_or("slider is tied to something else than the platform")?;
        legs.push(leg(of, joints, cut, platform, &mut deviations)?);
    }
    Ok(Form { closure: Closure::Legs(Legs { chain, legs, polish: None }), deviations })
}

/// One leg: turn, turn, slide, and a ball joint on the platform.
fn leg(of: &Reading<'_>, joints: [usize; 3], cut: &Cut<Dd>, platform: usize, deviations: &mut Vec<Deviation>) -> Result<Leg<Dd>, String> {
    let (cluster, zero) = (of.cluster, &of.zero);
    let [j1, j2, j3] = joints;
    if !is_ball(cut) {
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
    let joints = joints.map(|j| cluster.freedoms[of.bodies[j].v - cluster.v]);
    Ok(Leg { joints, axes, center, pin, e_square: dot(&e, &e), square0: dot(&v, &v), length0, side: sign(length0), root: sign(v[2]), a, e })
}
