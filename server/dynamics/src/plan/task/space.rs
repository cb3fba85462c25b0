//! Inertia and forces of the frames of a query together: Λ, μ, p [K87: Khatib, A unified approach
//! for motion and force control of robot manipulators, IEEE Journal of Robotics and Automation 3,
//! 1987], over ẏ.

use sarrus_proto::{Field, Slot, Status};

use crate::algorithms;
use crate::linalg::{column_square, decompose, dot, factorise_tree, solve_tree};
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::run::RunReport;
use crate::scalar::{BranchValue, Real};
use crate::workspace::{Workspace, task_numbers};

/// Singular values of J M_y⁻¹ Jᵀ below this part of the largest count as zero: directions without
/// motion, and those that other frames have.
const RANK: f64 = 1e-10;
/// Ratio of the largest to the least that ordinary robots have without losing digits.
const SPREAD: f64 = 1e3;

impl Plan {
    /// Writes Λ = (J M_y⁻¹ Jᵀ)⁺, μ = Λ (J M_y⁻¹ h − J̇ ẏ), p = Λ J M_y⁻¹ g and the rank.
    /// Overwrites C_y, ÿ, τ_q and the factor of M_y.
    pub(in crate::plan) fn write_task_space<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        report: &mut RunReport<T>,
        output: &mut [T],
    ) -> Result<(), Status> {
        let n = model.sizes().n_vy;
        let rows = 6 * self.frames.len();
        let mut scratch = core::mem::take(&mut ws.task);
        let (J, rest) = scratch[..task_numbers(self.frames.len(), n)].split_at_mut(rows * n);
        let (X, rest) = rest.split_at_mut(rows * n);
        let (A, rest) = rest.split_at_mut(rows * rows);
        let (V, rest) = rest.split_at_mut(rows * rows);
        let (b, force) = rest.split_at_mut(rows);
        let written = self.task_space(model, ws, report, [J, X, A, V], [b, force], output);
        ws.task = scratch;
        written
    }

    fn task_space<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        report: &mut RunReport<T>,
        [J, X, A, V]: [&mut [T]; 4],
        [b, force]: [&mut [T]; 2],
        output: &mut [T],
    ) -> Result<(), Status> {
        let n = model.sizes().n_vy;
        let rows = 6 * self.frames.len();

        // X = J M_y⁻¹
        ws.factor.copy_from_slice(&ws.M_y);
        if !factorise_tree(&model.sparsity, &mut ws.factor) {
            return Err(Status::MassNotPositive);
        }
        for (link, J) in self.frames.iter().zip(J.chunks_exact_mut((6 * n).max(1))) {
            let frame = &model.frames[*link];
            self.independent_jacobian(model, ws, frame, J, &model.order.vy_internal);
        }
        X.copy_from_slice(J);
        X.chunks_exact_mut(n.max(1)).for_each(|row| solve_tree(&model.sparsity, &ws.factor, row));

        self.invert(report, [J, X, A, V], output);
        let inverse = &A[..rows];

        // forces at the frames: V Σ⁻¹ Vᵀ b
        let mut write = |field, b: &[T], output: &mut [T]| {
            let Some(range) = self.want.slot(field).map(Slot::range) else { return };
            for k in 0..rows {
                let along = (0..rows).fold(T::ZERO, |sum, i| V[i * rows + k].mul_add(b[i], sum));
                force[k] = along * inverse[k];
            }
            for (i, out) in output[range].iter_mut().enumerate() {
                *out = (0..rows)
                    .fold(T::ZERO, |sum, k| V[i * rows + k].mul_add(force[k], sum))
                    .plus_zero();
            }
        };
        b.fill(T::ZERO);
        let moves = !self.steps.bias_at_rest && self.wants(Field::TaskBias);
        if moves {
            algorithms::rates(model, &self.frame_bodies, &ws.qd, &ws.g, &mut ws.motion);
            for (link, b) in self.frames.iter().zip(b.chunks_exact_mut(6)) {
                let view = self.view(model);
                let rate = view.acceleration(&model.frames[*link], &ws.world, &ws.motion, true);
                b.iter_mut().zip(rate).for_each(|(b, x)| *b -= x);
            }
            self.bias_force(model, ws, &[], false);
            ws.ydd.copy_from_slice(&ws.C_y);
        }
        self.rest_bias(model, ws);
        if moves {
            // h, which loses digits beside a large weight
            let mut most = T::ZERO;
            let mut left = T::ZERO;
            for (h, g) in ws.ydd.iter_mut().zip(&ws.C_y) {
                most = most.larger(h.abs());
                *h -= *g;
                left = left.larger(h.abs());
            }
            if T::ZERO < left {
                let growth = most / left * T::from_f64(1.0 / SPREAD);
                report.doubt.times(growth.to_branch_value(BranchValue::Growth));
            }
            add_product(X, &ws.ydd, n, b);
        }
        write(Field::TaskBias, b, output);
        b.fill(T::ZERO);
        add_product(X, &ws.C_y, n, b);
        write(Field::TaskGravity, b, output);
        Ok(())
    }

    /// J M_y⁻¹ Jᵀ = V Σ Vᵀ, with Σ⁺ in the first row of A; writes Λ and the rank.
    fn invert<T: Real>(
        &self,
        report: &mut RunReport<T>,
        [J, X, A, V]: [&mut [T]; 4],
        output: &mut [T],
    ) {
        let rows = 6 * self.frames.len();
        let n = J.len() / rows.max(1);
        for i in 0..rows {
            for k in 0..rows {
                A[i * rows + k] = dot(&X[i * n..(i + 1) * n], &J[k * n..(k + 1) * n]);
            }
        }
        decompose(A, V, rows, rows);
        let sigma = |k: usize, A: &[T]| column_square(A, rows, rows, k).sqrt();
        let largest = (0..rows).fold(T::ZERO, |most: T, k| most.larger(sigma(k, A)));
        let floor = largest * T::from_f64(RANK);
        let mut rank = 0;
        let mut least = largest;
        for k in 0..rows {
            let of = sigma(k, A);
            let counts = floor < of;
            rank += usize::from(counts);
            if counts && of < least {
                least = of;
            }
            // row 0 has room for 1/σ: columns of A are not read again
            A[k] = if counts { T::ONE / of } else { T::ZERO };
        }
        if T::ZERO < least {
            let growth = largest / least * T::from_f64(1.0 / SPREAD);
            report.doubt.times(growth.to_branch_value(BranchValue::Growth));
        }
        let inverse = &A[..rows];
        let slot = |field| self.want.slot(field).map(Slot::range);
        if let Some(range) = slot(Field::TaskRank) {
            let ratio = if T::ZERO < largest { least / largest } else { T::ZERO };
            output[range].copy_from_slice(&[T::from_f64(rank as f64), ratio]);
        }
        if let Some(range) = slot(Field::TaskInertia) {
            let Lambda = &mut output[range];
            for i in 0..rows {
                for j in 0..=i {
                    let entry = (0..rows).fold(T::ZERO, |sum, k| {
                        (V[i * rows + k] * inverse[k]).mul_add(V[j * rows + k], sum)
                    });
                    Lambda[i * rows + j] = entry.plus_zero();
                    Lambda[j * rows + i] = entry.plus_zero();
                }
            }
        }
    }
}

/// b += X x.
fn add_product<T: Real>(X: &[T], x: &[T], n: usize, b: &mut [T]) {
    X.chunks_exact(n.max(1)).zip(b).for_each(|(row, b)| *b += dot(row, x));
}
