//! Rare outputs about the loops of a closed state: K and k, residual, conditions,
//! loop-closure forces.

use sarrus_proto::{Field, Status};

use crate::closure;
use crate::closure::{
    Scratch, column_unit, constraint_jacobian, constraint_residual, declared, declared_forces,
    dependents_range, force_bias, force_jacobian, largest_residual, local_rates, row_unit, rows_at,
    scaled,
};
use crate::linalg::{column_square, decompose, singular_range, solve_pivoted};
use crate::mechanism::{Cluster, CutRow};
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::diagnostics::singular;
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Component of a row's unit vector in the null space of K_dᵀ above which redundant rows share its
/// reaction; the same bound decides rank at load.
const SHARED: f64 = 1e-4;

impl Plan {
    /// Evaluates the rows of every closed cluster at the closed state; writes K, k, λ, residual,
    /// condition numbers and distance to singularity.
    pub(in crate::plan) fn write_conditions<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        output: &mut [T],
    ) -> Result<(), Status> {
        let slot = |field| self.want().slot(field).map(|slot| slot.range());
        if let Some(range) = slot(Field::K) {
            output[range].fill(T::ZERO);
        }
        if let Some(range) = slot(Field::GoodIndependents) {
            singular::declared_independents(model, &mut output[range]);
        }
        let mut residual = T::ZERO;
        let mut unscaled = Range::none();
        let mut scaled = Range::none();
        for &c in &model.closed_clusters {
            let cluster = &model.clusters[c];
            ws.local_poses(cluster, model.bodies_of(cluster));
            let scratch = &mut ws.scratch;
            let q = &ws.q[cluster.coordinates()];
            constraint_residual(cluster, &scratch.pose, q, &mut scratch.phi);
            let of_cluster = largest_residual(cluster, &scratch.phi);
            residual = T::select_lt(residual, of_cluster, of_cluster, residual);
            force_jacobian(cluster, &scratch.pose, q, &mut scratch.K);
            self.write_rows(model, cluster, ws, output);
            let scratch = &mut ws.scratch;
            let q = &ws.q[cluster.coordinates()];
            if let Some(range) = slot(Field::Lambda) {
                let rest = &ws.loop_q[cluster.velocities()];
                loop_forces(cluster, rest, scratch, &mut output[range])?;
            }
            if let Some(range) = slot(Field::LambdaDeterminate) {
                determinate_forces(cluster, scratch, &mut output[range]);
            }
            // the rest is about φ
            if cluster.cuts.iter().any(|cut| cut.angular) {
                constraint_jacobian(cluster, &scratch.pose, q, &mut scratch.K);
            }
            if self.wants_any(&[Field::CondKd, Field::SigmaMin]) {
                unscaled.add(K_d(cluster, scratch));
                scaled.add(dependents_range(cluster, scratch));
            }
            let place = model.order.branches.iter().position(|branch| *branch == c);
            if let Some((range, place)) = slot(Field::Branch).zip(place) {
                output[range.start + place] = closure::assembly_branch(cluster, scratch);
            }
            if let Some(range) = slot(Field::GoodIndependents) {
                // if this finds none, the declared ones remain, which did close the loop
                let dense = (ws.dense.as_mut_slice(), ws.dense_rhs.as_mut_slice());
                singular::good_independents(model, cluster, &scratch.K, dense, &mut output[range]);
            }
        }
        if let Some(range) = slot(Field::Uncontrolled) {
            singular::uncontrolled(model, ws, model.closed_clusters.len(), &mut output[range]);
        }
        let sigma_min = if model.closed_clusters.is_empty() { T::ONE } else { scaled.least };
        self.write_figure(Field::Residual, residual, output);
        self.write_figure(Field::CondKd, unscaled.ratio(), output);
        self.write_figure(Field::SigmaMin, sigma_min, output);
        if self.wants(Field::CondGu) {
            self.write_figure(Field::CondGu, cond_Gu(model, ws), output);
        }
        if self.wants(Field::CondMy) {
            self.write_figure(Field::CondMy, cond_My(model, ws), output);
        }
        Ok(())
    }

    /// Writes K and k of one cluster to the output.
    fn write_rows<T: Real>(
        &self,
        model: &Model<T>,
        cluster: &Cluster<T>,
        ws: &mut Workspace<T>,
        output: &mut [T],
    ) {
        let scratch = &mut ws.scratch;
        if let Some(slot) = self.want().slot(Field::K) {
            let K = &mut output[slot.range()];
            for (r, (row, of)) in rows(cluster).enumerate() {
                for j in 0..cluster.n_v {
                    let column = model.order.v_external[cluster.v + j];
                    let x = declared(of, r, |r| scratch.K[r * cluster.n_v + j]);
                    K[row * model.sizes().n_v + column] = x;
                }
            }
        }
        if let Some(slot) = self.want().slot(Field::KBias) {
            let bodies = model.bodies_of(cluster);
            let qd = &ws.qd[cluster.velocities()];
            local_rates(cluster, bodies, qd, &scratch.pose, &mut scratch.rate);
            let rates = (&ws.q[cluster.coordinates()], qd, &scratch.rate[..]);
            force_bias(cluster, &scratch.pose, rates, &mut scratch.phi);
            let k = &mut output[slot.range()];
            for (r, (row, of)) in rows(cluster).enumerate() {
                k[row] = declared(of, r, |r| scratch.phi[r]);
            }
        }
    }
}

/// Each local row with its external index.
fn rows<T>(cluster: &Cluster<T>) -> impl Iterator<Item = (usize, &CutRow<T>)> {
    cluster.rows.iter().copied().zip(cluster.cuts.iter().flat_map(|cut| &cut.rows))
}

/// The largest and least of several ranges of singular values.
struct Range<T> {
    largest: T,
    least: T,
}

impl<T: Real> Range<T> {
    fn none() -> Range<T> {
        Range { largest: T::ZERO, least: T::from_f64(f64::INFINITY) }
    }

    fn add(&mut self, (largest, least): (T, T)) {
        self.largest = T::select_lt(self.largest, largest, largest, self.largest);
        self.least = T::select_lt(least, self.least, least, self.least);
    }

    fn ratio(&self) -> T {
        if self.largest == T::ZERO { T::ONE } else { self.largest / self.least }
    }
}

/// Range of the singular values of K_d in the units of the model.
fn K_d<T: Real>(cluster: &Cluster<T>, scratch: &mut Scratch<T>) -> (T, T) {
    let m = cluster.dependent.len();
    let used = rows_at(cluster, scratch, f64::INFINITY);
    let Scratch { K, A, .. } = scratch;
    for (i, &r) in used.iter().enumerate() {
        let Some((_, of)) = rows(cluster).nth(r) else { continue };
        for (a, &j) in cluster.dependent.iter().enumerate() {
            A[i * m + a] = declared(of, r, |r| K[r * cluster.n_v + j]);
        }
    }
    singular_range(A, m, m)
}

/// λ from K_dᵀ λ = rest_d, the tree forces of the dependents that nothing else supplies. Where rows
/// are redundant λ is the one of least norm in the scaling: with K_d = U Σ Vᵀ scaled, λ_s = U Σ⁻¹
/// Vᵀ rest.
fn loop_forces<T: Real>(
    cluster: &Cluster<T>,
    rest: &[T],
    scratch: &mut Scratch<T>,
    lambda: &mut [T],
) -> Result<(), Status> {
    let m = cluster.dependent.len();
    let n_rows = cluster.rows.len();
    if n_rows == m {
        for (a, &j) in cluster.dependent.iter().enumerate() {
            for r in 0..m {
                scratch.A[a * m + r] = scratch.K[r * cluster.n_v + j];
            }
            scratch.B[a] = rest[j];
        }
        solve_pivoted(&mut scratch.A, &mut scratch.B, m, 1).ok_or(Status::SingularClosure)?;
        declared_forces(cluster, &mut scratch.B, lambda);
        return Ok(());
    }
    decompose_dependents(cluster, scratch);
    let A = &scratch.A;
    let V = &scratch.B;
    // Σ⁻² Vᵀ rest
    for a in 0..m {
        let along = cluster.dependent.iter().enumerate().fold(T::ZERO, |sum, (b, &j)| {
            let unit = T::from_f64(column_unit(cluster, j));
            (V[b * m + a] * unit).mul_add(rest[j], sum)
        });
        let square = column_square(A, n_rows, m, a);
        if !T::ZERO.lt(square) {
            return Err(Status::SingularClosure);
        }
        scratch.step[a] = along / square;
    }
    for (r, (_, of)) in rows(cluster).enumerate() {
        let x = (0..m).fold(T::ZERO, |sum, a| A[r * m + a].mul_add(scratch.step[a], sum));
        scratch.phi[r] = x * T::from_f64(row_unit(cluster, of));
    }
    declared_forces(cluster, &mut scratch.phi, lambda);
    Ok(())
}

/// 1 for each row whose λ every solution of K_dᵀ λ = rest_d shares: its unit vector lies in the
/// range of K_d.
fn determinate_forces<T: Real>(
    cluster: &Cluster<T>,
    scratch: &mut Scratch<T>,
    determinate: &mut [T],
) {
    let m = cluster.dependent.len();
    let rows = cluster.rows.len();
    if rows == m {
        return cluster.rows.iter().for_each(|row| determinate[*row] = T::ONE);
    }
    decompose_dependents(cluster, scratch);
    for (r, row) in cluster.rows.iter().enumerate() {
        let inside = (0..m).fold(T::ZERO, |sum, a| {
            let x = scratch.A[r * m + a];
            sum + x * x / column_square(&scratch.A, rows, m, a)
        });
        let shared = T::from_f64(SHARED * SHARED).lt(T::ONE - inside);
        determinate[*row] = if shared { T::ZERO } else { T::ONE };
    }
    // a row against which others lean has the reaction that they leave it
    let mut r = rows;
    for of in cluster.cuts.iter().flat_map(|cut| &cut.rows).rev() {
        r -= 1;
        let own = determinate[cluster.rows[r]];
        for (back, _) in of.leans.iter().filter(|(_, part)| *part != T::ZERO) {
            let against = &mut determinate[cluster.rows[r - back]];
            *against *= own;
        }
    }
}

/// The scaled K_d of all rows as U Σ in `A` and V in `B`.
fn decompose_dependents<T: Real>(cluster: &Cluster<T>, scratch: &mut Scratch<T>) {
    let m = cluster.dependent.len();
    let rows = cluster.rows.len();
    let A = &mut scratch.A;
    scaled(cluster, &scratch.K, 0..rows, &cluster.dependent, |r, a, x| A[r * m + a] = x);
    decompose(&mut scratch.A, &mut scratch.B, rows, m);
}

/// Condition of G_u over all clusters.
fn cond_Gu<T: Real>(model: &Model<T>, ws: &mut Workspace<T>) -> T {
    let mut range = Range::none();
    for cluster in &model.clusters {
        let m = cluster.n_vy;
        let n_u = cluster.active.len();
        if n_u == 0 || m == 0 {
            continue;
        }
        let tall = n_u >= m;
        let G = cluster.G(&ws.G);
        for (r, &(_, j)) in cluster.active.iter().enumerate() {
            for k in 0..m {
                ws.dense[if tall { r * m + k } else { k * n_u + r }] = G[(j, k)];
            }
        }
        range.add(singular_range(&mut ws.dense, n_u.max(m), n_u.min(m)));
    }
    range.ratio()
}

/// Condition of M_y.
fn cond_My<T: Real>(model: &Model<T>, ws: &mut Workspace<T>) -> T {
    let n = model.sizes().n_vy;
    for i in 0..n {
        for j in 0..=i {
            // internal order, as the order does not matter here
            let entry = model.sparsity.entry(i, j).map_or(T::ZERO, |at| ws.M_y[at]);
            (ws.dense[i * n + j], ws.dense[j * n + i]) = (entry, entry);
        }
    }
    let (largest, least) = singular_range(&mut ws.dense, n, n);
    largest / least
}
