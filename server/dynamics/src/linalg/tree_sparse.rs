//! Symmetric matrices in which row i is zero left of the diagonal except at the ancestors of i,
//! packed, and H = Lᵀ D L without fill-in [F08, 6.4 and 6.5].
//!
//! Row i holds the entries at its ancestors, from the root on, and then its diagonal. The path to
//! an ancestor is a prefix of the path to i, so the ancestor's row has its numbers at the same
//! offsets: rows are combined without indices.

use crate::scalar::Real;

/// The ancestors of each index, and the offsets of the rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct TreeSparsity {
    /// Nearest ancestor of each index, or `usize::MAX`.
    pub(crate) parent: Vec<usize>,
    /// Number of ancestors of each index.
    pub(crate) depth: Vec<usize>,
    /// First number of each row.
    pub(crate) start: Vec<usize>,
    /// Numbers in all rows.
    pub(crate) len: usize,
}

impl TreeSparsity {
    /// Appends an index below an earlier one, or a root.
    pub(crate) fn push(&mut self, parent: usize) {
        let depth = self.depth.get(parent).map_or(0, |depth| depth + 1);
        self.parent.push(parent);
        self.depth.push(depth);
        self.start.push(self.len);
        self.len += depth + 1;
    }

    /// Offset of each diagonal entry.
    pub(crate) fn diagonal(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.start.len()).map(|i| self.diagonal_at(i))
    }

    /// Offset of the diagonal entry of row i.
    pub(crate) fn diagonal_at(&self, i: usize) -> usize {
        self.start[i] + self.depth[i]
    }

    /// Place of the entry (i, j), if it is not zero by structure.
    pub(crate) fn entry(&self, i: usize, j: usize) -> Option<usize> {
        let mut low = i.max(j);
        let high = i.min(j);
        let row = self.start[low];
        while low != high && low != usize::MAX && self.depth[low] > self.depth[high] {
            low = self.parent[low];
        }
        (low == high).then(|| row + self.depth[high])
    }
}

/// Factorises H = Lᵀ D L in place: the rows then hold L and 1/D. True if every D is
/// positive.
#[inline]
pub(crate) fn factorise_tree<T: Real>(sparsity: &TreeSparsity, H: &mut [T]) -> bool {
    let TreeSparsity { parent, depth, start, .. } = sparsity;
    let mut positive = true;
    for k in (0..parent.len()).rev() {
        let (before, row) = H.split_at_mut(start[k]);
        let (row, diagonal) = row[..=depth[k]].split_at_mut(depth[k]);
        positive &= T::ZERO.lt(diagonal[0]);
        let inverse = T::ONE / diagonal[0];
        diagonal[0] = inverse;
        let mut i = parent[k];
        for a in (0..row.len()).rev() {
            // H_ij −= L_ki H_kj
            let l = row[a] * inverse;
            for (x, y) in before[start[i]..=start[i] + a].iter_mut().zip(&row[..=a]) {
                *x = (-l).mul_add(*y, *x);
            }
            row[a] = l;
            i = parent[i];
        }
    }
    positive
}

/// Solves Lᵀ D L x = b in place after [`factorise_tree`].
#[inline]
pub(crate) fn solve_tree<T: Real>(sparsity: &TreeSparsity, L: &[T], x: &mut [T]) {
    let TreeSparsity { parent, depth, start, .. } = sparsity;
    for k in (0..parent.len()).rev() {
        let xk = x[k];
        let mut i = parent[k];
        for l in L[start[k]..start[k] + depth[k]].iter().rev() {
            x[i] = (-*l).mul_add(xk, x[i]);
            i = parent[i];
        }
    }
    for k in 0..parent.len() {
        let mut xk = x[k] * L[start[k] + depth[k]];
        let mut i = parent[k];
        for l in L[start[k]..start[k] + depth[k]].iter().rev() {
            xk = (-*l).mul_add(x[i], xk);
            i = parent[i];
        }
        x[k] = xk;
    }
}

/// Factorises a full symmetric matrix H = L D Lᵀ in place (n×n row-major, lower triangle): L below
/// the diagonal, 1/D on it. True if every D is positive.
#[inline]
pub(crate) fn factorise_full<T: Real>(H: &mut [T], n: usize) -> bool {
    let mut positive = true;
    for j in 0..n {
        let d = H[j * n + j];
        positive &= T::ZERO.lt(d);
        let inverse = T::ONE / d;
        H[j * n + j] = inverse;
        for i in j + 1..n {
            let h = H[i * n + j];
            let l = h * inverse;
            for k in j + 1..i {
                H[i * n + k] = (-h).mul_add(H[k * n + j], H[i * n + k]);
            }
            H[i * n + i] = (-h).mul_add(l, H[i * n + i]);
            H[i * n + j] = l;
        }
    }
    positive
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_lie_where_one_carries_the_other() {
        let mut sparsity = TreeSparsity::default();
        // 0 carries 1 and 3, 1 carries 2, 4 stands alone
        [usize::MAX, 0, 1, 0, usize::MAX].into_iter().for_each(|parent| sparsity.push(parent));
        assert_eq!(sparsity.len, 1 + 2 + 3 + 2 + 1);
        assert_eq!(
            (sparsity.entry(2, 0), sparsity.entry(0, 2), sparsity.entry(2, 2)),
            (Some(3), Some(3), Some(5))
        );
        assert_eq!(
            (
                sparsity.entry(3, 0),
                sparsity.entry(3, 1),
                sparsity.entry(4, 0),
                sparsity.entry(2, 3)
            ),
            (Some(6), None, None, None)
        );
    }

    #[test]
    fn a_branching_matrix_is_solved() {
        let mut sparsity = TreeSparsity::default();
        [usize::MAX, 0, 1, 0].into_iter().for_each(|parent| sparsity.push(parent));
        let packed = [5.0_f64, 1.0, 4.0, 0.5, -1.0, 3.0, 0.25, 2.0];
        let x = [1.0, -2.0, 3.0, 0.5];
        let mut b = [0.0; 4];
        for (i, row) in b.iter_mut().enumerate() {
            *row = (0..4).map(|j| sparsity.entry(i, j).map_or(0.0, |at| packed[at]) * x[j]).sum();
        }
        let mut factor = packed;
        assert!(factorise_tree(&sparsity, &mut factor));
        solve_tree(&sparsity, &factor, &mut b);
        (0..4).for_each(|i| assert!((b[i] - x[i]).abs() < 1e-14, "{b:?}"));
        let mut indefinite = packed;
        indefinite[2] = 0.1;
        assert!(!factorise_tree(&sparsity, &mut indefinite));
    }

    #[test]
    fn a_full_matrix_is_factorised() {
        let A = [4.0_f64, 0.0, 0.0, 2.0, 5.0, 0.0, -1.0, 0.5, 3.0];
        let mut L = A;
        assert!(factorise_full(&mut L, 3));
        let l = |i: usize, k: usize| if i == k { 1.0 } else { L[i * 3 + k] };
        for i in 0..3 {
            for j in 0..=i {
                let product: f64 = (0..=j).map(|k| l(i, k) * l(j, k) / L[k * 3 + k]).sum();
                assert!((product - A[i * 3 + j]).abs() < 1e-15);
            }
        }
        let mut indefinite = A;
        indefinite[8] = -3.0;
        assert!(!factorise_full(&mut indefinite, 3));
    }
}
