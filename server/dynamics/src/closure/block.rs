//! One block of a numerical closure: Newton's method, its inverse, G and g.

use super::rows::{CutState, refresh};
use super::{Cut, Local};
use crate::linear::solve_unpivoted;
use crate::model::{Body, Cluster, Motion};
use crate::scalar::{Mask, Real};
use crate::spatial::{Pose, dot};

/// A Newton step must be at most this fraction of the one before.
const CONTRACTION: f64 = 0.3;
/// After a step below this size the next one uses the same inverse.
const CHORD: f64 = 1e-5;
/// Least pivot of a block, or determinant against the product of its row norms.
const SINGULAR: f64 = 1e-13;

/// A smallest set of rows that determines as many joints.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Joints that the block determines.
    pub(crate) unknowns: Vec<usize>,
    /// The cuts whose rows it holds.
    pub(crate) cuts: Vec<BlockCut>,
    /// Place of each local joint among the unknowns, or `usize::MAX` (n).
    pub(crate) place: Vec<usize>,
    /// Bodies that move with the unknowns and matter to the block, in tree order.
    pub(crate) bodies: Vec<usize>,
    /// Those, and the bodies that earlier blocks moved.
    pub(crate) stale: Vec<usize>,
    /// Where its inverse lies in the scratch.
    pub(crate) offset: usize,
}

/// The rows of one cut that a block holds.
#[derive(Clone, Debug)]
pub(crate) struct BlockCut {
    /// Index of the cut and of its first row among the cluster's rows.
    pub(crate) cut: usize,
    pub(crate) first_row: usize,
    /// (row of the cut, row of the block).
    pub(crate) rows: Vec<(usize, usize)>,
    /// True when a joint of an earlier block lies on the cut's path.
    pub(crate) follows: bool,
}

impl Block {
    /// Newton's method for the block's unknowns; poses before the block are closed, its own are fresh before and after.
    #[inline]
    pub(super) fn newton<T: Real>(
        &self,
        cluster: &Cluster<T::Const>,
        bodies: &[Body<T::Const>],
        local: &mut Local<'_, T>,
        trust: f64,
        steps: u32,
    ) -> (T::Mask, u32) {
        let m = self.unknowns.len();
        let converged = T::from_f64(0.1 * T::EPSILON.sqrt());
        let floor = T::from_f64(8.0 * T::EPSILON * cluster.length);
        let (mut good, mut done) = (T::Mask::splat(true), T::Mask::splat(false));
        let mut previous = T::from_f64(trust / CONTRACTION);
        let mut first_det = T::ZERO;
        let mut taken = 0;
        for k in 0..steps {
            // residual, and unless the last step was tiny the inverse
            let fresh = k == 0 || !previous.lt(T::from_f64(CHORD)).all();
            let residual = self.evaluate(&cluster.cuts, bodies, local, fresh);
            if fresh {
                let (fine, det) = self.invert(local);
                let same_branch = T::ZERO.lt(det * T::select(T::Mask::splat(k == 0), det, first_det));
                first_det = det;
                good = good & (done | (fine & same_branch));
            }
            // step, in radians or cluster lengths
            let mut size = T::ZERO;
            let inverse = &local.scratch.inverse[self.offset..self.offset + m * m];
            for (i, &j) in self.unknowns.iter().enumerate() {
                let mut step = T::ZERO;
                for r in 0..m {
                    step = inverse[i * m + r].mul_add(local.scratch.phi[r], step);
                }
                local.q[j] -= T::select(done, T::ZERO, step);
                let scale = if bodies[j].motion == Motion::Prismatic { 1.0 / cluster.length } else { 1.0 };
                let scaled = step.abs() * T::from_f64(scale);
                size = T::select(size.lt(scaled), scaled, size);
            }
            taken += 1;
            let at_floor = size.lt(converged) | residual.lt(floor);
            good = good & (done | at_floor | size.lt(previous * T::from_f64(CONTRACTION)));
            done = done | at_floor;
            previous = size;
            for &j in &self.bodies {
                refresh(cluster, bodies, j, local.q, local.turn, &mut local.scratch.pose);
            }
            if done.all() {
                break;
            }
        }
        (good & done, taken)
    }

    /// φ into the scratch and, if wanted, K of the unknowns; returns the largest |φ|.
    #[inline]
    fn evaluate<T: Real>(&self, cuts: &[Cut<T::Const>], bodies: &[Body<T::Const>], local: &mut Local<'_, T>, jacobian: bool) -> T {
        let m = self.unknowns.len();
        let scratch = &mut *local.scratch;
        let mut largest = T::ZERO;
        if jacobian {
            scratch.A[..m * m].fill(T::ZERO);
        }
        for of in &self.cuts {
            let cut = &cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            for &(r, i) in &of.rows {
                let value = state.value(&cut.rows[r], local.q);
                scratch.phi[i] = value;
                largest = T::select(largest.lt(value.abs()), value.abs(), largest);
            }
            if jacobian {
                self.columns(cut, of, &state, bodies, &scratch.pose, |i, j, value| {
                    if self.place[j] != usize::MAX {
                        scratch.A[i * m + self.place[j]] = value;
                    }
                });
            }
        }
        largest
    }

    /// Calls `each(row of the block, joint, entry of K)` for every entry of the block's rows.
    #[inline(always)]
    fn columns<T: Real>(
        &self,
        cut: &Cut<T::Const>,
        of: &BlockCut,
        state: &CutState<T>,
        bodies: &[Body<T::Const>],
        pose: &[Pose<T>],
        mut each: impl FnMut(usize, usize, T),
    ) {
        for &(r, i) in &of.rows {
            let row = &cut.rows[r];
            if row.terms.is_empty() {
                let (linear, angular) = state.directions(cut, row);
                for &(j, on_successor) in &cut.path {
                    let (w, v) = state.twist(&bodies[j], &pose[j + 1], on_successor);
                    let entry = dot(&linear, &v);
                    each(i, j, if cut.angular { entry + dot(&angular, &w) } else { entry });
                }
            }
            for (j, c) in &row.terms {
                each(i, *j, T::lift(*c));
            }
        }
    }

    /// Inverse of A into the scratch: closed form up to 3×3, elimination in the order fixed at load beyond. Returns where it is sound,
    /// and the determinant.
    #[inline]
    fn invert<T: Real>(&self, local: &mut Local<'_, T>) -> (T::Mask, T) {
        let m = self.unknowns.len();
        let A = &mut local.scratch.A;
        let inverse = &mut local.scratch.inverse[self.offset..self.offset + m * m];
        match m {
            1 => {
                inverse[0] = T::ONE / A[0];
                (T::ZERO.lt(A[0].abs()), A[0])
            }
            2 => {
                let det = A[0].mul_add(A[3], -(A[1] * A[2]));
                let d = T::ONE / det;
                (inverse[0], inverse[1], inverse[2], inverse[3]) = (A[3] * d, -(A[1] * d), -(A[2] * d), A[0] * d);
                (sound(A, 2, det), det)
            }
            3 => {
                let minor = |a: usize, b: usize, c: usize, d: usize, A: &[T]| A[a].mul_add(A[d], -(A[b] * A[c]));
                let (c0, c1, c2) = (minor(4, 5, 7, 8, A), minor(5, 3, 8, 6, A), minor(3, 4, 6, 7, A));
                let det = A[0].mul_add(c0, A[1].mul_add(c1, A[2] * c2));
                let d = T::ONE / det;
                let adjugate = [
                    c0,
                    minor(2, 1, 8, 7, A),
                    minor(1, 2, 4, 5, A),
                    c1,
                    minor(0, 2, 6, 8, A),
                    minor(2, 0, 5, 3, A),
                    c2,
                    minor(1, 0, 7, 6, A),
                    minor(0, 1, 3, 4, A),
                ];
                for (x, y) in inverse.iter_mut().zip(adjugate) {
                    *x = y * d;
                }
                (sound(A, 3, det), det)
            }
            _ => {
                for (k, x) in inverse.iter_mut().enumerate() {
                    *x = if k / m == k % m { T::ONE } else { T::ZERO };
                }
                solve_unpivoted(A, inverse, m, m, SINGULAR)
            }
        }
    }

    /// The block's rows of G at the closed pose: G_d = −K_d⁻¹ K_i, with the joints of earlier blocks on the right-hand side.
    #[inline]
    pub(super) fn jacobian<T: Real>(
        &self,
        n_vy: usize,
        cuts: &[Cut<T::Const>],
        bodies: &[Body<T::Const>],
        local: &mut Local<'_, T>,
    ) -> T::Mask {
        let m = self.unknowns.len();
        local.scratch.A[..m * m].fill(T::ZERO);
        local.scratch.B[..m * n_vy].fill(T::ZERO);
        let scratch = &mut *local.scratch;
        let G = &mut *local.G;
        for of in &self.cuts {
            let cut = &cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            self.columns(cut, of, &state, bodies, &scratch.pose, |i, j, value| {
                if self.place[j] != usize::MAX {
                    scratch.A[i * m + self.place[j]] = value;
                } else {
                    for k in 0..n_vy {
                        scratch.B[i * n_vy + k] = value.mul_add(G[j * n_vy + k], scratch.B[i * n_vy + k]);
                    }
                }
            });
        }
        let (good, _) = self.invert(local);
        for (i, &j) in self.unknowns.iter().enumerate() {
            for k in 0..n_vy {
                let mut x = T::ZERO;
                for r in 0..m {
                    x = local.scratch.inverse[self.offset + i * m + r].mul_add(local.scratch.B[r * n_vy + k], x);
                }
                local.G[j * n_vy + k] = -x;
            }
        }
        good
    }

    /// The block's rows of g from k in `scratch.phi` and the inverse that [`Block::jacobian`] left.
    #[inline]
    pub(super) fn bias<T: Real>(&self, cuts: &[Cut<T::Const>], bodies: &[Body<T::Const>], local: &mut Local<'_, T>) {
        let m = self.unknowns.len();
        let scratch = &mut *local.scratch;
        let g = &mut *local.g;
        for of in &self.cuts {
            let cut = &cuts[of.cut];
            for &(r, i) in &of.rows {
                scratch.B[i] = scratch.phi[of.first_row + r];
            }
            // joints of earlier blocks accelerate by their own g
            if of.follows {
                let state = CutState::new(cut, &scratch.pose);
                self.columns(cut, of, &state, bodies, &scratch.pose, |i, j, value| {
                    if self.place[j] == usize::MAX {
                        scratch.B[i] = (-value).mul_add(g[j], scratch.B[i]);
                    }
                });
            }
        }
        for (i, &j) in self.unknowns.iter().enumerate() {
            let mut x = T::ZERO;
            for r in 0..m {
                x = scratch.inverse[self.offset + i * m + r].mul_add(scratch.B[r], x);
            }
            g[j] = x;
        }
    }
}

/// |det| against the product of the row norms.
#[inline]
fn sound<T: Real>(A: &[T], m: usize, det: T) -> T::Mask {
    let mut squares = T::ONE;
    for row in A[..m * m].chunks_exact(m) {
        squares *= row.iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum));
    }
    (squares * T::from_f64(SINGULAR * SINGULAR)).lt(det * det)
}
