//! Forward dynamics with the loops as constraints of the whole tree: an oracle that shares neither G nor a recursion with the other methods
//! (Featherstone 2008, section 8.5, equation 8.26).
//!
//! ```text
//! [ M  Kᵀ ] [ q̈ ]   [ τ_q − C ]
//! [ K  0  ] [−λ ] = [    k    ]      with the rows of K that were kept at load
//! ```
//!
//! solved with exchanges after rows and columns were scaled alike: q̈ by M_ii^−½, each row of K by its largest entry.

use sarrus_proto::Status;

use super::Plan;
use crate::closure::{constraint_bias, constraint_jacobian, local_poses, local_rates};
use crate::linear::solve_pivoted;
use crate::model::{Cluster, Model};
use crate::scalar::Scalar;
use crate::tree;
use crate::workspace::Workspace;

impl Plan {
    /// q̈, and the forces of the loops on the tree into `loop_q`, from the forces given on the tree; needs the closed state and C in `tau_q`.
    pub(super) fn kkt<T: Scalar>(&self, model: &Model<T>, ws: &mut Workspace<T>) -> Result<(), Status> {
        let n_v = model.meta.sizes.n_v;
        let n_rows: usize = model.tied.iter().map(|c| model.clusters[*c].used.len()).sum();
        let n = n_v + n_rows;
        let mut A = core::mem::take(&mut ws.kkt);
        let (mut x, mut scale) = (core::mem::take(&mut ws.kkt_rhs), core::mem::take(&mut ws.kkt_scale));

        // M, τ_q − C, K, k
        A.fill(T::ZERO);
        tree::tree_mass_matrix(model, &ws.motion, &mut ws.composite, &mut A, n);
        for v in 0..n_v {
            x[v] = ws.loop_q[v] - ws.tau_q[v];
            scale[v] = T::select(T::ZERO.lt(A[v * n + v]), T::ONE / A[v * n + v].sqrt(), T::ONE);
        }
        let mut row = n_v;
        for &c in &model.tied {
            let cluster = &model.clusters[c];
            rows(model, cluster, ws);
            for &r in &cluster.used {
                x[row] = ws.scratch.phi[r];
                let mut largest = T::ZERO;
                for j in 0..cluster.n_v {
                    let (v, entry) = (cluster.v + j, ws.scratch.K[r * cluster.n_v + j]);
                    (A[row * n + v], A[v * n + row]) = (entry, entry);
                    let size = (entry * scale[v]).abs();
                    largest = T::select(largest.lt(size), size, largest);
                }
                scale[row] = T::select(T::ZERO.lt(largest), T::ONE / largest, T::ONE);
                row += 1;
            }
        }

        // the scaled system; its determinant has the sign of (−1)^rows where M is positive along the loops
        for i in 0..n {
            x[i] *= scale[i];
            for j in 0..n {
                A[i * n + j] = A[i * n + j] * scale[i] * scale[j];
            }
        }
        let det = solve_pivoted(&mut A, &mut x, n, 1);
        let positive = det.is_some_and(|det| T::ZERO.lt(if n_rows.is_multiple_of(2) { det } else { -det }));
        x.iter_mut().zip(&scale).for_each(|(x, scale)| *x *= *scale);

        // q̈, and Kᵀ λ
        ws.qdd.copy_from_slice(&x[..n_v]);
        ws.loop_q.fill(T::ZERO);
        let mut row = n_v;
        for &c in &model.tied {
            let cluster = &model.clusters[c];
            rows(model, cluster, ws);
            for &r in &cluster.used {
                for j in 0..cluster.n_v {
                    let force = &mut ws.loop_q[cluster.v + j];
                    *force = (-ws.scratch.K[r * cluster.n_v + j]).mul_add(x[row], *force);
                }
                row += 1;
            }
        }
        (ws.kkt, ws.kkt_rhs, ws.kkt_scale) = (A, x, scale);
        if positive { Ok(()) } else { Err(Status::MassNotPositive) }
    }
}

/// K and k of one cluster at the closed state, into the scratch of closures.
fn rows<T: Scalar>(model: &Model<T>, cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    let bodies = &model.bodies[cluster.body..cluster.body + cluster.n];
    let (q, qd) = (&ws.q[cluster.q..cluster.q + cluster.n_q], &ws.qd[cluster.v..cluster.v + cluster.n_v]);
    let scratch = &mut ws.scratch;
    local_poses(cluster, bodies, q, &mut ws.turn[cluster.body..cluster.body + cluster.n], &mut scratch.pose);
    constraint_jacobian(cluster, &scratch.pose, &mut scratch.K);
    local_rates(cluster, bodies, qd, &scratch.pose, &mut scratch.rate);
    constraint_bias(cluster, &scratch.pose, &scratch.rate, &mut scratch.phi);
}
