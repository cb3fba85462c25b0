//! Independent joints without a limit on their turns, and the whole turns of their dependents.

use core::f64::consts::TAU;

use sarrus_proto::Status;

use crate::closure::{Closure, Level, Turn};
use crate::mechanism::{Dof, Motion, Winding, Windings};
use crate::model::Model;
use crate::workspace::{Needs, Workspace};

/// Longest and shortest step `[rad]`, and least sine of the distance to a singular pose in steps:
/// no change point lies between two of them.
const LONGEST: f64 = TAU / 512.0;
const SHORTEST: f64 = 1e-4;
const CLEAR: f64 = 4.0;
/// Deviation from a whole turn, in radians or cluster lengths.
const WHOLE: f64 = 1e-6;
/// Most independents of a closed form whose turns are looked for: beyond them, ways along one at a
/// time tell little of the others.
const WIDEST: usize = 3;
/// Longest way of a sliding independent to either side, in cluster lengths.
const SLIDE: f64 = 16.0;
/// Fewest steps of it, and of a whole turn; most steps of either, at which the way ends.
const SWEEP: f64 = 128.0;
const MOST: usize = 1024;
/// Largest turn of a dependent in one step of a closed form, and the shortest step as part of the
/// longest one.
const BEND: f64 = 0.5;
const FINEST: f64 = 1e-6;
/// Coordinate up to which a step ends whose own angle is the coordinate, less than half a turn.
const ANGLE: f64 = 2.8;

/// Turns each independent joint of the numerical closures once from the zero pose, the others at
/// zero; those that return to it can make any number of turns.
pub(super) fn find(model: &Model<f64>) -> Vec<(usize, Vec<Turn>)> {
    let mut ws = Workspace::sized(model, Needs::default());
    let mut found = Vec::new();
    for &c in &model.closed_clusters {
        if !matches!(model.closures[c], Closure::Numerical(_)) {
            continue;
        }
        let cluster = &model.clusters[c];
        let dofs = cluster.independent.iter().map(|v| cluster.dofs[*v]);
        let turns = dofs
            .filter(|dof| dof.single && dof.motion == Motion::Revolute)
            .filter_map(|dof| turn(model, c, dof.q, &mut ws))
            .collect();
        found.push((c, turns));
    }
    found
}

/// One turn of the local coordinate i of a cluster.
fn turn(model: &Model<f64>, c: usize, i: usize, ws: &mut Workspace<f64>) -> Option<Turn> {
    let cluster = &model.clusters[c];
    let at = cluster.coordinates();
    let zero = &model.zero[at.clone()];
    ws.q[at.clone()].copy_from_slice(zero);
    let mut made = 0.0;
    let mut step = LONGEST;
    while made < TAU {
        ws.start[at.clone()].copy_from_slice(&ws.q[at.clone()]);
        let next = f64::min(made + step, TAU);
        ws.q[cluster.q + i] = zero[i] + next;
        let outcome = ws.close(model, c, Level::Position);
        let clear = 1.0 / (CLEAR * outcome.gain.sqrt());
        if outcome.status != Status::Ok || clear < SHORTEST {
            return None;
        }
        if step <= clear {
            made = next;
        } else {
            ws.q[at.clone()].copy_from_slice(&ws.start[at.clone()]);
        }
        step = f64::min(LONGEST, 0.5 * clear);
    }
    let mut turns = vec![0.0; cluster.n_q];
    for v in &cluster.dependent {
        let dof = &cluster.dofs[*v];
        let gone = ws.q[cluster.q + dof.q] - zero[dof.q];
        let whole = if dof.motion == Motion::Revolute { (gone / TAU).round() } else { 0.0 };
        let unit = if dof.slides() { cluster.length } else { 1.0 };
        if (gone - whole * TAU).abs() > WHOLE * unit {
            return None;
        }
        turns[dof.q] = whole;
    }
    turns[i] = 1.0;
    Some(Turn { coordinate: i, turns })
}

/// The whole turns of the dependents of closed forms.
pub(super) fn wind(model: &mut Model<f64>) {
    let mut ws = Workspace::sized(model, Needs::default());
    for c in model.closed_clusters.clone() {
        if matches!(model.closures[c], Closure::Numerical(_) | Closure::Coupling(_)) {
            continue;
        }
        let cluster = &mut model.clusters[c];
        let dofs = cluster.dependent.iter().map(|v| cluster.dofs[*v]);
        let joints = dofs.filter(|dof| dof.motion == Motion::Revolute).map(|dof| Winding {
            coordinate: dof.q,
            middle: 0.0,
            turns: Vec::new(),
            is_function: false,
        });
        // the sweep counts from pose to pose
        cluster.windings.joints = joints.collect();
        if cluster.n_vy <= WIDEST {
            model.clusters[c].windings = swept(model, c, &mut ws);
        }
    }
}

/// Moves each independent of a cluster that a closed form closes once round from the zero pose to
/// either side, or to where the closed form ends, the others at zero.
fn swept(model: &Model<f64>, c: usize, ws: &mut Workspace<f64>) -> Windings {
    let cluster = &model.clusters[c];
    let mut windings = cluster.windings.clone();
    let mut poses: Vec<Vec<f64>> = Vec::new();
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    let singles = cluster.independent.iter().map(|v| cluster.dofs[*v]).filter(|dof| dof.single);
    for dof in singles {
        for (sign, end) in [-1.0, 1.0].into_iter().zip(&mut range) {
            let (way, is_round) = sweep(model, c, dof, sign, ws);
            for joint in windings.joints.iter_mut().filter(|_| is_round && sign > 0.0) {
                let of = |q: Option<&Vec<f64>>| q.map_or(0.0, |q| q[joint.coordinate]);
                let turns = ((of(way.last()) - of(way.first())) / TAU).round();
                joint.turns.extend((turns != 0.0).then_some((dof.q, turns)));
            }
            let is_angle =
                |q: &&Vec<f64>| windings.joints.iter().all(|of| q[of.coordinate].abs() < ANGLE);
            let last = way.iter().take_while(is_angle).last();
            *end = last.map_or(0.0, |q| q[dof.q]);
            poses.extend(way);
        }
        windings.within = (cluster.n_vy == 1).then_some((dof.q, range));
    }
    for joint in &mut windings.joints {
        let off = |q: &Vec<f64>| {
            let term = |off: f64, (k, turns): &(usize, f64)| off - turns * q[*k];
            joint.turns.iter().fold(q[joint.coordinate], term)
        };
        let least = poses.iter().map(off).fold(f64::INFINITY, f64::min);
        let most = poses.iter().map(off).fold(f64::NEG_INFINITY, f64::max);
        joint.is_function = cluster.n_vy == 1 && most - least < TAU;
        if !joint.turns.is_empty() || least < -ANGLE || most > ANGLE {
            joint.middle = 0.5 * (least + most);
            windings.leaves = true;
        }
    }
    windings
}

/// The poses of a cluster along one independent from zero on, each with the turns of its
/// dependents, and whether they come round.
fn sweep(
    model: &Model<f64>,
    c: usize,
    dof: Dof,
    sign: f64,
    ws: &mut Workspace<f64>,
) -> (Vec<Vec<f64>>, bool) {
    let cluster = &model.clusters[c];
    let at = cluster.coordinates();
    let zero = &model.zero[at.clone()];
    let turns = dof.motion == Motion::Revolute;
    let way = if turns { TAU } else { SLIDE * cluster.length };
    let longest = way / SWEEP;
    let mut poses = Vec::new();
    let mut step = longest;
    let mut gone = 0.0;
    let mut rate = f64::INFINITY;
    while poses.is_empty() || gone < way && step > FINEST * longest && poses.len() < MOST {
        let last: &[f64] = poses.last().map_or(zero, |q: &Vec<f64>| q);
        ws.start[at.clone()].copy_from_slice(last);
        ws.q[at.clone()].copy_from_slice(last);
        let next = if poses.is_empty() { 0.0 } else { (gone + step).min(way) };
        ws.q[cluster.q + dof.q] = zero[dof.q] + sign * next;
        let outcome = ws.close(model, c, Level::Jacobian);
        let of_joint = |joint: &usize| {
            let G = cluster.G(&ws.G).row(*joint).iter();
            if cluster.dofs[*joint].slides() {
                0.0
            } else {
                G.fold(0.0, |m: f64, g| m.max(g.abs()))
            }
        };
        let fastest = cluster.dependent.iter().map(of_joint).fold(0.0, f64::max);
        let bend = if poses.is_empty() { 0.0 } else { (next - gone) * rate.max(fastest) };
        if outcome.status == Status::Ok && bend < BEND {
            poses.push(ws.q[at.clone()].to_vec());
            (gone, rate, step) = (next, fastest, longest.min(2.0 * step));
        } else if poses.is_empty() {
            break;
        } else {
            step *= 0.5;
        }
    }
    (poses, turns && gone == way)
}
