//! 2SURRPR+1U: a platform on a chain of independent joints, and legs of a crank and a rod, the
//! crank of each driven by a lambda or by itself.

use nalgebra::Matrix3;

use crate::closure::{Closure, Platform, RodLeg, Rrpr, Universal};
use crate::compile::closed_forms::{Deviation, Form, Reading, is_ball, planar, platform, sign};
use crate::compile::geometry::{axis, norm, unit};
use crate::mechanism::{Cut, Motion};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// Shortest lengths at zero, relative to the mechanism's size.
const DEGENERATE: f64 = 1e-6;

/// A crank and its rod as joints.
struct Joints {
    crank: usize,
    universal: [usize; 2],
    /// The universal joint is on the crank.
    on_crank: bool,
    /// The body that the leg holds, and the number of chain joints that carry it.
    platform: usize,
    depth: usize,
}

/// The legs: each a ball between two paths of one and two, or of none and three turns; then a plane
/// loop for each crank that has one.
pub(super) fn read(of: &Reading<'_>) -> Result<Form, String> {
    let cluster = of.cluster;
    if !of.is_simple() || !of.is_closed {
        return Err("joints are not single ones at rest at the zero pose".into());
    }
    let (chain, _) = of.chain()?;
    let depth = |body: usize| match body {
        0 => Some(0),
        _ => chain.iter().position(|(at, _)| at.body + 1 == body).map(|k| k + 1),
    };
    let mut deviations = Vec::new();
    let mut taken: Vec<usize> = chain.iter().map(|(at, _)| at.body).collect();
    taken.extend(&cluster.locked);
    let mut take = |joints: &[usize]| match joints.iter().any(|j| taken.contains(j)) {
        true => Err("legs share joints".to_owned()),
        false => {
            taken.extend(joints);
            Ok(())
        }
    };
    let mut rods: Vec<RodLeg<Dd>> = Vec::new();
    let mut others: Vec<&Cut<Dd>> = Vec::new();
    for cut in &cluster.cuts {
        let Some(joints) = leg(of, cut, depth) else {
            others.push(cut);
            continue;
        };
        take(&[joints.crank, joints.universal[0], joints.universal[1]])?;
        rods.push(rod(of, cut, &joints, &mut deviations)?);
    }
    for cut in others {
        let turns = |rod: &&mut RodLeg<Dd>| planar::has(of, cut, rod.crank);
        let rod = rods
            .iter_mut()
            .find(turns)
            .ok_or("loop is neither a crank with a rod nor one that drives a crank")?;
        if rod.drive.is_some() {
            return Err("crank is driven twice".into());
        }
        let lambda: Rrpr<Dd> = planar::driving(of, cut, rod.crank, &mut deviations)?;
        take(&lambda.joints[1..])?;
        rod.drive = Some(lambda);
    }
    if rods.is_empty() || taken.len() != cluster.n {
        return Err("joints are not those of the platform, cranks, rods and their drives".into());
    }
    let idle = cluster.locked.iter().map(|v| cluster.dofs[*v]).collect();
    let platform = Platform::new(chain, Vec::new(), rods, idle);
    Ok(Form { closure: Closure::Platform(platform), deviations })
}

/// The joints of a crank and its rod, if the cut is the ball of one. Idle joints of the ball do not
/// count; elsewhere they would turn the rod's axes.
fn leg(of: &Reading<'_>, cut: &Cut<Dd>, depth: impl Fn(usize) -> Option<usize>) -> Option<Joints> {
    if !is_ball(cut) {
        return None;
    }
    let is_idle = |j: &usize| of.cluster.locked.contains(j);
    let path = |mut body: usize| {
        let mut joints = Vec::new();
        while depth(body).is_none() {
            joints.push(body - 1);
            body = of.cluster.local_parent[body - 1];
        }
        let of_ball = joints.iter().take_while(|j| is_idle(j)).count();
        joints.drain(..of_ball);
        joints.reverse();
        (joints, body)
    };
    let ends = [path(cut.predecessor), path(cut.successor)];
    let turn = |j: &usize| of.bodies[*j].motion == Motion::Revolute;
    if !ends.iter().flat_map(|(joints, _)| joints).all(|j| turn(j) && !is_idle(j)) {
        return None;
    }
    let [(p, on_p), (s, on_s)] = &ends;
    let (on_crank, crank, first, second, base, platform) = match (p.as_slice(), s.as_slice()) {
        (&[crank, first, second], []) => (true, crank, first, second, on_p, on_s),
        ([], &[crank, first, second]) => (true, crank, first, second, on_s, on_p),
        (&[crank], &[first, second]) => (false, crank, first, second, on_p, on_s),
        (&[first, second], &[crank]) => (false, crank, first, second, on_s, on_p),
        _ => return None,
    };
    let depth = depth(*platform).filter(|depth| *base == 0 && *depth > 0)?;
    Some(Joints { crank, universal: [first, second], on_crank, platform: *platform, depth })
}

/// A crank and its rod.
fn rod(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    joints: &Joints,
    deviations: &mut Vec<Deviation>,
) -> Result<RodLeg<Dd>, String> {
    let size = of.cluster.length;
    let &Joints { crank, universal, on_crank, platform, depth } = joints;
    let universal_joint = platform::universal(of, universal, deviations)?;
    let gap = universal_joint.distance.abs().to_f64() / size;
    deviations.push(("axis that does not cross the one before it, axis", Some(universal[1]), gap));

    // the rod's ends, and the crank's axes with X towards its own
    let ball = of.zero[cut.predecessor].point(&cut.x_p_cut.p);
    let (end, point) = match on_crank {
        true => (universal_joint.center, ball),
        false => (ball, universal_joint.center),
    };
    let Z = axis(&of.zero[crank + 1]);
    let arm = end - of.zero[crank + 1].p;
    let rise = Z.dot(arm);
    let radial = arm.add_scaled(Z, -rise);
    let radius = norm(&radial);
    let X = unit(&radial)
        .filter(|_| radius.to_f64() > DEGENERATE * size)
        .ok_or("rod begins on the crank's axis")?;
    let axes = Matrix3::from_columns(&[X, Z.cross(X), Z]);
    let center = of.zero[crank + 1].p.add_scaled(Z, rise);
    let D = axes.apply_transposed(point - center);
    let along = ball - universal_joint.center;
    let rod = universal_joint.axes.apply_transposed(along);
    let short = |x: Dd| x.abs().to_f64() < DEGENERATE * size;
    if short(D[1]) || short(rod[2]) {
        return Err("crank and rod are at a dead point at zero".into());
    }

    let carried_by = if on_crank { axes } else { of.zero[platform].R };
    // PRECISION: a point of doubles, so that κ there belongs to it
    let near = D.map(|x| Dd::from_f64(x.to_f64()));
    let radius_square = radius * radius;
    let length_square = along.dot(along);
    Ok(RodLeg {
        crank,
        universal: Universal {
            joints: universal,
            axes: carried_by.transpose().times(universal_joint.axes),
            rod,
            length_square,
            swing_square: rod[0] * rod[0] + rod[2] * rod[2],
            root: sign(rod[2]),
        },
        platform,
        depth,
        on_crank,
        axes,
        center,
        pin: of.zero[platform].inverse().point(&point),
        near,
        along: (radius_square - length_square + near.dot(near)) * Dd::from_f64(0.5),
        radius,
        radius_square,
        reach_square: if radius_square < length_square { length_square } else { radius_square },
        side: -sign(D[1]),
        drive: None,
    })
}
