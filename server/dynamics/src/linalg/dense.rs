//! Small dense linear algebra on caller-owned slices: row-major, no allocation, generic over the
//! scalar.

use crate::scalar::Real;

/// Solves A X = B in place by elimination without exchanges; A is m×m, B m×n, both row-major. B
/// becomes X.
///
/// The rows must have the order chosen at load. Returns the mask of lanes whose every pivot stayed
/// above `floor` times the largest entry of its row and the determinant of A.
#[inline]
pub(crate) fn solve_unpivoted<T: Real>(
    A: &mut [T],
    B: &mut [T],
    m: usize,
    n: usize,
    floor: f64,
) -> (bool, T) {
    let mut good = true;
    let mut det = T::ONE;
    for k in 0..m {
        // pivot against the largest entry of its row
        let pivot = A[k * m + k];
        let mut largest = T::ZERO;
        for j in k..m {
            let x = A[k * m + j].abs();
            largest = T::select_lt(largest, x, x, largest);
        }
        good &= (largest * T::from_f64(floor)).lt(pivot.abs());
        det *= pivot;
        eliminate(A, B, m, n, k);
    }
    substitute_back(A, B, m, n);
    (good, det)
}

/// Solves A X = B in place with partial pivoting; same layout as [`solve_unpivoted`]. Returns the
/// sign of the determinant, or `None` where a pivot is not above the rounding of the largest entry,
/// or not a number.
pub(crate) fn solve_pivoted<T: Real>(A: &mut [T], B: &mut [T], m: usize, n: usize) -> Option<T> {
    solve_above(A, B, m, n, (8.0, T::ZERO)).map(|solved| solved.sign)
}

/// Measures of a solved system.
#[derive(Clone, Copy)]
pub(crate) struct Solved<T> {
    /// Of the determinant.
    pub(crate) sign: T,
    /// Least pivot against the largest entry.
    pub(crate) least: T,
}

/// Solves A X = B; `None` also if the solution of a matrix of like entries would have less than
/// five digits, or half of those of a scalar with less than ten. Where all entries are below `size`
/// it stands for the largest.
pub(crate) fn solve_sound<T: Real>(
    A: &mut [T],
    B: &mut [T],
    m: usize,
    n: usize,
    size: f64,
) -> Option<Solved<T>> {
    let roundings = f64::min(1e5, 1.0 / T::EPSILON.sqrt());
    solve_above(A, B, m, n, (roundings, T::from_f64(size)))
}

/// `roundings`, `size`: how many unit roundoffs of the largest entry a pivot must have, and the
/// least that counts as largest. Loops of fixed length solve the sizes that actuators of
/// mechanisms need, and rods of a platform.
fn solve_above<T: Real>(
    A: &mut [T],
    B: &mut [T],
    m: usize,
    n: usize,
    limits: (f64, T),
) -> Option<Solved<T>> {
    match (m, n) {
        (2, 1) => solve_of(&mut A[..4], &mut B[..2], 2, 1, limits),
        (3, 1) => solve_of(&mut A[..9], &mut B[..3], 3, 1, limits),
        (6, 1) => solve_of(&mut A[..36], &mut B[..6], 6, 1, limits),
        _ => solve_of(A, B, m, n, limits),
    }
}

#[inline(always)]
fn solve_of<T: Real>(
    A: &mut [T],
    B: &mut [T],
    m: usize,
    n: usize,
    (roundings, size): (f64, T),
) -> Option<Solved<T>> {
    let largest =
        A[..m * m].iter().fold(size, |largest, x| T::select_lt(largest, x.abs(), x.abs(), largest));
    let floor = largest * T::from_f64(roundings * T::EPSILON);
    let mut sign = T::ONE;
    let mut least = largest;
    for k in 0..m {
        sign *= exchange(A, B, m, n, k);
        let pivot = A[k * m + k];
        if !floor.lt(pivot.abs()) {
            return None;
        }
        sign = T::select_lt(pivot, T::ZERO, -sign, sign);
        least = T::select_lt(pivot.abs(), least, pivot.abs(), least);
        eliminate(A, B, m, n, k);
    }
    substitute_back(A, B, m, n);
    Some(Solved { sign, least: least / largest })
}

/// Brings the largest entry of column k, on or below the diagonal, to its place; −1 where rows
/// changed places, else 1.
#[inline(always)]
pub(crate) fn exchange<T: Real>(A: &mut [T], B: &mut [T], m: usize, n: usize, k: usize) -> T {
    if T::STRAIGHT {
        return exchange_straight(A, B, m, n, k);
    }
    let mut p = k;
    for i in k + 1..m {
        if A[i * m + k].abs() > A[p * m + k].abs() {
            p = i;
        }
    }
    if p == k {
        return T::ONE;
    }
    for j in 0..m {
        A.swap(k * m + j, p * m + j);
    }
    for j in 0..n {
        B.swap(k * n + j, p * n + j);
    }
    -T::ONE
}

/// Pivoted elimination without a branch on a value; rows that are zero in column k at every pose
/// stay in their places.
fn exchange_straight<T: Real>(A: &mut [T], B: &mut [T], m: usize, n: usize, k: usize) -> T {
    // the row of the pivot, as a number
    let mut p = T::from_f64(k as f64);
    let mut largest = A[k * m + k].abs();
    for i in k + 1..m {
        let x = A[i * m + k].abs();
        if !x.is_always_zero() {
            p = T::select_lt(largest, x, T::from_f64(i as f64), p);
            largest = T::select_lt(largest, x, x, largest);
        }
    }
    let of_pivot = |i: usize, a: T, b: T| {
        T::select_lt((p - T::from_f64(i as f64)).abs(), T::from_f64(0.5), a, b)
    };
    for i in k + 1..m {
        if A[i * m + k].is_always_zero() {
            continue;
        }
        for (x, n) in [(&mut *A, m), (&mut *B, n)] {
            for j in 0..n {
                let [own, pivot] = [x[i * n + j], x[k * n + j]];
                x[k * n + j] = of_pivot(i, own, pivot);
                x[i * n + j] = of_pivot(i, pivot, own);
            }
        }
    }
    of_pivot(k, T::ONE, -T::ONE)
}

/// Clears column k below its pivot, which becomes its inverse.
#[inline(always)]
pub(crate) fn eliminate<T: Real>(A: &mut [T], B: &mut [T], m: usize, n: usize, k: usize) {
    let inverse = T::ONE / A[k * m + k];
    for i in k + 1..m {
        let l = -(A[i * m + k] * inverse);
        for j in k + 1..m {
            A[i * m + j] = l.mul_add(A[k * m + j], A[i * m + j]);
        }
        for j in 0..n {
            B[i * n + j] = l.mul_add(B[k * n + j], B[i * n + j]);
        }
    }
    A[k * m + k] = inverse;
}

/// Solves the upper triangle that [`eliminate`] left.
#[inline(always)]
pub(crate) fn substitute_back<T: Real>(A: &[T], B: &mut [T], m: usize, n: usize) {
    for k in (0..m).rev() {
        for j in 0..n {
            let mut x = B[k * n + j];
            for i in k + 1..m {
                x = (-A[k * m + i]).mul_add(B[i * n + j], x);
            }
            B[k * n + j] = x * A[k * m + k];
        }
    }
}

/// X = A⁻¹ (m×m) by elimination with exchanges, which over doubles skips zeros: a matrix of small
/// blocks costs little more than its blocks. A is destroyed; false where a pivot is zero or no
/// number.
pub(crate) fn invert<T: Real>(A: &mut [T], X: &mut [T], m: usize) -> bool {
    X[..m * m].fill(T::ZERO);
    (0..m).for_each(|k| X[k * m + k] = T::ONE);
    for k in 0..m {
        let mut best = k;
        for i in k + 1..m {
            if A[best * m + k].abs() < A[i * m + k].abs() {
                best = i;
            }
        }
        if best != k {
            for j in 0..m {
                A.swap(best * m + j, k * m + j);
                X.swap(best * m + j, k * m + j);
            }
        }
        let pivot = A[k * m + k];
        if !T::ZERO.lt(pivot.abs()) {
            return false;
        }
        let inverse = T::ONE / pivot;
        for i in (0..m).filter(|i| *i != k) {
            if T::UNROLLED && A[i * m + k] == T::ZERO {
                continue;
            }
            let l = -(A[i * m + k] * inverse);
            for j in k + 1..m {
                A[i * m + j] = l.mul_add(A[k * m + j], A[i * m + j]);
            }
            for j in 0..m {
                X[i * m + j] = l.mul_add(X[k * m + j], X[i * m + j]);
            }
        }
        X[k * m..(k + 1) * m].iter_mut().for_each(|x| *x *= inverse);
        A[k * m + k + 1..(k + 1) * m].iter_mut().for_each(|x| *x *= inverse);
    }
    true
}

/// Singular value decomposition A = U Σ Vᵀ of the m×n row-major matrix A by one-sided Jacobi
/// rotations \[H58\]: A becomes U Σ, its column norms are the singular values, in no order.
/// V (n×n) is filled, or left out where it is empty.
pub(crate) fn decompose<T: Real>(A: &mut [T], V: &mut [T], m: usize, n: usize) {
    const SWEEPS: usize = 30;
    let tiny = T::from_f64(T::EPSILON);
    for (k, x) in V.iter_mut().enumerate().take(n * n) {
        *x = if k / n == k % n { T::ONE } else { T::ZERO };
    }
    // a column below the rounding of the largest is zero, and turns with nothing
    let floor = (0..m * n).fold(T::ZERO, |sum, k| A[k].mul_add(A[k], sum)) * tiny * tiny;
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                // make columns p and q orthogonal
                let mut a = T::ZERO;
                let mut b = T::ZERO;
                let mut c = T::ZERO;
                for i in 0..m {
                    let x = A[i * n + p];
                    let y = A[i * n + q];
                    a = x.mul_add(x, a);
                    b = y.mul_add(y, b);
                    c = x.mul_add(y, c);
                }
                if !(tiny * (a * b).sqrt()).lt(c.abs()) || !(floor * tiny).lt(c.abs()) {
                    continue;
                }
                turned = true;
                let zeta = (b - a) / (c + c);
                let t = T::ONE / (zeta.abs() + (T::ONE + zeta * zeta).sqrt());
                let t = if zeta < T::ZERO { -t } else { t };
                let cosine = T::ONE / (T::ONE + t * t).sqrt();
                let sine = t * cosine;
                turn_columns(A, m, n, p, q, cosine, sine);
                if !V.is_empty() {
                    turn_columns(V, n, n, p, q, cosine, sine);
                }
            }
        }
        if !turned {
            break;
        }
    }
}

fn turn_columns<T: Real>(A: &mut [T], m: usize, n: usize, p: usize, q: usize, cosine: T, sine: T) {
    for i in 0..m {
        let x = A[i * n + p];
        let y = A[i * n + q];
        A[i * n + p] = cosine * x - sine * y;
        A[i * n + q] = sine * x + cosine * y;
    }
}

/// Squared norm of column j of an m×n row-major matrix.
#[inline(always)]
pub(crate) fn column_square<T: Real>(A: &[T], m: usize, n: usize, j: usize) -> T {
    (0..m).fold(T::ZERO, |sum, i| A[i * n + j].mul_add(A[i * n + j], sum))
}

/// Largest and least singular value of the m×n row-major matrix A; destroys A. When m < n the
/// transpose must be passed. An empty matrix has (1, 1); numbers that are not finite have none.
pub(crate) fn singular_range<T: Real>(A: &mut [T], m: usize, n: usize) -> (T, T) {
    if n == 0 {
        return (T::ONE, T::ONE);
    }
    if !A[..m * n].iter().all(|x| x.is_finite()) {
        return (T::from_f64(f64::NAN), T::from_f64(f64::NAN));
    }
    decompose(A, &mut [], m, n);
    let mut largest = T::ZERO;
    let mut least = T::from_f64(f64::INFINITY);
    for j in 0..n {
        let sigma = column_square(A, m, n, j).sqrt();
        if sigma > largest {
            largest = sigma;
        }
        if sigma < least {
            least = sigma;
        }
    }
    (largest, least)
}

/// Sign of the determinant of an m×m row-major matrix, by elimination with partial pivoting;
/// destroys A. Zero where a pivot is exactly so.
pub(crate) fn determinant_sign<T: Real>(A: &mut [T], m: usize) -> T {
    let mut sign = T::ONE;
    for k in 0..m {
        sign *= exchange(A, &mut [], m, 0, k);
        let pivot = A[k * m + k];
        if pivot == T::ZERO {
            return T::ZERO;
        }
        if pivot < T::ZERO {
            sign = -sign;
        }
        eliminate(A, &mut [], m, 0, k);
    }
    sign
}

/// Least-squares solution of least norm of A x = b, A m×n row-major, by the normal equations of the
/// smaller side (one step of refinement); x (n) into `x`. `None` where A has not full rank. The
/// measures are those of the normal equations.
pub(crate) fn least_norm<T: Real>(
    A: &mut [T],
    b: &mut [T],
    x: &mut [T],
    m: usize,
    n: usize,
) -> Option<Solved<T>> {
    let mut solved = Solved { sign: T::ONE, least: T::ONE };
    if n == 0 {
        return Some(solved);
    }
    let wide = n > m;
    let s = m.min(n);
    // N = A Aᵀ where A is wide, Aᵀ A where it is tall; kept behind the solution in `x`
    let (solution, normal) = x.split_at_mut(n);
    solution.fill(T::ZERO);
    for _ in 0..2 {
        for i in 0..s {
            for j in 0..s {
                let sum = |of: &dyn Fn(usize) -> (T, T), len: usize| {
                    (0..len).fold(T::ZERO, |sum, k| of(k).0.mul_add(of(k).1, sum))
                };
                normal[i * s + j] = if wide {
                    sum(&|k| (A[i * n + k], A[j * n + k]), n)
                } else {
                    sum(&|k| (A[k * n + i], A[k * n + j]), m)
                };
            }
        }
        // residual r = b − A x, right-hand side r or Aᵀ r
        let (square, rest) = normal.split_at_mut(s * s);
        let (residual, rhs) = rest.split_at_mut(m);
        for i in 0..m {
            residual[i] = (0..n).fold(b[i], |r, k| (-A[i * n + k]).mul_add(solution[k], r));
        }
        for i in 0..s {
            rhs[i] = if wide {
                residual[i]
            } else {
                (0..m).fold(T::ZERO, |sum, k| A[k * n + i].mul_add(residual[k], sum))
            };
        }
        solved = solve_above(square, rhs, s, 1, (8.0, T::ZERO))?;
        for k in 0..n {
            solution[k] += if wide {
                (0..m).fold(T::ZERO, |sum, i| A[i * n + k].mul_add(rhs[i], sum))
            } else {
                rhs[k]
            };
        }
    }
    solution.iter().all(|x| x.is_finite()).then_some(solved)
}
