//! Least squares in triangles, row by row.

use sarrus_factorisations::{Mat, pivoted_qr, thin_svd};

/// The triangle R of a QR factorisation of all rows so far (n × n).
#[derive(Clone, Debug)]
pub(crate) struct Triangle {
    pub(crate) n: usize,
    pub(crate) R: Vec<f64>,
}

impl Triangle {
    pub(crate) fn new(n: usize) -> Triangle {
        Triangle { n, R: vec![0.0; n * n] }
    }

    /// Adds a row by Givens rotations; its numbers are lost.
    pub(crate) fn add(&mut self, row: &mut [f64]) {
        for k in 0..self.n {
            if row[k] == 0.0 {
                continue;
            }
            let own = &mut self.R[k * self.n + k..(k + 1) * self.n];
            let length = own[0].hypot(row[k]);
            let c = own[0] / length;
            let s = row[k] / length;
            for (r, x) in own.iter_mut().zip(&mut row[k..]) {
                let before = *r;
                *r = c * before + s * *x;
                *x = c * *x - s * before;
            }
        }
    }

    /// Adds the rows of another one.
    pub(crate) fn join(&mut self, other: &Triangle) {
        other.R.chunks_exact(other.n).for_each(|row| self.add(&mut row.to_vec()));
    }

    /// Row k, from column k on where it is not zero.
    pub(crate) fn row(&self, k: usize) -> &[f64] {
        &self.R[k * self.n..(k + 1) * self.n]
    }

    /// 2-norms of the columns.
    pub(crate) fn norms(&self) -> Vec<f64> {
        let of = |j: usize| (0..=j).fold(0.0, |norm: f64, i| norm.hypot(self.row(i)[j]));
        (0..self.n).map(of).collect()
    }

    /// x of R x = b, with the first of the columns and rows.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        for k in (0..b.len()).rev() {
            let row = &self.row(k)[..b.len()];
            let sum: f64 = row[k + 1..].iter().zip(&b[k + 1..]).map(|(r, x)| r * x).sum();
            b[k] = (b[k] - sum) / row[k];
        }
    }

    /// Square roots of the diagonal of (RᵀR)⁻¹.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.n];
        for k in 0..self.n {
            // column k of the inverse
            let mut column = vec![0.0; k + 1];
            column[k] = 1.0;
            self.solve(&mut column);
            squares.iter_mut().zip(&column).for_each(|(sum, x)| *sum += x * x);
        }
        squares.into_iter().map(f64::sqrt).collect()
    }

    /// 2-norm condition number; infinite where no singular values are found.
    pub(crate) fn condition(&self) -> f64 {
        let R = Mat::from_fn(self.n, self.n, |i, j| self.R[i * self.n + j]);
        thin_svd(&R).map_or(f64::INFINITY, |svd| {
            let S = svd.S().column_vector();
            S[0] / S[self.n - 1]
        })
    }

    /// The triangle of these columns.
    pub(crate) fn of_columns(&self, columns: &[usize]) -> Triangle {
        let mut picked = Triangle::new(columns.len());
        for k in 0..self.n {
            let row = self.row(k);
            picked.add(&mut columns.iter().map(|j| row[*j]).collect::<Vec<f64>>());
        }
        picked
    }

    /// Orders the columns, scaled to length one, by the length that each adds to those before it,
    /// and returns it with them, largest first; columns of zeros come last.
    pub(crate) fn pivots(&self) -> Vec<(usize, f64)> {
        let n = self.n;
        let norms = self.norms();
        let most = norms.iter().copied().fold(0.0, f64::max);
        let scale = |j: usize| if norms[j] > f64::EPSILON * most { 1.0 / norms[j] } else { 0.0 };
        let (order, R) = pivoted_qr(&Mat::from_fn(n, n, |i, j| self.R[i * n + j] * scale(j)));
        order.into_iter().enumerate().map(|(k, j)| (j, R[(k, k)].abs())).collect()
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_in_a_triangle_have_the_least_squares_and_the_rank_of_all() {
        // third column = 2 × first − second; right-hand side in the last
        let mut all = Triangle::new(4);
        for k in 0..50 {
            let a = (1.3 * f64::from(k)).sin();
            let b = (0.7 * f64::from(k)).cos();
            all.add(&mut [a, b, 2.0 * a - b, 3.0 * a - 5.0 * b]);
        }
        let order = all.of_columns(&[0, 1, 2]).pivots();
        assert!(order[1].1 > 0.1 && order[2].1 < 1e-14, "{order:?}");
        let two = all.of_columns(&[0, 1, 3]);
        let mut x = [two.row(0)[2], two.row(1)[2]];
        two.solve(&mut x);
        assert!((x[0] - 3.0).abs() < 1e-14 && (x[1] + 5.0).abs() < 1e-14, "{x:?}");
    }

    #[test]
    fn deviations_and_condition_are_those_of_the_inverse() {
        let two = Triangle { n: 2, R: vec![2.0, 1.0, 0.0, 0.5] };
        // (RᵀR)⁻¹ = [1.25 −2; −2 4], singular values of R from trace 5.25 and determinant 1
        let [a, b] = [two.deviations()[0], two.deviations()[1]];
        assert!((a * a - 1.25).abs() < 1e-14 && (b * b - 4.0).abs() < 1e-14);
        let larger = f64::midpoint(5.25, (5.25_f64 * 5.25 - 4.0).sqrt());
        assert!((two.condition() - larger).abs() < 1e-12, "{}", two.condition());
    }
}
