//! 2SPU+1U, 6UPS, 2SPRR+1U: a platform on a chain of independent joints, and legs of two turns and
//! a slider; the legs of 2SPRR+1U have an offset at the base or an arm at the platform.

use nalgebra::{Matrix3, Vector3};

use crate::closure::{Arm, Closure, Leg, Platform, Strut};
use crate::compile::closed_forms::{Deviation, Form, Reading, is_ball, sign, ties};
use crate::compile::geometry::{axis, direction, unit};
use crate::mechanism::{Cut, Motion};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// Shortest lengths at zero, relative to the mechanism's size.
const DEGENERATE: f64 = 1e-6;

/// The legs, three joints each, four where the platform has arms; without `offsets` the axes of
/// each leg cross and the leg ends on the platform.
pub(super) fn read(of: &Reading<'_>, offsets: bool) -> Result<Form, String> {
    let cluster = of.cluster;
    let (chain, platform) = of.chain()?;
    let triples = of.triples()?;
    let is_arm = |j: &usize| !of.is_independent(*j) && !triples.iter().flatten().any(|i| i == j);
    let arms: Vec<usize> = of.order.iter().copied().filter(is_arm).collect();
    if !arms.is_empty() && !offsets {
        return Err("joints are not those of the platform and three a leg".into());
    }
    if arms
        .iter()
        .any(|j| cluster.local_parent[*j] != platform || of.bodies[*j].motion != Motion::Revolute)
    {
        return Err("arm does not turn on the platform".into());
    }
    if !arms.is_empty() && arms.len() != triples.len()
        || cluster.cuts.len() != triples.len() + arms.len()
    {
        return Err(
            "joints are not those of the platform, three a leg, and one a leg for arms".into()
        );
    }
    let mut legs = Vec::new();
    let mut deviations = Vec::new();
    for joints in triples {
        let body = joints[2] + 1;
        let on = |end: usize| cluster.cuts.iter().find(|cut| ties(cut, body, end));
        let arm = arms.iter().copied().find(|j| on(j + 1).is_some());
        let end = arm.map_or(platform, |j| j + 1);
        let cut = on(end)
            .filter(|cut| is_ball(cut))
            .ok_or("slider is not held in all directions by the platform or an arm")?;
        let (x_cut, x_slider) = match cut.successor == end {
            true => (&cut.x_s_cut, &cut.x_p_cut),
            false => (&cut.x_p_cut, &cut.x_s_cut),
        };
        let point = of.zero[end].point(&x_cut.p);
        // the leg's own end, where it is not on the platform while all coordinates are zero
        let tip = if of.is_closed { point } else { of.zero[body].point(&x_slider.p) };
        let strut = strut(of, joints, &tip, offsets, &mut deviations)?;
        legs.push(match arm {
            None => Leg { strut, pin: of.zero[platform].inverse().point(&point), arm: None },
            Some(_) if !of.is_closed => return Err("arms are not at rest at the zero pose".into()),
            Some(j) => {
                let plane =
                    cluster.cuts.iter().find(|cut| cut.predecessor == j + 1 && cut.successor == 0);
                let plane = plane.ok_or("arm is not held in a plane with a point of the base")?;
                let (arm, pin) = self::arm(of, j, platform, plane, &point, &mut deviations)?;
                Leg { strut, pin, arm: Some(arm) }
            }
        });
    }
    let form = Platform::new(chain, legs, Vec::new(), Vec::new());
    Ok(Form { closure: Closure::Platform(form), deviations })
}

/// Two turns in series whose axes are perpendicular.
pub(super) struct Universal {
    /// X, Y along the axes at zero, origin on the first where the second is nearest {cluster's
    /// parent body}, and how far away that is along Z.
    pub(super) axes: Matrix3<Dd>,
    pub(super) center: Vector3<Dd>,
    pub(super) distance: Dd,
}

pub(super) fn universal(
    of: &Reading<'_>,
    [j1, j2]: [usize; 2],
    deviations: &mut Vec<Deviation>,
) -> Result<Universal, String> {
    let a1 = axis(&of.zero[j1 + 1]);
    let a2 = axis(&of.zero[j2 + 1]);
    let Y = unit(&a2.add_scaled(a1, -a1.dot(a2))).ok_or("universal joint has parallel axes")?;
    let axes = Matrix3::from_columns(&[a1, Y, a1.cross(Y)]);
    let skew = a1.dot(a2);
    let off = skew.abs().to_f64();
    deviations.push(("axis not perpendicular to the one before it, axis", Some(j2), off));

    // where the axes are nearest to each other, and how far apart
    let p1 = of.zero[j1 + 1].p;
    let p2 = of.zero[j2 + 1].p;
    let along = p2 - p1;
    let s = (a1.dot(along) - skew * a2.dot(along)) / (Dd::ONE - skew * skew);
    let center = p1.add_scaled(a1, s);
    let distance = axes.apply_transposed(p2 - center)[2];
    Ok(Universal { axes, center, distance })
}

/// Turn, turn, slide towards a point.
fn strut(
    of: &Reading<'_>,
    joints: [usize; 3],
    point: &Vector3<Dd>,
    offsets: bool,
    deviations: &mut Vec<Deviation>,
) -> Result<Strut<Dd>, String> {
    let [j1, j2, j3] = joints;
    let Universal { axes, center, distance } = universal(of, [j1, j2], deviations)?;
    let a = axes.apply_transposed(axis(&of.zero[j3 + 1]));

    // axes that cross, or a slider perpendicular to the second: the better fit
    let size = of.cluster.length;
    let gap = distance.abs().to_f64() / size;
    let tilt = a[1].abs().to_f64();
    let apart = offsets && tilt < gap;
    if apart {
        deviations.push((
            "slider not perpendicular to the axis before it, which does not cross the first, axis",
            Some(j3),
            tilt,
        ));
    } else {
        deviations.push(("axis that does not cross the one before it, axis", Some(j2), gap));
    }
    let distance = if apart { distance } else { Dd::ZERO };
    let v = axes.apply_transposed(point - center);
    let w = Vector3::new(v[0], v[1], v[2] - distance);
    let length0 = a.dot(w);
    let e = w.add_scaled(a, -length0);
    if length0.abs().to_f64() < DEGENERATE * size || v[2].abs().to_f64() < DEGENERATE * size {
        return Err("leg is stretched along its first axis or has no length at zero".into());
    }
    let square0 = if apart { w[0] * w[0] + w[2] * w[2] } else { v.dot(v) };
    let joints = joints.map(|j| of.dof(j));
    let e_square = e.dot(e);
    Ok(Strut {
        joints,
        axes,
        center,
        apart,
        distance,
        a,
        e,
        e_square,
        square0,
        length0,
        side: sign(length0),
        root: sign(v[2]),
    })
}

/// An arm on the platform in a plane with a point of the base; and its tip on the arm's axes k, m,
/// n.
fn arm(
    of: &Reading<'_>,
    j: usize,
    platform: usize,
    plane: &Cut<Dd>,
    point: &Vector3<Dd>,
    deviations: &mut Vec<Deviation>,
) -> Result<(Arm<Dd>, Vector3<Dd>), String> {
    let x_arm = &of.zero[j + 1];
    let n = axis(x_arm);
    let ([row], false) = (&plane.rows[..], plane.angular) else {
        return Err("arm is not held by one direction".into());
    };
    let normal = unit(&direction(x_arm, &direction(&plane.x_p_cut, &row.linear)))
        .ok_or("constraint axis has no direction")?;
    let off = normal.dot(n);
    let what = "constraint axis not perpendicular to axis";
    deviations.push((what, Some(j), off.abs().to_f64()));
    let m = unit(&normal.add_scaled(n, -off)).ok_or("constraint axis lies along the arm's axis")?;
    let axes = Matrix3::from_columns(&[m.cross(n), m, n]);
    let center = of.zero[0].point(&plane.x_s_cut.p);
    let D = axes.apply_transposed(center - x_arm.p);
    if D[0].abs().to_f64() < DEGENERATE * of.cluster.length {
        return Err("arm's axis passes through the point that the arm turns to".into());
    }
    let arm = Arm {
        joint: of.dof(j),
        axes: of.zero[platform].R.transpose().times(axes),
        pivot: of.zero[platform].inverse().point(&x_arm.p),
        center,
        offset: D[1],
        side: sign(D[0]),
    };
    Ok((arm, axes.apply_transposed(point - x_arm.p)))
}
