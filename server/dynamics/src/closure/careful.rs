//! What a numerical closure does when the straight attempt is doubtful: follow the path in substeps, and name the reason of a failure.

use sarrus_proto::Status;

use super::numerical::Numerical;
use super::{Local, Outcome, between, constraint_jacobian, constraint_residual, local_poses};
use crate::linear::{singular_range, solve_pivoted};
use crate::model::{Body, Cluster};
use crate::scalar::Scalar;

/// Newton steps that one request may cost.
const BUDGET: u32 = 1200;
/// First and shortest substep, as fractions of the whole path.
const FIRST: f64 = 1.0;
const SHORTEST: f64 = 1.0 / 65536.0;
/// Levenberg-Marquardt steps towards a goal that the path did not reach.
const SEARCH: u32 = 200;
/// Relative singular value below which K has lost rank where K_d could not be inverted.
const LOST: f64 = 1e-3;
/// The same for K_d at a pose that only the search could close: at a double root it is known to half the digits.
const DOUBTFUL: f64 = 1e-4;

/// Follows the straight path from `local.start` to the independents in `local.q`, shortening a substep that is doubtful.
pub(super) fn follow<T: Scalar>(
    numerical: &Numerical<T>,
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    local: &mut Local<'_, T>,
    mut iterations: u32,
) -> Outcome {
    let n = cluster.n_q;
    for &j in &cluster.independent_q {
        local.scratch.goal[j] = local.q[j];
    }
    local.q.copy_from_slice(local.start);
    local.scratch.last[..n].copy_from_slice(local.start);
    // a guess that is not quite closed is closed first, at its own y
    numerical.remember(cluster, bodies, local);
    let (closed, count) = numerical.newton(cluster, bodies, local, true);
    iterations += count;
    if !closed {
        return Outcome::failed(stalled(cluster, bodies, local, iterations), iterations);
    }
    local.scratch.last[..n].copy_from_slice(local.q);
    numerical.remember(cluster, bodies, local);
    let (mut at, mut step) = (0.0, FIRST);
    while at < 1.0 {
        let next = f64::min(1.0, at + step);
        between(cluster, local.start, &local.scratch.goal, T::from_f64(next), local.q);
        if next == 1.0 {
            cluster.independent_q.iter().for_each(|i| local.q[*i] = local.scratch.goal[*i]);
        }
        for &j in &cluster.dependent_q {
            local.q[j] = local.scratch.last[j];
        }
        let (good, count) = numerical.newton(cluster, bodies, local, true);
        iterations += count;
        if good {
            local.scratch.last[..n].copy_from_slice(local.q);
            numerical.remember(cluster, bodies, local);
            at = next;
            step *= 2.0;
        } else {
            step *= 0.5;
            if step < SHORTEST || iterations > BUDGET {
                for &j in &cluster.independent_q {
                    local.q[j] = local.scratch.goal[j];
                }
                for &j in &cluster.dependent_q {
                    local.q[j] = local.scratch.last[j];
                }
                return Outcome::failed(stalled(cluster, bodies, local, iterations), iterations);
            }
        }
    }
    Outcome { status: Status::Ok, iterations }
}

/// Why the goal in `local.q` was not reached: some other closed pose has its y, none has, or the budget ran out.
fn stalled<T: Scalar>(cluster: &Cluster<T>, bodies: &[Body<T>], local: &mut Local<'_, T>, iterations: u32) -> Status {
    match search(cluster, bodies, local) {
        Some(false) => Status::Unreachable,
        _ if iterations > BUDGET => Status::NotConverged,
        Some(true) if dependents_range(cluster, local) < T::from_f64(DOUBTFUL) => singular_status(cluster, bodies, local),
        Some(true) => Status::BranchChanged,
        None => Status::NotConverged,
    }
}

/// Levenberg-Marquardt on the dependents at fixed y, from `local.q`. `Some(true)`: the loops close. `Some(false)`: a least distance was
/// found that is not zero. `None`: neither within the steps allowed.
fn search<T: Scalar>(cluster: &Cluster<T>, bodies: &[Body<T>], local: &mut Local<'_, T>) -> Option<bool> {
    let (n, m, rows) = (cluster.n_v, cluster.dependent.len(), cluster.rows.len());
    let length = T::from_f64(cluster.length);
    let mut damping = T::from_f64(1e-3);
    let scratch = &mut *local.scratch;
    local_poses(cluster, bodies, local.q, local.turn, &mut scratch.pose);
    let mut cost = squared_residual(cluster, scratch, local.q);
    for _ in 0..SEARCH {
        if cost < T::from_f64(1e-20) * length * length {
            return Some(true);
        }
        constraint_jacobian(cluster, &scratch.pose, &mut scratch.K);
        constraint_residual(cluster, &scratch.pose, local.q, &mut scratch.phi);
        // normal equations of the dependents, damped
        let mut slope = T::ZERO;
        for a in 0..m {
            for b in 0..m {
                let mut x = T::ZERO;
                for r in 0..rows {
                    x = scratch.K[r * n + cluster.dependent[a]].mul_add(scratch.K[r * n + cluster.dependent[b]], x);
                }
                let unit = if cluster.freedoms[cluster.dependent[a]].slides() { T::ONE } else { length * length };
                scratch.A[a * m + b] = if a == b { x + damping * unit } else { x };
            }
            let mut x = T::ZERO;
            for r in 0..rows {
                x = scratch.K[r * n + cluster.dependent[a]].mul_add(scratch.phi[r], x);
            }
            scratch.B[a] = x;
            slope = x.mul_add(x, slope);
        }
        if slope < T::from_f64(1e-12) * cost * length * length {
            return Some(false);
        }
        solve_pivoted(&mut scratch.A, &mut scratch.B, m, 1)?;
        for &i in &cluster.dependent_q {
            scratch.last[i] = local.q[i];
        }
        for (a, &j) in cluster.dependent.iter().enumerate() {
            cluster.freedoms[j].advance(local.q, -scratch.B[a]);
        }
        local_poses(cluster, bodies, local.q, local.turn, &mut scratch.pose);
        let next = squared_residual(cluster, scratch, local.q);
        if next < cost {
            cost = next;
            damping *= T::from_f64(0.2);
        } else {
            for &i in &cluster.dependent_q {
                local.q[i] = scratch.last[i];
            }
            local_poses(cluster, bodies, local.q, local.turn, &mut scratch.pose);
            damping *= T::from_f64(8.0);
        }
    }
    None
}

/// Σ φ².
fn squared_residual<T: Scalar>(cluster: &Cluster<T>, scratch: &mut super::Scratch<T>, q: &[T]) -> T {
    constraint_residual(cluster, &scratch.pose, q, &mut scratch.phi);
    scratch.phi[..cluster.rows.len()].iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum))
}

/// σ_min / σ_max of the scaled K_d at the pose in `local.q`.
fn dependents_range<T: Scalar>(cluster: &Cluster<T>, local: &mut Local<'_, T>) -> T {
    let (n, m) = (cluster.n_v, cluster.dependent.len());
    let scratch = &mut *local.scratch;
    constraint_jacobian(cluster, &scratch.pose, &mut scratch.K);
    let length = T::from_f64(cluster.length);
    for (i, &r) in cluster.used.iter().enumerate() {
        for (a, &j) in cluster.dependent.iter().enumerate() {
            let unit = if cluster.freedoms[j].slides() { length } else { T::ONE };
            scratch.A[i * m + a] = scratch.K[r * n + j] * unit;
        }
    }
    let (largest, least) = singular_range(&mut scratch.A, m, m);
    least / largest
}

/// Which rank was lost where a block of K_d could not be inverted: that of the whole K, or only that of K_d.
pub(super) fn singular_status<T: Scalar>(cluster: &Cluster<T>, bodies: &[Body<T>], local: &mut Local<'_, T>) -> Status {
    let (n, rows) = (cluster.n_v, cluster.used.len());
    let scratch = &mut *local.scratch;
    local_poses(cluster, bodies, local.q, local.turn, &mut scratch.pose);
    constraint_jacobian(cluster, &scratch.pose, &mut scratch.K);
    // the transpose of K, sliders in cluster lengths: rank = number of its columns that stand apart
    let length = T::from_f64(cluster.length);
    for j in 0..n {
        let unit = if cluster.freedoms[j].slides() { length } else { T::ONE };
        for (i, &r) in cluster.used.iter().enumerate() {
            scratch.A[j * rows + i] = scratch.K[r * n + j] * unit;
        }
    }
    let (largest, least) = singular_range(&mut scratch.A, n, rows);
    if least < T::from_f64(LOST) * largest { Status::SingularClosure } else { Status::SingularIndependents }
}
