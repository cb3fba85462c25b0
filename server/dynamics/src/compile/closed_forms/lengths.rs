//! Reads mechanisms whose loops are rods that only hold a distance, wherever they hang: links with
//! a ball, and links on a hinge in a plane or about a point.

use nalgebra::{Matrix3, Vector3};

use crate::closure::{FEW_STEPS, Mover, Rod, Rods, Universal, screw};
use crate::compile::closed_forms::{Deviation, Reading, is_ball, platform, sign};
use crate::compile::geometry::{axis, norm, unit};
use crate::mechanism::{Cut, Motion};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// Least part of a rod across the first axis of its universal joint at zero, and size of a
/// mechanism against the radius of its sphere from which on it counts as a spherical one.
const DEGENERATE: f64 = 1e-3;

/// The rods, one in each loop, and the unknowns that they determine.
pub(super) fn read(of: &Reading<'_>) -> Result<(Rods<Dd>, Vec<Deviation>), String> {
    let cluster = of.cluster;
    let is_whole = cluster.used.len() == cluster.rows.len();
    if !of.is_simple() || !of.is_closed || !is_whole {
        return Err("joints are not single ones at rest at the zero pose".into());
    }
    let mut deviations = Vec::new();
    let mut rods = Vec::new();
    let mut spins = 0;
    for cut in &cluster.cuts {
        let ends = [(cut.predecessor, true), (cut.successor, false)];
        let mut found = ends.into_iter().filter_map(|(body, first)| joints(of, cut, body, first));
        let end = found.next().ok_or("loop is not closed by the ball or the pin of a rod")?;
        spins += usize::from(end.spin.is_some());
        rods.push(rod(of, cut, end, &mut deviations)?);
    }
    let of_rods = |j: &usize| rods.iter().any(|rod: &Rod<Dd>| rod.turns.contains(j));
    let unknowns: Vec<usize> = cluster.dependent.iter().copied().filter(|j| !of_rods(j)).collect();
    if unknowns.len() != rods.len() || spins != cluster.locked.len() {
        return Err("rods are not as many as other dependents".into());
    }
    let mut between = vec![false; cluster.n + 1];
    let mut moves = vec![false; cluster.n + 1];
    for mut body in rods.iter().flat_map(|rod| rod.bodies) {
        while body > 0 {
            between[body] = true;
            body = cluster.local_parent[body - 1];
        }
    }
    for (j, parent) in cluster.local_parent.iter().enumerate() {
        moves[j + 1] = moves[*parent] || unknowns.contains(&j);
    }
    for mover in rods.iter_mut().flat_map(|rod| &mut rod.path) {
        let j = mover.joint;
        let unknown = unknowns.iter().position(|x| *x == j);
        let place = cluster.independent.iter().position(|x| *x == j);
        mover.column = match (unknown, place) {
            (Some(column), _) => Ok(column),
            (_, Some(k)) => Err(k),
            _ => return Err("a rod moves another".into()),
        };
    }
    let on_way = |moving: bool| {
        (0..cluster.n).filter(|j| between[j + 1] && moves[j + 1] == moving).collect()
    };
    let turning = |j: &usize| of.bodies[*j].motion == Motion::Revolute;
    let places =
        |joints: &[usize]| joints.iter().filter(|j| turning(j)).map(|j| (*j, *j)).collect();
    let mut found: Vec<usize> = rods.iter().flat_map(|rod| rod.turns).collect();
    found.dedup();
    let mut form = Rods {
        unknowns: unknowns.iter().map(|j| of.dof(*j)).collect(),
        rods,
        before: on_way(false),
        moving: on_way(true),
        given: places(&cluster.independent),
        turned: places(&unknowns),
        found: places(&found),
        sign: 1.0,
        steps: FEW_STEPS,
        sizes: Vec::new(),
    };
    form.order(of)?;
    Ok((form, deviations))
}

/// The turns of a rod, twice the same of a hinge, and the end of a cut at its ball or pin.
struct End {
    joints: [usize; 2],
    /// An idle turn about the rod itself.
    spin: Option<usize>,
    is_predecessor: bool,
}

/// The joints of a link between a universal joint and the ball of a cut, or between a hinge and the
/// pin of one, which no other loop moves.
fn joints(of: &Reading<'_>, cut: &Cut<Dd>, body: usize, is_predecessor: bool) -> Option<End> {
    let cluster = of.cluster;
    let above = |j: usize| cluster.local_parent[j].checked_sub(1);
    let spin = body.checked_sub(1).filter(|j| is_ball(cut) && cluster.locked.contains(j));
    let second = spin.map_or(body.checked_sub(1), above)?;
    let first = if is_ball(cut) { above(second)? } else { second };
    let joints = [first, second];
    let moves = |cut: &&Cut<Dd>, j: usize| cut.path.iter().any(|(of_path, _)| *of_path == j);
    let is_turn = |j: &usize| {
        of.bodies[*j].motion == Motion::Revolute
            && cluster.cuts.iter().filter(|cut| moves(cut, *j)).count() == 1
    };
    let carries = |j: usize| cluster.local_parent.iter().filter(|parent| **parent == j + 1).count();
    let is_end = |j: &usize| carries(*j) == usize::from(*j + 1 != body);
    let is_rod = is_ball(cut) || cut.rows.len() == 2 && !cut.angular && !cut.is_coupling();
    let all = joints.iter().chain(&spin).all(|j| is_turn(j) && is_end(j));
    let depend = joints.iter().all(|j| cluster.dependent.contains(j));
    (is_rod && all && depend).then_some(End { joints, spin, is_predecessor })
}

/// A hinge as a universal joint whose second turn stays at zero, across from its axis to the pin,
/// and how far the joints of the loop are from those of a plane or of a point.
fn hinge(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    joint: usize,
    [pin, gap]: [&Vector3<Dd>; 2],
) -> Result<(platform::Universal, f64), String> {
    let pose = &of.zero[joint + 1];
    let n = axis(pose);
    let foot = pose.p.add_scaled(n, n.dot(*pin - pose.p));
    let Z = unit(&(*pin - foot)).ok_or("a pin is on the axis of its hinge")?;
    let axes = Matrix3::from_columns(&[n, Z.cross(n), Z]);
    // its axis and each other one meet at p + (c/s) n, in a plane where s is zero; the most
    // inclined one decides where
    let others = || cut.path.iter().map(|(j, _)| *j).filter(|j| *j != joint);
    let slides = |j: &usize| of.bodies[*j].motion == Motion::Prismatic;
    let moment = |j: usize| {
        let other = &of.zero[j + 1];
        let arm: Vector3<Dd> = pose.p - other.p;
        [arm.cross(axis(other)) * (Dd::ONE / Dd::from(of.cluster.length)), n.cross(axis(other))]
    };
    let turns = others().filter(|j| !slides(j)).map(moment);
    let size = |x: &Vector3<Dd>| norm(x).to_f64();
    let most = turns.max_by(|a, b| size(&a[1]).total_cmp(&size(&b[1])));
    let (s, c) = most.map_or((Dd::ZERO, Dd::ONE), |[A, B]| (B.dot(B), -A.dot(B)));
    let [s, c] = unit(&Vector3::new(s, c, Dd::ZERO)).map_or([Dd::ZERO, Dd::ONE], |x| [x[0], x[1]]);
    let apart = others().map(|j| match slides(&j) {
        true => s.abs().to_f64() + n.dot(axis(&of.zero[j + 1])).abs().to_f64(),
        false => size(&(moment(j)[0] * s).add_scaled(moment(j)[1], c)),
    });
    // from the point of a spherical linkage every pin has the same distance: as far away as the
    // pin; the other end of the cut may be elsewhere on the line to it, or across the plane
    let (center, way) = if s.abs().to_f64() > DEGENERATE {
        let point = pose.p.add_scaled(n, c / s * Dd::from(of.cluster.length));
        let r: Vector3<Dd> = *pin - point;
        (point.add_scaled(n, norm(&r)), r * (Dd::ONE / norm(&r)))
    } else {
        (foot, n)
    };
    let apart = apart.fold(size(&(*gap).cross(way)) / of.cluster.length, f64::max);
    Ok((platform::Universal { axes, center, distance: Dd::ZERO }, apart))
}

/// A rod; the columns of its path are those of all joints.
fn rod(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    End { joints, spin, is_predecessor }: End,
    deviations: &mut Vec<Deviation>,
) -> Result<Rod<Dd>, String> {
    let cluster = of.cluster;
    // the rod from center to ball, as its own end of the cut has it
    let (own, other, x_own, x_other) = match is_predecessor {
        true => (cut.predecessor, cut.successor, &cut.x_p_cut, &cut.x_s_cut),
        false => (cut.successor, cut.predecessor, &cut.x_s_cut, &cut.x_p_cut),
    };
    let pin = of.zero[own].point(&x_own.p);
    let [first, second] = joints;
    let (at, what, apart) = if first == second {
        let gap = of.zero[other].point(&x_other.p) - pin;
        let (at, apart) = hinge(of, cut, first, [&pin, &gap])?;
        (at, "loop is neither in a plane nor about a point, hinge", apart)
    } else {
        let at = platform::universal(of, joints, deviations)?;
        let apart = at.distance.abs().to_f64() / cluster.length;
        (at, "axis that does not cross the one before it, axis", apart)
    };
    deviations.push((what, Some(second), apart));
    if let Some(spin) = spin {
        let on = &of.zero[spin + 1];
        let apart = norm(&(pin - on.p).cross(axis(on))).to_f64() / cluster.length;
        deviations.push(("ball beside the axis of", Some(spin), apart));
    }
    let r: Vector3<Dd> = pin - at.center;
    let rod: Vector3<Dd> = at.axes.apply_transposed(r);
    let length_square = r.dot(r);
    let length = length_square.sqrt();
    if rod[2].abs().to_f64() <= DEGENERATE * length.to_f64() {
        return Err("a rod lies along the first axis of its universal joint at zero".into());
    }
    let carrier = cluster.local_parent[joints[0]];
    let universal = Universal {
        joints,
        axes: of.zero[carrier].R.transpose().times(at.axes),
        rod,
        length_square,
        swing_square: rod[0] * rod[0] + rod[2] * rod[2],
        root: sign(rod[2]),
    };
    let path = cut.path.iter().filter(|(j, _)| !joints.contains(j) && Some(*j) != spin);
    let mover = |(j, on_successor): &(usize, bool)| Mover {
        joint: *j,
        of_ball: *on_successor == is_predecessor,
        column: Err(*j),
    };
    Ok(Rod {
        universal,
        turns: joints,
        bodies: [carrier, other],
        center: of.zero[carrier].inverse().point(&at.center),
        ball: if first == second { of.zero[other].inverse().point(&pin) } else { x_other.p },
        inverse_length: Dd::ONE / length,
        path: path.map(mover).collect(),
    })
}

impl Rods<Dd> {
    /// Brings the rows into the order of the largest pivots at zero.
    fn order(&mut self, of: &Reading<'_>) -> Result<(), String> {
        let m = self.unknowns.len();
        let mut A = vec![Dd::ZERO; m * m];
        let pose = of.bodies.iter().zip(&of.zero[1..]);
        let screws: Vec<_> = pose.map(|(body, pose)| screw(body.motion, pose)).collect();
        self.sizes = vec![0.0; m];
        for rod in &self.rods {
            let ball = of.zero[rod.bodies[1]].point(&rod.ball);
            for mover in &rod.path {
                let [turn, velocity] = screws[mover.joint];
                let v: Vector3<Dd> = velocity + turn.cross(ball);
                if let Ok(column) = mover.column {
                    self.sizes[column] += v.dot(v).to_f64();
                }
            }
        }
        self.matrix::<0>(&of.zero, &screws, &mut A, |_, _, _| ());
        let mut det = Dd::ONE;
        for k in 0..m {
            let size = |i: &usize| A[i * m + k].abs().to_f64();
            let p = (k..m).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(k);
            if size(&p) < DEGENERATE * of.cluster.length.min(1.0) {
                return Err("rods do not determine the other joints at zero".into());
            }
            (0..m).for_each(|j| A.swap(k * m + j, p * m + j));
            self.rods.swap(k, p);
            det *= A[k * m + k];
            for i in k + 1..m {
                let l = A[i * m + k] / A[k * m + k];
                (k..m).for_each(|j| A[i * m + j] = A[i * m + j] - l * A[k * m + j]);
            }
        }
        self.sign = sign(det).to_f64();
        Ok(())
    }
}
