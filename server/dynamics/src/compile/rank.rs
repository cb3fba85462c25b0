//! Rank, null space and independent rows of K at a pose, by factorisations that reveal them.

use sarrus_factorisations::{Mat, pivots, svd, thin_svd};

/// Ratio of singular values below which a row counts as dependent: files are rounded.
pub(super) const RANK_GAP: f64 = 1e-4;

/// Null space of K_d, of unit vectors in the scaling.
pub(super) fn null_space(K_d: &Mat<f64>) -> Vec<Vec<f64>> {
    let m = K_d.ncols();
    if m == 0 {
        return Vec::new();
    }
    let Some(svd) = svd(K_d) else { return Vec::new() };
    let S = svd.S().column_vector();
    let lost = |a: usize| a >= S.nrows() || S[a] <= RANK_GAP * S[0];
    (0..m).filter(|a| lost(*a)).map(|a| (0..m).map(|i| svd.V()[(i, a)]).collect()).collect()
}

/// Columns of a row-major matrix.
pub(super) fn matrix(K: &[f64], rows: usize, n: usize, columns: &[usize]) -> Mat<f64> {
    Mat::from_fn(rows, columns.len(), |r, a| K[r * n + columns[a]])
}

pub(super) fn rank(A: &Mat<f64>) -> usize {
    if A.nrows() == 0 || A.ncols() == 0 {
        return 0;
    }
    thin_svd(A).map_or(0, |svd| {
        let S = svd.S().column_vector();
        (0..S.nrows()).filter(|i| S[*i] > RANK_GAP * S[0]).count()
    })
}

/// As many rows of K_d as it has columns, by pivoted QR of its transpose, in ascending order.
pub(super) fn independent_rows(K_d: &Mat<f64>, count: usize) -> Vec<usize> {
    if K_d.nrows() == count {
        return (0..count).collect();
    }
    let mut used = pivots(&K_d.transpose().to_owned());
    used.truncate(count);
    used.sort_unstable();
    used
}

/// As many places as there are directions, by pivoted QR: the largest component first.
pub(super) fn locks(directions: &[Vec<f64>]) -> Vec<usize> {
    let Some(m) = directions.first().map(Vec::len) else { return Vec::new() };
    let mut locked = pivots(&Mat::from_fn(directions.len(), m, |a, i| directions[a][i]));
    locked.truncate(directions.len());
    locked.sort_unstable();
    locked
}
