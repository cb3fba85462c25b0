//! Forward dynamics with the loops as constraints of the whole tree: an oracle that shares neither
//! G nor a recursion with the other methods [F08, 8.5, eq. 8.26].
//!
//! ```text
//! [ M  Kᵀ ] [ q̈ ]   [ τ_q − C ]
//! [ K  0  ] [−λ ] = [    k    ]      with the rows of K that were kept at load
//! ```
//!
//! solved with pivoting after symmetric scaling of rows and columns: q̈ by M_ii^−½, each row of K
//! by its largest entry. Idle joints do not move.

use sarrus_proto::Status;

use crate::algorithms;
use crate::closure::{CLEAR, constraint_bias, constraint_residual, local_rates, row_unit, rows_at};
use crate::linalg::solve_pivoted;
use crate::mechanism::Cluster;
use crate::model::{Model, Scope};
use crate::plan::Plan;
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Distance of a state from a closed one: the largest scaled |φ| and |K q̇|.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drift<T> {
    pub(crate) position: T,
    pub(crate) velocity: T,
}

impl Plan {
    /// q̈, and the forces of the loops on the tree into `loop_q`, from the forces given on the
    /// tree; needs the closed state and C in `tau_q`.
    pub(super) fn kkt<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
    ) -> Result<(), Status> {
        let ended = tree_under_constraints(model, &self.needed.scope, ws, None);

        // Kᵀ λ
        let x = core::mem::take(&mut ws.kkt_rhs);
        ws.loop_q.fill(T::ZERO);
        let mut row = model.meta.sizes.n_v;
        for &c in &model.closed_clusters {
            let cluster = &model.clusters[c];
            ws.constraint_jacobian(cluster, model.bodies_of(cluster));
            for &r in rows_at(cluster, &mut ws.scratch, CLEAR) {
                for j in 0..cluster.n_v {
                    let force = &mut ws.loop_q[cluster.v + j];
                    *force = (-ws.scratch.K[r * cluster.n_v + j]).mul_add(x[row], *force);
                }
                row += 1;
            }
        }
        ws.kkt_rhs = x;
        ended
    }
}

/// q̈ into `qdd`, and −λ of the kept rows in the order of the closed clusters behind it in
/// `kkt_rhs`.
///
/// The scope is all of the robot. Needs q, q̇, the joint poses, C in `tau_q` and the given forces
/// in `loop_q`. With a stabilisation (α, β) the state need not be closed:
/// K q̈ = k − 2 α K q̇ − β² φ \[B72\]; how far from closed it is then goes into `drift`.
pub(crate) fn tree_under_constraints<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
    mut stabilised: Option<([T; 2], &mut Drift<T>)>,
) -> Result<(), Status> {
    let n_v = model.meta.sizes.n_v;
    let n_rows: usize = model.closed_clusters.iter().map(|c| model.clusters[*c].used.len()).sum();
    let n = n_v + n_rows;
    let mut A = core::mem::take(&mut ws.kkt);
    let mut x = core::mem::take(&mut ws.kkt_rhs);
    let mut scale = core::mem::take(&mut ws.kkt_scale);

    // M, τ_q − C, K, k
    A.fill(T::ZERO);
    algorithms::tree_mass_matrix(model, scope, &ws.motion, &mut ws.composite, &mut A, n);
    for v in 0..n_v {
        x[v] = ws.loop_q[v] - ws.tau_q[v];
        scale[v] = T::select_lt(T::ZERO, A[v * n + v], T::ONE / A[v * n + v].sqrt(), T::ONE);
    }
    let mut row = n_v;
    for &c in &model.closed_clusters {
        let cluster = &model.clusters[c];
        ws.constraint_jacobian(cluster, model.bodies_of(cluster));
        let rows = rows_at(cluster, &mut ws.scratch, CLEAR);
        bias(model, cluster, ws);
        if let Some(([alpha, beta], drift)) = &mut stabilised {
            stabilise(cluster, ws, *alpha, *beta, drift);
        }
        for &r in rows {
            x[row] = ws.scratch.phi[r];
            let mut largest = T::ZERO;
            for j in 0..cluster.n_v {
                let v = cluster.v + j;
                let entry = ws.scratch.K[r * cluster.n_v + j];
                (A[row * n + v], A[v * n + row]) = (entry, entry);
                let size = (entry * scale[v]).abs();
                largest = T::select_lt(largest, size, size, largest);
            }
            scale[row] = T::select_lt(T::ZERO, largest, T::ONE / largest, T::ONE);
            row += 1;
        }
        // an idle joint has a row of its own: q̈ = 0
        for &j in &cluster.locked {
            let v = cluster.v + j;
            (0..n).for_each(|i| (A[v * n + i], A[i * n + v]) = (T::ZERO, T::ZERO));
            (A[v * n + v], x[v], scale[v]) = (T::ONE, T::ZERO, T::ONE);
        }
    }

    // the scaled system; its determinant has the sign of (−1)^rows where M is positive along the
    // loops
    for i in 0..n {
        x[i] *= scale[i];
        for j in 0..n {
            A[i * n + j] = A[i * n + j] * scale[i] * scale[j];
        }
    }
    let sign = solve_pivoted(&mut A, &mut x, n, 1);
    let positive =
        sign.is_some_and(|sign| T::ZERO.lt(if n_rows.is_multiple_of(2) { sign } else { -sign }));
    x.iter_mut().zip(&scale).for_each(|(x, scale)| *x *= *scale);
    ws.qdd.copy_from_slice(&x[..n_v]);
    (ws.kkt, ws.kkt_rhs, ws.kkt_scale) = (A, x, scale);
    if positive { Ok(()) } else { Err(Status::MassNotPositive) }
}

/// k of the same cluster into `phi`.
fn bias<T: Real>(model: &Model<T>, cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    let bodies = model.bodies_of(cluster);
    let qd = &ws.qd[cluster.velocities()];
    let scratch = &mut ws.scratch;
    local_rates(cluster, bodies, qd, &scratch.pose, &mut scratch.rate);
    let q = &ws.q[cluster.coordinates()];
    constraint_bias(cluster, &scratch.pose, (q, qd, &scratch.rate), &mut scratch.phi);
}

/// How far the state in q and q̇ is from closed.
pub(crate) fn drift_of<T: Real>(model: &Model<T>, ws: &mut Workspace<T>) -> Drift<T> {
    let mut drift = Drift { position: T::ZERO, velocity: T::ZERO };
    for &c in &model.closed_clusters {
        ws.constraint_jacobian(&model.clusters[c], model.bodies_of(&model.clusters[c]));
        stabilise(&model.clusters[c], ws, T::ZERO, T::ZERO, &mut drift);
    }
    drift
}

/// k − 2 α K q̇ − β² φ in place of k, and how large these are.
fn stabilise<T: Real>(
    cluster: &Cluster<T>,
    ws: &mut Workspace<T>,
    alpha: T,
    beta: T,
    drift: &mut Drift<T>,
) {
    let q = &ws.q[cluster.coordinates()];
    let qd = &ws.qd[cluster.velocities()];
    let scratch = &mut ws.scratch;
    let phi = &mut scratch.B[..cluster.rows.len()];
    constraint_residual(cluster, &scratch.pose, q, phi);
    for (r, row) in cluster.cuts.iter().flat_map(|cut| &cut.rows).enumerate() {
        let of_row = &scratch.K[r * cluster.n_v..(r + 1) * cluster.n_v];
        let phi_dot =
            of_row.iter().zip(qd).fold(T::ZERO, |sum, (entry, qd)| entry.mul_add(*qd, sum));
        let damping = (alpha + alpha).mul_add(phi_dot, beta * beta * phi[r]);
        scratch.phi[r] -= damping;
        let unit = T::from_f64(row_unit(cluster, row));
        for (largest, x) in [(&mut drift.position, phi[r]), (&mut drift.velocity, phi_dot)] {
            let x = x.abs() * unit;
            *largest = T::select_lt(*largest, x, x, *largest);
        }
    }
}
