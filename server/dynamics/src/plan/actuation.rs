//! Forces of the actuators.

use sarrus_proto::Status;

use crate::closure::column_unit;
use crate::linalg::{least_norm, solve_sound};
use crate::mechanism::Cluster;
use crate::model::{Direct, Model, Scope};
use crate::scalar::{BranchValue, Real, all_finite};
use crate::workspace::Workspace;

/// Solves G_uᵀ τ_u = τ_y cluster by cluster: exactly for as many actuators as independents, with
/// least norm for more, and in the least-squares sense for fewer, with the remainder in `tau_rest`.
/// Returns the growth of roundings: one over the least control of an actuator in a cluster.
pub(super) fn to_actuators<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
) -> Result<f64, Status> {
    let mut control = T::ONE;
    ws.tau_rest.fill(T::ZERO);
    let mut independents = scope.independents.runs();
    if !independents.all(|run| all_finite(&ws.tau_y[run])) {
        return Err(Status::NonFiniteInput);
    }
    for &Direct { vy, u, .. } in &scope.direct {
        match u {
            Some(u) => ws.tau_u[u] = ws.tau_y[vy],
            None => ws.tau_rest[vy] = ws.tau_y[vy],
        }
    }
    for cluster in scope.joined.iter().map(|c| &model.clusters[*c]) {
        let m = cluster.n_vy;
        let n_u = cluster.active.len();
        if (m, n_u) == (1, 1) {
            let (u, j) = cluster.active[0];
            let G = cluster.G(&ws.G)[(j, 0)];
            let i = cluster.independent[0];
            let unit = |j| T::from_f64(column_unit(cluster, j));
            control = lesser(control, (G * unit(i) / unit(j)).abs());
            let tau = ws.tau_y[cluster.vy] / G;
            if !tau.is_finite() {
                return Err(Status::SingularActuation);
            }
            ws.tau_u[u] = tau;
        } else if n_u == m {
            actuator_matrix(cluster, ws);
            let solved =
                solve_sound(&mut ws.dense, &mut ws.dense_rhs, m, 1, cluster.least_authority)
                    .ok_or(Status::SingularActuation)?;
            control = lesser(control, solved.least);
            for (r, (u, _)) in cluster.active.iter().enumerate() {
                if !(ws.dense_rhs[r].is_finite()) {
                    return Err(Status::SingularActuation);
                }
                ws.tau_u[*u] = ws.dense_rhs[r];
            }
        } else {
            actuator_matrix(cluster, ws);
            let solved = least_norm(&mut ws.dense, &mut ws.dense_rhs, &mut ws.dense_spare, m, n_u)
                .ok_or(Status::SingularActuation)?;
            // the pivots of the normal equations are squares, and so is the growth of roundings
            control = lesser(control, solved.least * authority(cluster, ws));
            for (r, (u, _)) in cluster.active.iter().enumerate() {
                ws.tau_u[*u] = ws.dense_spare[r];
            }
            for k in 0..m {
                let mut rest = ws.tau_y[cluster.vy + k];
                for (u, j) in &cluster.active {
                    rest = (-cluster.G(&ws.G)[(*j, k)]).mul_add(ws.tau_u[*u], rest);
                }
                ws.tau_rest[cluster.vy + k] = if n_u > m { T::ZERO } else { rest };
            }
        }
    }
    Ok((T::ONE / control).to_branch_value(BranchValue::Growth))
}

/// τ_u for the warning of limits alone: where it has no answer nothing is exceeded.
pub(super) fn to_warn<T: Real>(model: &Model<T>, scope: &Scope, ws: &mut Workspace<T>) {
    if to_actuators(model, scope, ws).is_err() {
        ws.tau_u.fill(T::from_f64(f64::NAN));
    }
}

/// The largest scaled entry of G_u, at most 1; 1 without actuators.
fn authority<T: Real>(cluster: &Cluster<T>, ws: &Workspace<T>) -> T {
    let unit = |j| T::from_f64(column_unit(cluster, j));
    let G = cluster.G(&ws.G);
    let mut most = if cluster.active.is_empty() { T::ONE } else { T::ZERO };
    for &(_, j) in &cluster.active {
        for (k, &i) in cluster.independent.iter().enumerate() {
            most = most.larger((G[(j, k)] * unit(i) / unit(j)).abs());
        }
    }
    lesser(T::ONE, most)
}

/// The lesser one; `a` where `b` is not a number.
pub(super) fn lesser<T: Real>(a: T, b: T) -> T {
    T::select_lt(b, a, b, a)
}

/// G_uᵀ (n_vy × n_u) into `dense`, τ_y into `dense_rhs`.
pub(super) fn actuator_matrix<T: Real>(cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    let m = cluster.n_vy;
    let n_u = cluster.active.len();
    let G = cluster.G(&ws.G);
    for k in 0..m {
        for (r, &(_, j)) in cluster.active.iter().enumerate() {
            ws.dense[k * n_u + r] = G[(j, k)];
        }
        ws.dense_rhs[k] = ws.tau_y[cluster.vy + k];
    }
}
