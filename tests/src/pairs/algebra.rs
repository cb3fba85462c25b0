//! Small dense algebra over any scalar.

use sarrus_dynamics::scalar::Real;

/// A vector of three.
pub type V3<T> = [T; 3];
/// A matrix of three by three, row by row.
pub type M3<T> = [[T; 3]; 3];

/// a + b.
pub fn add<T: Real>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
pub fn sub<T: Real>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s a.
pub fn scaled<T: Real>(a: V3<T>, s: T) -> V3<T> {
    a.map(|x| x * s)
}

/// a · b.
pub fn dot<T: Real>(a: V3<T>, b: V3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
pub fn cross<T: Real>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// R v.
pub fn apply<T: Real>(R: &M3<T>, v: V3<T>) -> V3<T> {
    [dot(R[0], v), dot(R[1], v), dot(R[2], v)]
}

/// Rᵀ v.
pub fn turned<T: Real>(R: &M3<T>, v: V3<T>) -> V3<T> {
    std::array::from_fn(|k| R[0][k] * v[0] + R[1][k] * v[1] + R[2][k] * v[2])
}

/// A dense matrix, row by row.
#[derive(Clone, Debug)]
pub struct Matrix<T> {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    numbers: Vec<T>,
}

impl<T: Real> Matrix<T> {
    /// Zeros.
    pub fn new(rows: usize, columns: usize) -> Matrix<T> {
        Matrix { rows, columns, numbers: vec![T::ZERO; rows * columns] }
    }

    /// An entry.
    pub fn get(&self, r: usize, c: usize) -> T {
        self.numbers[r * self.columns + c]
    }

    /// An entry, to change it.
    pub fn at(&mut self, r: usize, c: usize) -> &mut T {
        &mut self.numbers[r * self.columns + c]
    }

    /// The numbers, row by row.
    pub fn numbers(&self) -> &[T] {
        &self.numbers
    }

    fn swap(&mut self, a: usize, b: usize) {
        (0..self.columns)
            .for_each(|c| self.numbers.swap(a * self.columns + c, b * self.columns + c));
    }
}

/// x with A x = B where A has full column rank and the rows agree, by elimination with full
/// pivoting; the least pivot, zero where the rank is lost.
pub fn eliminate<T: Real>(mut A: Matrix<T>, mut B: Matrix<T>) -> (Matrix<T>, f64) {
    let n = A.columns;
    let mut columns: Vec<usize> = (0..n).collect();
    let mut least = f64::INFINITY;
    let mut rank = 0;
    for k in 0..n.min(A.rows) {
        let mut best = (k, k, 0.0);
        for r in k..A.rows {
            for c in k..n {
                let size = A.get(r, columns[c]).to_f64().abs();
                if size > best.2 {
                    best = (r, c, size);
                }
            }
        }
        if best.2.is_nan() || best.2 <= 1e-14 {
            break;
        }
        least = least.min(best.2);
        rank += 1;
        A.swap(k, best.0);
        B.swap(k, best.0);
        columns.swap(k, best.1);
        let pivot = A.get(k, columns[k]);
        for r in k + 1..A.rows {
            let factor = A.get(r, columns[k]) / pivot;
            if factor.to_f64() == 0.0 {
                continue;
            }
            for c in k..n {
                let by = factor * A.get(k, columns[c]);
                *A.at(r, columns[c]) += -by;
            }
            for c in 0..B.columns {
                let by = factor * B.get(k, c);
                *B.at(r, c) += -by;
            }
        }
    }
    if rank < n {
        least = 0.0;
    }
    let mut x = Matrix::new(n, B.columns);
    for k in (0..rank).rev() {
        for c in 0..B.columns {
            let mut sum = B.get(k, c);
            for j in k + 1..rank {
                sum += -(A.get(k, columns[j]) * x.get(columns[j], c));
            }
            *x.at(columns[k], c) = sum / A.get(k, columns[k]);
        }
    }
    (x, if n == 0 { 1.0 } else { least })
}
