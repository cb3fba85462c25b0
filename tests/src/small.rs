//! Dense products for the laws, row by row.

use sarrus_dynamics::scalar::Real;

/// A x, A with as many rows as the result and as many columns as x.
pub fn product<T: Real>(A: &[T], x: &[T]) -> Vec<T> {
    if x.is_empty() { vec![] } else { A.chunks_exact(x.len()).map(|row| inner(row, x)).collect() }
}

/// Aᵀ x.
pub fn transposed<T: Real>(A: &[T], x: &[T], columns: usize) -> Vec<T> {
    (0..columns)
        .map(|j| (0..x.len()).fold(T::ZERO, |sum, i| sum + A[i * columns + j] * x[i]))
        .collect()
}

/// A B with this many inner and result columns.
pub fn matrix_product<T: Real>(A: &[T], B: &[T], inner: usize, columns: usize) -> Vec<T> {
    let entry =
        |row: &[T], j: usize| (0..inner).fold(T::ZERO, |sum, i| sum + row[i] * B[i * columns + j]);
    A.chunks_exact(inner.max(1)).flat_map(|row| (0..columns).map(move |j| entry(row, j))).collect()
}

/// x · y.
pub fn inner<T: Real>(x: &[T], y: &[T]) -> T {
    x.iter().zip(y).fold(T::ZERO, |sum, (x, y)| sum + *x * *y)
}

/// x + y.
pub fn plus<T: Real>(x: &[T], y: &[T]) -> Vec<T> {
    x.iter().zip(y).map(|(x, y)| *x + *y).collect()
}

/// x − y.
pub fn minus<T: Real>(x: &[T], y: &[T]) -> Vec<T> {
    x.iter().zip(y).map(|(x, y)| *x - *y).collect()
}

/// s x.
pub fn times<T: Real>(s: T, x: &[T]) -> Vec<T> {
    x.iter().map(|x| s * *x).collect()
}

/// True where a symmetric matrix has a Cholesky factor.
pub fn is_positive_definite<T: Real>(A: &[T], n: usize) -> bool {
    let mut L = A.to_vec();
    for k in 0..n {
        for j in 0..k {
            let x = L[k * n + j];
            L[k * n + k] -= x * x;
        }
        if !T::ZERO.lt(L[k * n + k]) {
            return false;
        }
        let root = L[k * n + k].sqrt();
        L[k * n + k] = root;
        for i in k + 1..n {
            let mut x = L[i * n + k];
            (0..k).for_each(|j| x -= L[i * n + j] * L[k * n + j]);
            L[i * n + k] = x / root;
        }
    }
    true
}
