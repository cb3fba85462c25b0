//! What is asked rarely about the loops of a closed state: K and k, residual, conditions, loop-closure forces.

use sarrus_proto::{Field, Status};

use super::Plan;
use crate::closure::{constraint_bias, constraint_jacobian, constraint_residual, largest_residual, local_poses, local_rates};
use crate::linear::{singular_range, solve_pivoted};
use crate::model::{Cluster, Model};
use crate::scalar::Scalar;
use crate::workspace::Workspace;

/// The figures of a closed state.
#[derive(Clone, Copy)]
pub(super) struct Conditions<T> {
    pub(super) residual: T,
    pub(super) cond_Kd: T,
    pub(super) cond_Gu: T,
    pub(super) sigma_min: T,
    pub(super) cond_My: T,
}

impl Plan {
    /// Evaluates the rows of every tied cluster at the closed state; writes K, k and λ straight to the output.
    pub(super) fn conditions<T: Scalar>(&self, model: &Model<T>, ws: &mut Workspace<T>, output: &mut [T]) -> Result<Conditions<T>, Status> {
        let sizes = model.sizes();
        let slot = |field| self.want().slot(field).map(|slot| slot.range());
        let (K, k_bias, lambda) = (slot(Field::K), slot(Field::KBias), slot(Field::Lambda));
        if let Some(range) = &K {
            output[range.clone()].fill(T::ZERO);
        }
        let mut residual = T::ZERO;
        let (mut unscaled, mut scaled) = (Range::none(), Range::none());
        for &c in &model.tied {
            let cluster = &model.clusters[c];
            let (n, v) = (cluster.n_v, cluster.v);
            let bodies = &model.bodies[cluster.body..cluster.body + cluster.n];
            let scratch = &mut ws.scratch;
            let q = &ws.q[cluster.q..cluster.q + cluster.n_q];
            local_poses(cluster, bodies, q, &mut ws.turn[cluster.body..cluster.body + cluster.n], &mut scratch.pose);

            constraint_residual(cluster, &scratch.pose, q, &mut scratch.phi);
            let of_cluster = largest_residual(cluster, &scratch.phi);
            residual = T::select(residual.lt(of_cluster), of_cluster, residual);
            constraint_jacobian(cluster, &scratch.pose, &mut scratch.K);
            if let Some(range) = &K {
                let K = &mut output[range.clone()];
                for (r, row) in cluster.rows.iter().enumerate() {
                    for j in 0..n {
                        K[row * sizes.n_v + model.order.v_external[v + j]] = scratch.K[r * n + j];
                    }
                }
            }
            if let Some(range) = &k_bias {
                local_rates(cluster, bodies, &ws.qd[v..v + n], &scratch.pose, &mut scratch.rate);
                constraint_bias(cluster, &scratch.pose, &scratch.rate, &mut scratch.phi);
                let k = &mut output[range.clone()];
                cluster.rows.iter().enumerate().for_each(|(r, row)| k[*row] = scratch.phi[r]);
            }
            if self.wants_any(&[Field::CondKd, Field::SigmaMin]) {
                unscaled.add(K_d(cluster, &scratch.K, &mut scratch.A, false));
                scaled.add(K_d(cluster, &scratch.K, &mut scratch.A, true));
            }
            if let Some(range) = &lambda {
                loop_forces(cluster, &ws.loop_q[v..v + n], &scratch.K, &mut scratch.A, &mut scratch.B, &mut output[range.clone()])?;
            }
        }
        Ok(Conditions {
            residual,
            cond_Kd: unscaled.ratio(),
            sigma_min: if model.tied.is_empty() { T::ONE } else { scaled.least },
            cond_Gu: if self.wants(Field::CondGu) { cond_Gu(model, ws) } else { T::ONE },
            cond_My: if self.wants(Field::CondMy) { cond_My(model, ws) } else { T::ONE },
        })
    }
}

/// The largest and least of several ranges of singular values.
struct Range<T> {
    largest: T,
    least: T,
}

impl<T: Scalar> Range<T> {
    fn none() -> Range<T> {
        Range { largest: T::ZERO, least: T::from_f64(f64::INFINITY) }
    }

    fn add(&mut self, (largest, least): (T, T)) {
        self.largest = T::select(self.largest.lt(largest), largest, self.largest);
        self.least = T::select(least.lt(self.least), least, self.least);
    }

    fn ratio(&self) -> T {
        if self.largest == T::ZERO { T::ONE } else { self.largest / self.least }
    }
}

/// Range of the singular values of K_d; scaled: lengths in units of the cluster's length.
fn K_d<T: Scalar>(cluster: &Cluster<T>, K: &[T], A: &mut [T], scaled: bool) -> (T, T) {
    let m = cluster.dependent.len();
    for (i, &r) in cluster.used.iter().enumerate() {
        for (a, &j) in cluster.dependent.iter().enumerate() {
            let unit = if scaled && !cluster.freedoms[j].slides() { 1.0 / cluster.length } else { 1.0 };
            A[i * m + a] = K[r * cluster.n_v + j] * T::from_f64(unit);
        }
    }
    singular_range(A, m, m)
}

/// λ from K_dᵀ λ = rest_d, the tree forces of the dependents that nothing else supplies; rows that were dropped at load carry none.
fn loop_forces<T: Scalar>(cluster: &Cluster<T>, rest: &[T], K: &[T], A: &mut [T], B: &mut [T], lambda: &mut [T]) -> Result<(), Status> {
    let m = cluster.dependent.len();
    for (a, &j) in cluster.dependent.iter().enumerate() {
        for (i, &r) in cluster.used.iter().enumerate() {
            A[a * m + i] = K[r * cluster.n_v + j];
        }
        B[a] = rest[j];
    }
    solve_pivoted(A, B, m, 1).ok_or(Status::SingularClosure)?;
    cluster.rows.iter().for_each(|row| lambda[*row] = T::ZERO);
    cluster.used.iter().enumerate().for_each(|(i, r)| lambda[cluster.rows[*r]] = B[i]);
    Ok(())
}

/// Condition of G_u over all clusters.
fn cond_Gu<T: Scalar>(model: &Model<T>, ws: &mut Workspace<T>) -> T {
    let mut range = Range::none();
    for cluster in &model.clusters {
        let (m, n_u) = (cluster.n_vy, cluster.active.len());
        if n_u == 0 || m == 0 {
            continue;
        }
        let tall = n_u >= m;
        for (r, &(_, j)) in cluster.active.iter().enumerate() {
            for k in 0..m {
                ws.dense[if tall { r * m + k } else { k * n_u + r }] = ws.G[cluster.g + j * m + k];
            }
        }
        range.add(singular_range(&mut ws.dense, n_u.max(m), n_u.min(m)));
    }
    range.ratio()
}

/// Condition of M_y.
fn cond_My<T: Scalar>(model: &Model<T>, ws: &mut Workspace<T>) -> T {
    let n = model.sizes().n_vy;
    for i in 0..n {
        for j in 0..=i {
            // the triangle is filled by internal order, which is all that matters here
            ws.dense[i * n + j] = ws.M_y[i * n + j];
            ws.dense[j * n + i] = ws.M_y[i * n + j];
        }
    }
    let (largest, least) = singular_range(&mut ws.dense, n, n);
    largest / least
}
