//! Independent joints without a limit on their turns, and the whole turns of their dependents.

use core::f64::consts::TAU;

use sarrus_proto::Status;

use crate::closure::{Closure, Level, Turn};
use crate::mechanism::Motion;
use crate::model::Model;
use crate::workspace::{Needs, Workspace};

/// Longest and shortest step `[rad]`, and least sine of the distance to a singular pose in steps:
/// no change point lies between two of them.
const LONGEST: f64 = TAU / 512.0;
const SHORTEST: f64 = 1e-4;
const CLEAR: f64 = 4.0;
/// Deviation from a whole turn, in radians or cluster lengths.
const WHOLE: f64 = 1e-6;

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
