//! A small symmetric positive definite system, in place and without allocation.

/// Part of a diagonal entry that must remain, or the matrix counts as singular.
const LEAST: f64 = 1e-14;

/// A symmetric matrix, row by row; after [`Cholesky::factorise`] L with N = L Lᵀ.
#[derive(Debug)]
pub struct Cholesky {
    n: usize,
    /// Only the lower half is used (n × n).
    pub matrix: Vec<f64>,
}

impl Cholesky {
    /// For a matrix of n × n. Allocates; nothing after it does.
    pub fn new(n: usize) -> Cholesky {
        Cholesky { n, matrix: vec![0.0; n * n] }
    }

    /// False if the matrix is singular or not finite.
    pub fn factorise(&mut self) -> bool {
        let n = self.n;
        let a = &mut self.matrix;
        for j in 0..n {
            let whole = a[j * n + j];
            for k in 0..j {
                a[j * n + j] -= a[j * n + k] * a[j * n + k];
            }
            let pivot = a[j * n + j];
            let is_sound = pivot > LEAST * whole && pivot.is_finite();
            if !is_sound {
                return false;
            }
            let root = pivot.sqrt();
            a[j * n + j] = root;
            for i in j + 1..n {
                for k in 0..j {
                    a[i * n + j] -= a[i * n + k] * a[j * n + k];
                }
                a[i * n + j] /= root;
            }
        }
        true
    }

    /// x for N x = side, in place.
    pub fn solve(&self, side: &mut [f64]) {
        let n = self.n;
        let l = &self.matrix;
        for i in 0..n {
            for k in 0..i {
                side[i] -= l[i * n + k] * side[k];
            }
            side[i] /= l[i * n + i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                side[i] -= l[k * n + i] * side[k];
            }
            side[i] /= l[i * n + i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_is_solved_and_a_singular_one_is_refused() {
        let mut system = Cholesky::new(3);
        system.matrix = vec![4.0, 0.0, 0.0, 2.0, 3.0, 0.0, 0.4, 0.6, 2.0];
        assert!(system.factorise());
        let mut side = [4.0 + 4.0 + 1.2, 2.0 + 6.0 + 1.8, 0.4 + 1.2 + 6.0];
        system.solve(&mut side);
        assert!(side.iter().zip([1.0, 2.0, 3.0]).all(|(x, expected)| (x - expected).abs() < 1e-12));
        system.matrix = vec![1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        assert!(!system.factorise());
    }
}
