//! The inverse of a wide block by elimination in an order fixed at load that keeps its zeros.
//!
//! Rows and columns of a block have that order, so that pivots lie on the diagonal; the fill-in is
//! known. At load each pivot was at least a fraction of the largest entry of its column. If a
//! multiplier is large at another pose, entries could grow, and the block is inverted again with
//! the largest pivots of that pose.

use crate::closure::numerical::inverse::{Inverted, least_pivot};
use crate::linalg::{eliminate, exchange, substitute_back};
use crate::scalar::Real;

/// Largest multiplier of the elimination.
const GROWTH: f64 = 16.0;

/// The sparsity pattern of a block.
#[derive(Clone, Debug)]
pub(crate) struct Elimination {
    /// For each pivot the rows below it and the columns to the right of it with an entry at that
    /// step.
    pub(crate) below: Vec<Vec<usize>>,
    pub(crate) right: Vec<Vec<usize>>,
    /// Poses where the order is bad are left to others.
    pub(crate) is_fixed: bool,
}

impl Elimination {
    /// Operations of an inversion in order.
    pub(super) fn operations(&self) -> usize {
        let m = self.below.len();
        let pivots = self.below.iter().zip(&self.right).enumerate();
        let of = |(k, (below, right)): (usize, (&Vec<usize>, &Vec<usize>))| {
            below.len() * (right.len() + k + 1) + (right.len() + 1) * m
        };
        pivots.map(of).sum()
    }

    /// Inverse of A (m × m), which is destroyed; `spare` has room for a copy.
    pub(super) fn invert<T: Real>(
        &self,
        A: &mut [T],
        inverse: &mut [T],
        spare: &mut [T],
    ) -> Inverted<T> {
        let m = self.below.len();
        spare[..m * m].copy_from_slice(A);
        // recorded operations have the largest pivots of every pose
        let is_pivoted = T::RECORDED && !self.is_fixed;
        let in_order = (!is_pivoted).then(|| self.in_order(A, inverse, m));
        let (sound, det) = in_order
            .filter(|(sound, _)| *sound || self.is_fixed)
            .unwrap_or_else(|| Elimination::pivoted(A, inverse, spare, m));
        Inverted { sound, accurate: true, near: T::ONE, gain: T::ONE, det }
    }

    /// L U without the structural zeros, then the inverse row by row.
    fn in_order<T: Real>(&self, A: &mut [T], inverse: &mut [T], m: usize) -> (bool, T) {
        let floor = T::from_f64(least_pivot::<T>());
        let growth = T::from_f64(GROWTH);
        let mut good = true;
        let mut det = T::ONE;
        inverse.fill(T::ZERO);
        for k in 0..m {
            inverse[k * m + k] = T::ONE;
        }
        for (k, (below, right)) in self.below.iter().zip(&self.right).enumerate() {
            let (done, rest) = A.split_at_mut((k + 1) * m);
            let (of_unit, below_unit) = inverse.split_at_mut((k + 1) * m);
            let row = &mut done[k * m..];
            let pivot = row[k];
            let largest = right.iter().fold(pivot.abs(), |x, j| T::larger(x, row[*j].abs()));
            good &= (largest * floor).lt(pivot.abs());
            det *= pivot;
            let reciprocal = T::ONE / pivot;
            for &i in below {
                let at = (i - k - 1) * m;
                let other = &mut rest[at..at + m];
                let l = -(other[k] * reciprocal);
                good &= l.abs().lt(growth);
                for &j in right {
                    other[j] = l.mul_add(row[j], other[j]);
                }
                // the inverse of L is a lower triangle too
                add_scaled(&mut below_unit[at..at + m], &of_unit[k * m..], l, k);
            }
            row[k] = reciprocal;
        }
        for (k, right) in self.right.iter().enumerate().rev() {
            let (before, after) = inverse.split_at_mut((k + 1) * m);
            let row = &mut before[k * m..];
            let of_row = &A[k * m..(k + 1) * m];
            match m {
                0..8 => {
                    for &j in right {
                        let u = -of_row[j];
                        let other = &after[(j - k - 1) * m..(j - k) * m];
                        row.iter_mut().zip(other).for_each(|(x, y)| *x = u.mul_add(*y, *x));
                    }
                    row.iter_mut().for_each(|x| *x *= of_row[k]);
                }
                8..12 => substitute::<T, 8>(row, of_row, after, k, right),
                _ => substitute::<T, 12>(row, of_row, after, k, right),
            }
        }
        (good, det)
    }

    /// The inverse of the matrix in `spare`, each pivot the largest entry of its column.
    #[cold]
    #[inline(never)]
    fn pivoted<T: Real>(A: &mut [T], inverse: &mut [T], spare: &[T], m: usize) -> (bool, T) {
        A.copy_from_slice(&spare[..m * m]);
        inverse.fill(T::ZERO);
        (0..m).for_each(|k| inverse[k * m + k] = T::ONE);
        let mut good = true;
        let mut det = T::ONE;
        for k in 0..m {
            det *= exchange(A, inverse, m, m, k);
            let pivot = A[k * m + k];
            let largest = (k..m).fold(T::ZERO, |x, j| T::larger(x, A[k * m + j].abs()));
            good &= (largest * T::from_f64(least_pivot::<T>())).lt(pivot.abs());
            det *= pivot;
            eliminate(A, inverse, m, m, k);
        }
        substitute_back(A, inverse, m, m);
        (good, det)
    }
}

/// Row k of the inverse from the rows `after` it; `of_row` is the row of the upper triangle, with
/// the inverse of its pivot.
#[inline(always)]
fn substitute<T: Real, const W: usize>(
    row: &mut [T],
    of_row: &[T],
    after: &[T],
    k: usize,
    right: &[usize],
) {
    let m = row.len();
    // the last strip may overlap that before it
    let last = strip::<T, W>(row, of_row, after, k, right, m - W);
    for at in (0..m - W).step_by(W) {
        let x = strip::<T, W>(row, of_row, after, k, right, at);
        row[at..at + W].copy_from_slice(&x);
    }
    row[m - W..].copy_from_slice(&last);
}

/// W columns of it.
#[inline(always)]
fn strip<T: Real, const W: usize>(
    row: &[T],
    of_row: &[T],
    after: &[T],
    k: usize,
    right: &[usize],
    at: usize,
) -> [T; W] {
    let m = row.len();
    let mut x = [T::ZERO; W];
    x.copy_from_slice(&row[at..at + W]);
    for &j in right {
        let u = -of_row[j];
        if let Some(other) = after[(j - k - 1) * m + at..].first_chunk::<W>() {
            for c in 0..W {
                x[c] = u.mul_add(other[c], x[c]);
            }
        }
    }
    x.map(|x| x * of_row[k])
}

/// x += l y in the columns up to k; those beyond it are zero in y.
#[inline(always)]
fn add_scaled<T: Real>(x: &mut [T], y: &[T], l: T, k: usize) {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks_mut::<4>(), y.as_chunks::<4>());
    let is_in_rest = k >= 4 * x.len();
    for (x, y) in x.iter_mut().zip(y).take(k / 4 + 1) {
        *x = core::array::from_fn(|c| l.mul_add(y[c], x[c]));
    }
    if is_in_rest {
        x_rest.iter_mut().zip(y_rest).for_each(|(x, y)| *x = l.mul_add(*y, *x));
    }
}
