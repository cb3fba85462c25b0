//! Continuation after a doubtful straight attempt of a numerical closure: follows the path in
//! substeps, and finds the reason of a failure.

use sarrus_proto::Status;

use crate::closure::numerical::{Branches, Numerical};
use crate::closure::path::distance;
use crate::closure::{
    Level, Local, Outcome, Scratch, column_unit, constraint_jacobian, constraint_residual,
    dependents_range, interpolate, largest_residual, local_poses, row_unit, rows_at, scaled,
};
use crate::linalg::{singular_range, solve_pivoted};
use crate::mechanism::Cluster;
use crate::scalar::Real;

/// Most attempts at a substep per request; each takes at most ten Newton steps per block.
const ATTEMPTS: u32 = 300;
/// The same on the way to a trial pose, of which the next one is nearer.
const TRIALS: u32 = 32;
/// First and shortest substep, as fractions of the whole path.
const FIRST: f64 = 1.0;
const SHORTEST: f64 = 1e-12;
/// Deviation of a step from its tangent, as part of the sine that vanishes where assemblies meet.
const STRAIGHT: f64 = 0.5;
/// Levenberg-Marquardt steps towards a goal that the path did not reach.
const SEARCH: u32 = 200;
/// Residual, in cluster lengths, from which on a redundant row indicates another closed pose.
const APART: f64 = 1e-3;
/// Least damping of the search.
const LIGHTEST: f64 = 1e-9;
/// Scaled residual at which the search has closed the loops, and slope, relative to the residual,
/// at which it has converged.
const FOUND: f64 = 1e-10;
const LEVEL: f64 = 1e-6;
/// Relative singular value below which K has lost rank if K_d could not be inverted.
const LOST: f64 = 1e-3;
/// Relative singular value of K_d at a pose that only the search could close, against the root of
/// its residual: a double root is known to half the digits.
const DOUBTFUL: f64 = 10.0;

/// Follows the straight path from `local.start` to the independents in `local.q`, shortening
/// doubtful substeps.
pub(in crate::closure) fn follow<T: Real>(
    numerical: &Numerical<T>,
    local: &mut Local<'_, T>,
    mut iterations: u32,
) -> Outcome {
    let cluster = local.cluster;
    let n = cluster.n_q;
    for &j in &cluster.independent_q {
        local.scratch.goal[j] = local.q[j];
    }
    let mut at = match begin(numerical, local, &mut iterations) {
        Ok(at) => at,
        Err(status) => return Outcome::failed(status, iterations),
    };
    local.scratch.last[..n].copy_from_slice(local.q);
    numerical.remember(local);
    let mut leads_on = leads_on_from(numerical, local);
    let whole = distance(cluster, local.start, &local.scratch.goal);
    let mut step = FIRST;
    let mut attempts = 0;
    let mut failed = false;
    let mut open = T::ZERO;
    while at < 1.0 {
        if local.scratch.left == 0 {
            leave_at_last(local);
            return Outcome::failed(Status::NotConverged, iterations);
        }
        attempts += 1;
        let next = f64::min(1.0, at + step);
        interpolate(cluster, local.start, &local.scratch.goal, T::from_f64(next), local.q);
        if next == 1.0 {
            cluster.independent_q.iter().for_each(|i| local.q[*i] = local.scratch.goal[*i]);
        }
        for &j in &cluster.dependent_q {
            local.q[j] = local.scratch.last[j];
        }
        let moved = whole * T::from_f64(next - at);
        let (good, count) = if at == 0.0 && numerical.is_far(local, moved) {
            (false, 0)
        } else {
            numerical.newton(local, Branches::Remembered, moved)
        };
        iterations += count;
        let gap = if good { redundant_gap(local) } else { T::ZERO };
        if good && holds(gap) && leads_on && goes_straight(numerical, local) {
            open = gap;
            local.scratch.last[..n].copy_from_slice(local.q);
            numerical.settle(local);
            at = next;
            leads_on = at == 1.0 || leads_on_from(numerical, local);
            // right after a failure the same step again
            step *= if failed { 1.0 } else { 2.0 };
            failed = false;
        } else {
            step *= 0.5;
            failed = true;
            let most = if local.is_trial { TRIALS } else { ATTEMPTS };
            if step < SHORTEST || attempts > most {
                leave_at_last(local);
                let status = if attempts > most || local.is_trial {
                    Status::NotConverged
                } else {
                    stalled(local)
                };
                return Outcome::failed(status, iterations);
            }
        }
    }
    Outcome { open: open.to_f64(), ..Outcome::closed(iterations) }
}

/// Closes the pose at which the steps begin: where the path leaves the table, or its start; returns
/// the part of the path before it.
fn begin<T: Real>(
    numerical: &Numerical<T>,
    local: &mut Local<'_, T>,
    iterations: &mut u32,
) -> Result<f64, Status> {
    let n = local.cluster.n_q;
    if let Some(share) = numerical.enter(local) {
        return Ok(share);
    }
    local.q.copy_from_slice(local.start);
    local.scratch.last[..n].copy_from_slice(local.start);
    // a guess that is not quite closed is closed first, at its own y
    numerical.settle(local);
    let (closed, count) = numerical.newton(local, Branches::Remembered, T::ZERO);
    *iterations += count;
    if closed {
        return Ok(0.0);
    }
    local.q.copy_from_slice(local.start);
    local.scratch.goal[..n].copy_from_slice(local.start);
    Err(stalled(local))
}

/// Leaves the given independents with the dependents of the last closed pose, and that pose in
/// `goal`, where diagnostics read it.
fn leave_at_last<T: Real>(local: &mut Local<'_, T>) {
    let cluster = local.cluster;
    let scratch = &mut *local.scratch;
    for &j in &cluster.independent_q {
        local.q[j] = scratch.goal[j];
    }
    for &j in &cluster.dependent_q {
        local.q[j] = scratch.last[j];
    }
    scratch.goal[..cluster.n_q].copy_from_slice(&scratch.last[..cluster.n_q]);
}

/// The tangent at the closed pose into G, where assemblies can meet; false where it has none.
fn leads_on_from<T: Real>(numerical: &Numerical<T>, local: &mut Local<'_, T>) -> bool {
    if !numerical.meets {
        return true;
    }
    let blocks = numerical.chosen(local.scratch);
    local.scratch.spend(blocks.blocks.iter().map(|block| block.work).sum());
    blocks.rates(local, Level::Jacobian)
}

/// True where assemblies cannot meet, or the step from `scratch.last` to `local.q` ends so near to
/// the tangent that it cannot have changed from one to the other: between them lies more than the
/// angle whose sine vanishes where they meet.
fn goes_straight<T: Real>(numerical: &Numerical<T>, local: &Local<'_, T>) -> bool {
    let cluster = local.cluster;
    if !numerical.meets {
        return true;
    }
    let step = |v: usize| {
        let q = cluster.dofs[v].q;
        local.q[q] - local.scratch.last[q]
    };
    let m = cluster.n_vy;
    let mut off = T::ZERO;
    for &v in &cluster.dependent {
        let independent = cluster.independent.iter().enumerate();
        let ahead =
            independent.fold(T::ZERO, |sum, (k, &i)| local.G[v * m + k].mul_add(step(i), sum));
        off += (step(v) - ahead).abs() * T::from_f64(1.0 / column_unit(cluster, v));
    }
    is_apart(numerical, local, off)
}

/// True where assemblies that meet are clearly farther apart than this, in radians and lengths of
/// the cluster.
pub(in crate::closure) fn is_apart<T: Real>(
    numerical: &Numerical<T>,
    local: &Local<'_, T>,
    off: T,
) -> bool {
    let gains = &local.scratch.gain[..numerical.chosen(local.scratch).blocks.len()];
    gains.iter().all(|gain| off * off * *gain < T::from_f64(STRAIGHT * STRAIGHT))
}

/// Largest gap of the rows that the solution leaves out, in radians or lengths of the cluster; the
/// poses are fresh.
pub(in crate::closure) fn redundant_gap<T: Real>(local: &mut Local<'_, T>) -> T {
    let cluster = local.cluster;
    if cluster.used.len() == cluster.rows.len() {
        return T::ZERO;
    }
    let scratch = &mut *local.scratch;
    constraint_residual(cluster, &scratch.pose, local.q, &mut scratch.phi);
    largest_residual(cluster, &scratch.phi)
}

/// True if rounded numbers of a file explain such a gap; another closed pose has a larger one.
pub(in crate::closure) fn holds<T: Real>(gap: T) -> bool {
    gap < T::from_f64(APART)
}

/// Why the path to the goal in `local.q` ended: some other closed pose has its y, or none has.
fn stalled<T: Real>(local: &mut Local<'_, T>) -> Status {
    match search(local) {
        Some(false) => Status::Unreachable,
        Some(true) if nearly_singular(local) => singular_status(local),
        Some(true) => Status::BranchChanged,
        None => Status::NotConverged,
    }
}

/// Levenberg-Marquardt on the dependents at fixed y, from `local.q`. `Some(true)`: the loops close.
/// `Some(false)`: a least distance was found that is not zero. `None`: neither within the steps
/// allowed.
fn search<T: Real>(local: &mut Local<'_, T>) -> Option<bool> {
    let &mut Local { cluster, bodies, .. } = local;
    let m = cluster.dependent.len();
    let rows = cluster.rows.len();
    let [found, level, lightest] =
        [(FOUND, 16.0), (LEVEL, 64.0), (LIGHTEST, 16.0)].map(|(x, n)| above_rounding::<T>(x, n));
    let mut damping = T::from_f64(1e-3);
    let scratch = &mut *local.scratch;
    local_poses(cluster, bodies, local.q, local.cos_sin, &mut scratch.pose);
    let mut cost = squared_residual(cluster, scratch, local.q);
    // K, JᵀJ and its factors
    let work = 60 * cluster.n + 8 * rows * cluster.n_v + m * m * (rows + m / 3) + 30 * rows;
    for _ in 0..SEARCH {
        if cost < T::from_f64(found * found) {
            return Some(true);
        }
        if !scratch.spend(work as u64) {
            return None;
        }
        constraint_jacobian(cluster, &scratch.pose, local.q, &mut scratch.K);
        squared_residual(cluster, scratch, local.q);
        let J = &mut scratch.inverse;
        scaled(cluster, &scratch.K, 0..rows, &cluster.dependent, |r, a, x| J[r * m + a] = x);
        // normal equations of the dependents, damped
        let mut slope = T::ZERO;
        for a in 0..m {
            for b in 0..m {
                let x = (0..rows).fold(T::ZERO, |sum, r| J[r * m + a].mul_add(J[r * m + b], sum));
                scratch.A[a * m + b] = if a == b { x + damping } else { x };
            }
            let x = (0..rows).fold(T::ZERO, |sum, r| J[r * m + a].mul_add(scratch.phi[r], sum));
            scratch.B[a] = x;
            slope = x.mul_add(x, slope);
        }
        if slope < T::from_f64(level * level) * cost {
            return Some(false);
        }
        solve_pivoted(&mut scratch.A, &mut scratch.B, m, 1)?;
        for &i in &cluster.dependent_q {
            scratch.last[i] = local.q[i];
        }
        for (a, &j) in cluster.dependent.iter().enumerate() {
            cluster.dofs[j]
                .advance(local.q, -(scratch.B[a] * T::from_f64(column_unit(cluster, j))));
        }
        local_poses(cluster, bodies, local.q, local.cos_sin, &mut scratch.pose);
        let next = squared_residual(cluster, scratch, local.q);
        if next < cost {
            cost = next;
            damping =
                T::select_lt(damping, T::from_f64(lightest), damping, damping * T::from_f64(0.2));
        } else {
            for &i in &cluster.dependent_q {
                local.q[i] = scratch.last[i];
            }
            local_poses(cluster, bodies, local.q, local.cos_sin, &mut scratch.pose);
            damping *= T::from_f64(8.0);
        }
    }
    None
}

/// A threshold, or this many unit roundoffs where the scalar has too few digits for it.
fn above_rounding<T: Real>(threshold: f64, roundings: f64) -> f64 {
    threshold.max(roundings * T::EPSILON)
}

/// Σ φ² of the scaled φ, which stays in the scratch.
fn squared_residual<T: Real>(cluster: &Cluster<T>, scratch: &mut Scratch<T>, q: &[T]) -> T {
    constraint_residual(cluster, &scratch.pose, q, &mut scratch.phi);
    let rows = cluster.cuts.iter().flat_map(|cut| &cut.rows);
    rows.zip(&mut scratch.phi).fold(T::ZERO, |sum, (row, phi)| {
        *phi *= T::from_f64(row_unit(cluster, row));
        phi.mul_add(*phi, sum)
    })
}

/// True where K_d is near a loss of rank at the pose that the search found, whose poses are fresh.
fn nearly_singular<T: Real>(local: &mut Local<'_, T>) -> bool {
    let cluster = local.cluster;
    let scratch = &mut *local.scratch;
    constraint_jacobian(cluster, &scratch.pose, local.q, &mut scratch.K);
    let (largest, least) = dependents_range(cluster, scratch);
    least / largest < T::from_f64(DOUBTFUL * above_rounding::<T>(FOUND, 16.0).sqrt())
}

/// Which rank was lost where a block of K_d could not be inverted: that of the whole K, or only
/// that of K_d.
pub(in crate::closure) fn singular_status<T: Real>(local: &mut Local<'_, T>) -> Status {
    let &mut Local { cluster, bodies, .. } = local;
    let scratch = &mut *local.scratch;
    local_poses(cluster, bodies, local.q, local.cos_sin, &mut scratch.pose);
    constraint_jacobian(cluster, &scratch.pose, local.q, &mut scratch.K);
    if loses_rank(cluster, scratch) {
        Status::SingularClosure
    } else {
        Status::SingularIndependents
    }
}

/// True where the K in the scratch has lost rank.
pub(crate) fn loses_rank<T: Real>(cluster: &Cluster<T>, scratch: &mut Scratch<T>) -> bool {
    let n = cluster.n_v;
    let used = rows_at(cluster, scratch, f64::INFINITY);
    let rows = used.len();
    // the transpose of the scaled K; idle joints stand still
    let A = &mut scratch.A;
    A[..n * rows].fill(T::ZERO);
    for columns in [&cluster.independent, &cluster.dependent] {
        scaled(cluster, &scratch.K, used.iter().copied(), columns, |i, a, x| {
            A[columns[a] * rows + i] = x
        });
    }
    let (largest, least) = singular_range(A, n, rows);
    // narrow blocks are refused from ten roots of the unit roundoff on
    let lost = f64::max(LOST, 10.0 * T::EPSILON.sqrt());
    least < T::from_f64(lost) * largest
}
