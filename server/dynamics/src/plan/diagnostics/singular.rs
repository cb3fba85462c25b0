//! Outputs at a singular pose: good independents, and uncontrolled motions.

use crate::closure::{column_unit, scaled};
use crate::linalg::{column_square, decompose};
use crate::mechanism::Cluster;
use crate::model::Model;
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Least scaled pivot of K, relative to the first, that determines a dependent.
const DETERMINED: f64 = 1e-4;

/// 1 at the tree velocities that are declared independent.
pub(in crate::plan) fn declared_independents<T: Real>(model: &Model<T>, good: &mut [T]) {
    good.fill(T::ZERO);
    model.order.vy_v.iter().for_each(|v| good[model.order.v_external[*v]] = T::ONE);
}

/// A set of good independents of one cluster at a pose: the columns that remain after pivoted QR of
/// the scaled K picks dependents, each time the column farthest from the span of those before.
/// False if K has lost rank, so that no set is good; nothing is written then.
pub(in crate::plan) fn good_independents<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    K: &[T],
    (A, taken): (&mut [T], &mut [T]),
    good: &mut [T],
) -> bool {
    let n = cluster.n_v;
    let rows = cluster.rows.len();
    // column by column; −1 marks an excluded column
    for v in 0..n {
        scaled(cluster, K, 0..rows, &[v], |r, _, x| A[v * rows + r] = x);
        taken[v] = if cluster.locked.contains(&v) { -T::ONE } else { T::ZERO };
    }
    let square = |A: &[T], v: usize| {
        (0..rows).fold(T::ZERO, |sum, r| A[v * rows + r].mul_add(A[v * rows + r], sum))
    };
    let mut first = T::ZERO;
    let mut sound = true;
    for k in 0..cluster.dependent.len() {
        let mut best = 0;
        let mut largest = -T::ONE;
        for v in (0..n).filter(|v| taken[*v] == T::ZERO) {
            let of = square(A, v);
            if of > largest {
                (best, largest) = (v, of);
            }
        }
        if k == 0 {
            first = largest;
        }
        sound &= (first * T::from_f64(DETERMINED * DETERMINED)).lt(largest);
        taken[best] = T::ONE;
        for v in (0..n).filter(|v| taken[*v] == T::ZERO) {
            let share = (0..rows)
                .fold(T::ZERO, |sum, r| A[best * rows + r].mul_add(A[v * rows + r], sum))
                / largest;
            for r in 0..rows {
                A[v * rows + r] = (-share).mul_add(A[best * rows + r], A[v * rows + r]);
            }
        }
    }
    for v in (0..n).filter(|_| sound) {
        good[model.order.v_external[cluster.v + v]] =
            if taken[v] == T::ZERO { T::ONE } else { T::ZERO };
    }
    sound
}

/// The direction of ẏ, of unit length, that the actuators move least in the scaling: the last right
/// singular vector of the scaled G_u of the cluster in which it is smallest, of those that nothing
/// ties and the first `closed` of the tied ones.
pub(in crate::plan) fn uncontrolled<T: Real>(
    model: &Model<T>,
    ws: &mut Workspace<T>,
    closed: usize,
    direction: &mut [T],
) {
    let mut least = T::from_f64(f64::INFINITY);
    // where no cluster has a finite G there is none
    direction.fill(T::from_f64(f64::NAN));
    let open = &model.closed_clusters[closed.min(model.closed_clusters.len())..];
    for (_, cluster) in model.clusters.iter().enumerate().filter(|(c, _)| !open.contains(c)) {
        let m = cluster.n_vy;
        let rows = cluster.active.len().max(cluster.n_vy);
        let unit = |v: usize| T::from_f64(column_unit(cluster, v));
        ws.dense[..rows * m].fill(T::ZERO);
        let G = cluster.G(&ws.G);
        for (r, &(_, v)) in cluster.active.iter().enumerate() {
            for (k, &y) in cluster.independent.iter().enumerate() {
                ws.dense[r * m + k] = G[(v, k)] * unit(y) / unit(v);
            }
        }
        if !ws.dense[..rows * m].iter().all(|x| Real::is_finite(*x)) {
            continue;
        }
        decompose(&mut ws.dense, &mut ws.dense_rhs, rows, m);
        for a in 0..m {
            let sigma = column_square(&ws.dense, rows, m, a);
            if !sigma.lt(least) {
                continue;
            }
            least = sigma;
            direction.fill(T::ZERO);
            let part = |k: usize| ws.dense_rhs[k * m + a] * unit(cluster.independent[k]);
            let norm = (0..m).fold(T::ZERO, |sum, k| sum + part(k) * part(k)).sqrt();
            for k in 0..m {
                direction[model.order.vy_external[cluster.vy + k]] = part(k) / norm;
            }
        }
    }
}
