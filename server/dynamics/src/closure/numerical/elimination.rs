//! The inverse of a wide block by elimination in an order fixed at load that keeps its zeros.
//!
//! Rows and columns of a block stand in that order, so that pivots lie on the diagonal; what fills
//! in is known. At load each pivot was at least a part of the largest entry of its column. Where a
//! multiplier is large at some other pose, entries could grow, and the block is inverted once more
//! with the largest pivots of that pose.

use crate::closure::numerical::inverse::{Inverted, least_pivot};
use crate::linalg::{eliminate, substitute_back};
use crate::scalar::{Mask, Real};

/// Largest multiplier of the elimination.
const GROWTH: f64 = 16.0;

/// Where entries of a block can be.
#[derive(Clone, Debug)]
pub(crate) struct Elimination {
    /// For each pivot the rows below and the columns to the right of it that have an entry when its
    /// turn comes.
    pub(crate) below: Vec<Vec<usize>>,
    pub(crate) right: Vec<Vec<usize>>,
}

impl Elimination {
    /// Inverse of A (m × m), which is destroyed; `spare` has room for another one.
    pub(super) fn invert<T: Real>(
        &self,
        A: &mut [T],
        inverse: &mut [T],
        spare: &mut [T],
    ) -> Inverted<T> {
        let m = self.below.len();
        spare[..m * m].copy_from_slice(A);
        let (sound, det) = self.in_order(A, inverse, m);
        let (sound, det) =
            if sound.all() { (sound, det) } else { Elimination::pivoted(A, inverse, spare, m) };
        Inverted { sound, accurate: T::Mask::splat(true), gain: T::ONE, det }
    }

    /// L U with what is zero left out, then the inverse row by row.
    fn in_order<T: Real>(&self, A: &mut [T], inverse: &mut [T], m: usize) -> (T::Mask, T) {
        let (floor, growth) = (T::from_f64(least_pivot::<T>()), T::from_f64(GROWTH));
        let larger = |a: T, b: T| T::select_lt(a, b, b, a);
        let mut good = T::Mask::splat(true);
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
            let largest = right.iter().fold(pivot.abs(), |x, j| larger(x, row[*j].abs()));
            good = good & (largest * floor).lt(pivot.abs());
            det *= pivot;
            let reciprocal = T::ONE / pivot;
            for &i in below {
                let at = (i - k - 1) * m;
                let other = &mut rest[at..at + m];
                let l = -(other[k] * reciprocal);
                good = good & l.abs().lt(growth);
                for &j in right {
                    other[j] = l.mul_add(row[j], other[j]);
                }
                // the inverse of L is a lower triangle too
                let other = &mut below_unit[at..=at + k];
                for (x, of_pivot) in other.iter_mut().zip(&of_unit[k * m..]) {
                    *x = l.mul_add(*of_pivot, *x);
                }
            }
            row[k] = reciprocal;
        }
        for (k, right) in self.right.iter().enumerate().rev() {
            let (before, after) = inverse.split_at_mut((k + 1) * m);
            let row = &mut before[k * m..];
            for &j in right {
                let u = -A[k * m + j];
                let other = &after[(j - k - 1) * m..(j - k) * m];
                for (x, other) in row.iter_mut().zip(other) {
                    *x = u.mul_add(*other, *x);
                }
            }
            let reciprocal = A[k * m + k];
            row.iter_mut().for_each(|x| *x *= reciprocal);
        }
        (good, det)
    }

    /// The inverse of the matrix in `spare`, each pivot the largest entry of its column.
    #[cold]
    #[inline(never)]
    fn pivoted<T: Real>(A: &mut [T], inverse: &mut [T], spare: &[T], m: usize) -> (T::Mask, T) {
        A.copy_from_slice(&spare[..m * m]);
        inverse.fill(T::ZERO);
        (0..m).for_each(|k| inverse[k * m + k] = T::ONE);
        let (mut good, mut det) = (T::Mask::splat(true), T::ONE);
        let larger = |a: T, b: T| T::select_lt(a, b, b, a);
        for k in 0..m {
            let mut p = k;
            for i in k + 1..m {
                if A[p * m + k].abs().lt(A[i * m + k].abs()).all() {
                    p = i;
                }
            }
            if p != k {
                for j in 0..m {
                    A.swap(k * m + j, p * m + j);
                    inverse.swap(k * m + j, p * m + j);
                }
                det = -det;
            }
            let pivot = A[k * m + k];
            let largest = (k..m).fold(T::ZERO, |x, j| larger(x, A[k * m + j].abs()));
            good = good & (largest * T::from_f64(least_pivot::<T>())).lt(pivot.abs());
            det *= pivot;
            eliminate(A, inverse, m, m, k);
        }
        substitute_back(A, inverse, m, m);
        (good, det)
    }
}
