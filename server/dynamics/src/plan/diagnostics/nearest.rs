//! The nearest independents that a cluster can reach, near a closed pose and on its branch.
//!
//! ```text
//!   min ½ Σ ((y − y*) / unit)²   over φ(q) = 0
//! ```
//! by Newton's method on the closed poses: with T the null space of the scaled K and μ the
//! multipliers, Kᵀμ = −∇f,
//!
//! ```text
//!   Tᵀ (∇²f + Σ μ ∇²φ) T s = −Tᵀ ∇f        q ← project(q + T s)
//! ```
//! (Nocedal and Wright, Numerical Optimization, 18.1). Needs no independents, so it works at poses
//! where these fail.

use crate::closure::{
    assembly_branch, column_unit, constraint_residual, largest_residual, row_unit, scaled,
};
use crate::linalg::{column_square, decompose};
use crate::mechanism::{Body, Cluster};
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Steps, halvings of a step, steps of one projection.
const STEPS: usize = 60;
const HALVINGS: usize = 40;
const PROJECTIONS: usize = 40;
/// Longest step, in radians or cluster lengths.
const LONGEST: f64 = 0.2;
/// Least curvature of a step.
const CURVATURE: f64 = 1e-9;

/// One cluster, its numbers in the workspace, and the unscaled scratch that the search divides.
struct Search<'a, T> {
    cluster: &'a Cluster<T>,
    bodies: &'a [Body<T>],
    /// Number of independents, and of all columns: independents, then dependents.
    m: usize,
    n: usize,
    rows: usize,
}

/// Moves the closed pose in q to the one whose independents are nearest to those in `step_y`.
pub(in crate::plan) fn nearest_pose<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    ws: &mut Workspace<T>,
) {
    // a quaternion has no distance from y* in its own coordinates
    if cluster.independent.iter().any(|v| !cluster.dofs[*v].single) {
        return;
    }
    let m = cluster.n_vy;
    let rows = cluster.rows.len();
    let search = Search { cluster, bodies, m, n: m + cluster.dependent.len(), rows };
    search.jacobian(ws);
    let sign = assembly_branch(cluster, &mut ws.scratch);
    for _ in 0..STEPS {
        search.tangents(ws);
        if !search.newton_step(ws) || !search.advance(ws, sign) {
            return;
        }
    }
}

impl<T: Real> Search<'_, T> {
    fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        self.cluster.independent.iter().chain(&self.cluster.dependent).copied()
    }

    fn unit(&self, v: usize) -> T {
        T::from_f64(column_unit(self.cluster, v))
    }

    /// (y − y*) of an independent, scaled.
    fn miss(&self, ws: &Workspace<T>, k: usize) -> T {
        let v = self.cluster.independent[k];
        (ws.q[self.cluster.q + self.cluster.dofs[v].q] - ws.step_y[k]) / self.unit(v)
    }

    fn cost(&self, ws: &Workspace<T>) -> T {
        (0..self.m).fold(T::ZERO, |sum, k| {
            let x = self.miss(ws, k);
            x.mul_add(x, sum)
        })
    }

    /// Poses and K at q.
    fn jacobian(&self, ws: &mut Workspace<T>) {
        ws.constraint_jacobian(self.cluster, self.bodies);
    }

    /// Scaled K as U Σ in `dense` and V in `dense_rhs`, the null space first.
    fn tangents(&self, ws: &mut Workspace<T>) {
        let Search { cluster, m, n, rows, .. } = *self;
        self.jacobian(ws);
        let A = &mut ws.dense;
        let V = &mut ws.dense_rhs;
        scaled(cluster, &ws.scratch.K, 0..rows, &cluster.independent, |r, a, x| A[r * n + a] = x);
        scaled(cluster, &ws.scratch.K, 0..rows, &cluster.dependent, |r, a, x| A[r * n + m + a] = x);
        decompose(A, V, rows, n);
        for a in 0..m {
            let mut least = a;
            for b in a + 1..n {
                if column_square(A, rows, n, b) < column_square(A, rows, n, least) {
                    least = b;
                }
            }
            (0..rows).for_each(|r| A.swap(r * n + a, r * n + least));
            (0..n).for_each(|i| V.swap(i * n + a, i * n + least));
        }
    }

    /// s into the scratch's `step`, no longer than allowed; false where there is nothing left to
    /// gain.
    fn newton_step(&self, ws: &mut Workspace<T>) -> bool {
        let Search { cluster, m, n, rows, .. } = *self;
        // H, then μ and Kᵀμ against a turned pose
        let mut spare = core::mem::take(&mut ws.dense_spare);
        let (H, rest) = spare.split_at_mut(m * m);
        let (mu, rest) = rest.split_at_mut(rows);
        let (w, base) = rest.split_at_mut(n);
        mu.fill(T::ZERO);
        for b in m..n {
            let square = column_square(&ws.dense, rows, n, b);
            let along = (0..m)
                .fold(T::ZERO, |sum, k| ws.dense_rhs[k * n + b].mul_add(self.miss(ws, k), sum));
            let part = if T::ZERO.lt(square) { -(along / square) } else { T::ZERO };
            (0..rows).for_each(|r| mu[r] = ws.dense[r * n + b].mul_add(part, mu[r]));
        }
        base[..cluster.n_q].copy_from_slice(&ws.q[cluster.coordinates()]);
        let h = T::from_f64(T::EPSILON.cbrt());
        for a in 0..m {
            // curvature of the rows along one tangent
            w.fill(T::ZERO);
            for side in [T::ONE, -T::ONE] {
                self.displace(ws, base, |i, V| V[i * n + a] * h * side);
                self.jacobian(ws);
                let part = side / (h + h);
                let of = &ws.scratch.K;
                scaled(cluster, of, 0..rows, &cluster.independent, |r, i, x| {
                    w[i] = (mu[r] * part).mul_add(x, w[i])
                });
                scaled(cluster, of, 0..rows, &cluster.dependent, |r, i, x| {
                    w[m + i] = (mu[r] * part).mul_add(x, w[m + i])
                });
            }
            for b in 0..m {
                let V = &ws.dense_rhs;
                let curved = (0..n).fold(T::ZERO, |sum, i| w[i].mul_add(V[i * n + b], sum));
                H[a * m + b] =
                    (0..m).fold(curved, |sum, k| V[k * n + a].mul_add(V[k * n + b], sum));
            }
        }
        ws.q[cluster.coordinates()].copy_from_slice(&base[..cluster.n_q]);
        // a shift makes it descend
        let mut shift = T::ZERO;
        let fine = loop {
            for a in 0..m {
                for b in 0..m {
                    let x = (H[a * m + b] + H[b * m + a]) * T::from_f64(0.5);
                    ws.scratch.B[a * m + b] = if a == b { x + shift } else { x };
                }
                ws.scratch.step[a] = -(0..m)
                    .fold(T::ZERO, |sum, k| ws.dense_rhs[k * n + a].mul_add(self.miss(ws, k), sum));
            }
            if solve_positive(&mut ws.scratch.B, &mut ws.scratch.step, m) {
                break true;
            }
            shift = if shift == T::ZERO { T::from_f64(1e-4) } else { shift * T::from_f64(4.0) };
            if shift > T::from_f64(1e6) {
                break false;
            }
        };
        ws.dense_spare = spare;
        // clamped in every coordinate
        let mut size = T::ZERO;
        for i in 0..n {
            let x = (0..m)
                .fold(T::ZERO, |sum, a| ws.dense_rhs[i * n + a].mul_add(ws.scratch.step[a], sum))
                .abs();
            size = T::select_lt(size, x, x, size);
        }
        if size > T::from_f64(LONGEST) {
            (0..m).for_each(|a| ws.scratch.step[a] *= T::from_f64(LONGEST) / size);
        }
        fine && T::from_f64(16.0 * T::EPSILON) < size
    }

    /// q from `base` by a scaled change of each column.
    fn displace(&self, ws: &mut Workspace<T>, base: &[T], change: impl Fn(usize, &[T]) -> T) {
        let at = self.cluster.q..self.cluster.q + self.cluster.n_q;
        ws.q[at.clone()].copy_from_slice(&base[..self.cluster.n_q]);
        for (i, v) in self.columns().enumerate() {
            let step = change(i, &ws.dense_rhs) * self.unit(v);
            self.cluster.dofs[v].advance(&mut ws.q[at.clone()], step);
        }
    }

    /// Goes along the step, or a half, a quarter of it, to a closed pose of the same branch that is
    /// nearer; false where there is none.
    fn advance(&self, ws: &mut Workspace<T>, sign: T) -> bool {
        let Search { cluster, m, n, .. } = *self;
        let before = self.cost(ws);
        let mut spare = core::mem::take(&mut ws.dense_spare);
        let (base, step) = spare.split_at_mut(cluster.n_q);
        base.copy_from_slice(&ws.q[cluster.coordinates()]);
        step[..m].copy_from_slice(&ws.scratch.step[..m]);
        let mut part = T::ONE;
        let mut nearer = false;
        for _ in 0..HALVINGS {
            self.displace(ws, base, |i, V| {
                (0..m).fold(T::ZERO, |sum, a| V[i * n + a].mul_add(step[a] * part, sum))
            });
            if self.project(ws) && self.cost(ws) < before {
                self.jacobian(ws);
                if assembly_branch(cluster, &mut ws.scratch) == sign {
                    nearer = true;
                    break;
                }
            }
            part *= T::from_f64(0.5);
        }
        if !nearer {
            ws.q[cluster.coordinates()].copy_from_slice(base);
        }
        ws.dense_spare = spare;
        nearer
    }

    /// Steps of least norm, with the decomposition at hand, until the rows hold.
    fn project(&self, ws: &mut Workspace<T>) -> bool {
        let Search { cluster, m, n, rows, .. } = *self;
        let floor = T::from_f64(64.0 * T::EPSILON);
        let mut last = T::from_f64(f64::INFINITY);
        for _ in 0..PROJECTIONS {
            ws.local_poses(self.cluster, self.bodies);
            let of = cluster.coordinates();
            constraint_residual(cluster, &ws.scratch.pose, &ws.q[of], &mut ws.scratch.phi);
            let residual = largest_residual(cluster, &ws.scratch.phi);
            if residual < floor {
                return true;
            }
            // rounded files hold redundant rows open: then a residual remains
            if !residual.lt(last * T::from_f64(0.9)) {
                return residual < T::from_f64(T::EPSILON.sqrt());
            }
            last = residual;
            for b in m..n {
                let square = column_square(&ws.dense, rows, n, b);
                let mut along = T::ZERO;
                let all = cluster.cuts.iter().flat_map(|cut| &cut.rows).enumerate();
                for (r, row) in all {
                    let unit = T::from_f64(row_unit(cluster, row));
                    along = ws.dense[r * n + b].mul_add(ws.scratch.phi[r] * unit, along);
                }
                let along = if T::ZERO.lt(square) { along / square } else { T::ZERO };
                for (i, v) in self.columns().enumerate() {
                    let step = -(ws.dense_rhs[i * n + b] * along) * self.unit(v);
                    cluster.dofs[v].advance(&mut ws.q[cluster.coordinates()], step);
                }
            }
        }
        false
    }
}

/// Solves H x = b in place by Cholesky's factorisation; false where H is not positive definite.
fn solve_positive<T: Real>(H: &mut [T], b: &mut [T], m: usize) -> bool {
    for j in 0..m {
        let d = (0..j).fold(H[j * m + j], |d, k| (-H[j * m + k]).mul_add(H[j * m + k], d));
        if !T::from_f64(CURVATURE).lt(d) {
            return false;
        }
        let root = d.sqrt();
        H[j * m + j] = root;
        for i in j + 1..m {
            H[i * m + j] =
                (0..j).fold(H[i * m + j], |x, k| (-H[i * m + k]).mul_add(H[j * m + k], x)) / root;
        }
    }
    for i in 0..m {
        b[i] = (0..i).fold(b[i], |x, k| (-H[i * m + k]).mul_add(b[k], x)) / H[i * m + i];
    }
    for i in (0..m).rev() {
        b[i] = (i + 1..m).fold(b[i], |x, k| (-H[k * m + i]).mul_add(b[k], x)) / H[i * m + i];
    }
    true
}
