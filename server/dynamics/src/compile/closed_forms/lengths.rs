//! Rods whose two turns enter the loops only through the rod's length, wherever they hang.

use nalgebra::Vector3;

use crate::closure::{Reduced, Rod, Universal};
use crate::compile::closed_forms::{Reading, is_ball, platform, sign, size};
use crate::mechanism::{Cut, CutRow, Motion};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::{Matrix, Pose, zero};

/// Least part of a rod across the first axis of its universal joint at zero.
const DEGENERATE: f64 = 1e-3;

/// The cluster without the turns of its rods; `None` where it has none.
pub(super) fn reduced(of: &Reading<'_>, rounding: f64) -> Option<Reduced<Dd>> {
    let cluster = of.cluster;
    if cluster.used.len() != cluster.rows.len() || !cluster.locked.is_empty() {
        return None;
    }
    let mut reduced = cluster.clone();
    let mut rods: Vec<Rod<Dd>> = Vec::new();
    for (c, cut) in cluster.cuts.iter().enumerate() {
        let ends = [(cut.predecessor, true), (cut.successor, false)];
        let rod =
            ends.into_iter().find_map(|(body, is_first)| rod(of, cut, body, is_first, rounding));
        if let Some((universal, distance)) = rod {
            reduced.cuts[c] = distance;
            let turns = universal.joints.map(|j| of.dof(j).v);
            rods.push(Rod { universal, turns, cut: c });
        }
    }
    if rods.is_empty() {
        return None;
    }
    let of_rods = || rods.iter().flat_map(|rod| rod.turns);
    reduced.dependent.retain(|v| !of_rods().any(|turn| turn == *v));
    reduced.dependent_q.retain(|q| !of_rods().any(|turn| cluster.dofs[turn].q == *q));
    reduced.rows = (0..reduced.cuts.iter().map(|cut| cut.rows.len()).sum()).collect();
    reduced.used.clone_from(&reduced.rows);
    let place = |j: usize| (j, of.bodies[j].q - cluster.q);
    let is_first = |j: &usize| rods.iter().any(|rod| rod.universal.joints[0] == *j);
    let turning = |j: &usize| of.bodies[*j].motion == Motion::Revolute;
    let turned = (0..cluster.n).filter(|j| turning(j) && !is_first(j)).map(place).collect();
    let found = rods.iter().flat_map(|rod| rod.universal.joints).map(place).collect();
    Some(Reduced { cluster: reduced, rods, turned, found })
}

/// A link between a universal joint and the ball of a cut, which no other loop moves, with the cut
/// of its distance.
fn rod(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    body: usize,
    is_predecessor: bool,
    rounding: f64,
) -> Option<(Universal<Dd>, Cut<Dd>)> {
    let cluster = of.cluster;
    let second = body.checked_sub(1)?;
    let first = cluster.local_parent[second].checked_sub(1)?;
    let joints = [first, second];
    let own = |j: usize| of.dof(j);
    let moves = |cut: &Cut<Dd>, v: usize| cut.path.iter().any(|(of_path, _)| *of_path == v);
    let is_turn = |j: &usize| {
        of.bodies[*j].motion == Motion::Revolute
            && cluster.dependent.contains(&own(*j).v)
            && cluster.cuts.iter().filter(|cut| moves(cut, own(*j).v)).count() == 1
    };
    let carries = |j: usize| cluster.local_parent.iter().filter(|parent| **parent == j + 1).count();
    if !is_ball(cut) || !joints.iter().all(is_turn) || carries(first) != 1 || carries(second) != 0 {
        return None;
    }
    let mut deviations = Vec::new();
    let at = platform::universal(of, joints, &mut deviations).ok()?;
    if size(&deviations).max(at.distance.abs().to_f64() / cluster.length) > rounding {
        return None;
    }

    // the rod from center to ball, as its own end of the cut has it
    let (own, other, x_own, x_other) = match is_predecessor {
        true => (cut.predecessor, cut.successor, &cut.x_p_cut, &cut.x_s_cut),
        false => (cut.successor, cut.predecessor, &cut.x_s_cut, &cut.x_p_cut),
    };
    let r = of.zero[own].point(&x_own.p) - at.center;
    let rod = at.axes.apply_transposed(r);
    let length_square = r.dot(r);
    if rod[2].abs().to_f64() <= DEGENERATE * length_square.to_f64().sqrt() {
        return None;
    }
    let carrier = cluster.local_parent[first];
    let universal = Universal {
        joints,
        axes: of.zero[carrier].R.transpose().times(at.axes),
        rod,
        length_square,
        swing_square: rod[0] * rod[0] + rod[2] * rod[2],
        root: sign(rod[2]),
    };
    let is_rod = |v: &usize| joints.contains(&cluster.dofs[*v].body);
    let path = cut.path.iter().filter(|(v, _)| !is_rod(v));
    let distance = Cut {
        predecessor: carrier,
        successor: other,
        x_p_cut: Pose { p: of.zero[carrier].inverse().point(&at.center), ..Pose::identity() },
        x_s_cut: *x_other,
        rows: vec![length()],
        path: path.map(|(v, on_successor)| (*v, *on_successor == is_predecessor)).collect(),
        angular: false,
        on_line: false,
        distance: Some(length_square.sqrt()),
    };
    Some((universal, distance))
}

/// The row of a distance, of which only the kind of its unit is read.
fn length() -> CutRow<Dd> {
    let along = Vector3::new(Dd::ONE, Dd::ZERO, Dd::ZERO);
    CutRow {
        angular: zero(),
        linear: along,
        linear_p: along,
        against: None,
        screw: None,
        terms: Vec::new(),
        offset: Dd::ZERO,
        size: Dd::ONE,
    }
}
