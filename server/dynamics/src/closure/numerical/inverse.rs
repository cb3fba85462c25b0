//! The inverse of a block, with its determinant.

use crate::linalg::{column_square, solve_unpivoted};
use crate::scalar::Real;

/// Least pivot of a wide block relative to its row: the larger of this and this many unit
/// roundoffs.
const SINGULAR: f64 = 1e-12;
const PIVOT_ROUNDINGS: f64 = 9e3;
/// Least sine of the angle that vanishes at a singular pose, in roots of the unit roundoff; of a
/// narrow block the determinant relative to the product of its column norms. Closer to singularity
/// a pose has no correct digit, and signs of determinants do not tell crossing assemblies apart.
pub(super) const ROOTS: f64 = 10.0;
/// Least sine at which accelerations, whose error is ε / sin³, keep a digit: in cube roots of ε.
const CUBE_ROOTS: f64 = 4.0;
/// The width of a block as the compiler sees it: 1 to 3 are written out, `ANY` is read from the
/// block.
pub(in crate::closure) const ANY: usize = 0;

/// True if accelerations keep a digit at a sine whose square is the quotient: sin⁶ against ε².
#[inline(always)]
pub(in crate::closure) fn accurate<T: Real>(square: T, size: T) -> bool {
    let floor = CUBE_ROOTS * CUBE_ROOTS * CUBE_ROOTS * T::EPSILON;
    (size * size * size * T::from_f64(floor * floor)).lt(square * square * square)
}

/// Least pivot of a wide block against the largest entry of its row.
pub(super) const fn least_pivot<T: Real>() -> f64 {
    SINGULAR.max(PIVOT_ROUNDINGS * T::EPSILON)
}

/// The result of an inversion.
pub(in crate::closure) struct Inverted<T: Real> {
    /// The matrix is regular.
    pub(in crate::closure) sound: bool,
    /// Accelerations by the inverse keep a digit; always true of one row.
    pub(in crate::closure) accurate: bool,
    /// 1/sin² of the angle that vanishes where the matrix is singular; 1 of one row, whose callers
    /// compute it.
    pub(in crate::closure) near: T,
    /// Growth of roundings: 1/sin² with the lengths of columns against those elsewhere.
    pub(in crate::closure) gain: T,
    pub(in crate::closure) det: T,
}

impl<T: Real> Inverted<T> {
    /// |det| against the product of the column norms, as rotating and sliding joints have columns
    /// of different units; the gain also against the norms elsewhere.
    #[inline(always)]
    fn narrow(A: &[T], volume: f64, m: usize, det: T) -> Inverted<T> {
        let squares = (0..m).fold(T::ONE, |product, j| product * column_square(A, m, m, j));
        let below = |floor: f64| (det * det).lt(squares * T::from_f64(floor));
        Inverted {
            sound: !below(ROOTS * ROOTS * T::EPSILON) & T::ZERO.lt(det * det),
            accurate: accurate(det * det, squares),
            near: squares / (det * det),
            gain: longer(squares, volume) / (det * det),
            det,
        }
    }
}

/// The square of a column's norm, or of its norm elsewhere where that is larger, and the same of
/// products: a joint whose axis passes near the point that it moves turns quickly, however
/// independent its column is.
#[inline(always)]
fn longer<T: Real>(square: T, size: f64) -> T {
    let size = T::from_f64(size);
    T::select_lt(square, size, size, square)
}

/// Inverse of A (m × m): closed form up to 3×3, elimination in the order fixed at load beyond.
/// `volume`: product of the squares of the columns' norms elsewhere.
#[inline(always)]
pub(in crate::closure) fn invert<T: Real, const M: usize>(
    A: &mut [T],
    inverse: &mut [T],
    volume: f64,
    m: usize,
) -> Inverted<T> {
    match if M == ANY { m } else { M } {
        1 => {
            inverse[0] = T::ONE / A[0];
            let sound = T::ZERO.lt(A[0].abs());
            Inverted { sound, accurate: true, near: T::ONE, gain: T::ONE, det: A[0] }
        }
        2 => {
            let det = A[0].mul_add(A[3], -(A[1] * A[2]));
            let d = T::ONE / det;
            (inverse[0], inverse[1], inverse[2], inverse[3]) =
                (A[3] * d, -(A[1] * d), -(A[2] * d), A[0] * d);
            Inverted::narrow(A, volume, 2, det)
        }
        3 => {
            let minor = |a: usize, b: usize, c: usize, d: usize, A: &[T]| {
                A[a].mul_add(A[d], -(A[b] * A[c]))
            };
            let c0 = minor(4, 5, 7, 8, A);
            let c1 = minor(5, 3, 8, 6, A);
            let c2 = minor(3, 4, 6, 7, A);
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
            Inverted::narrow(A, volume, 3, det)
        }
        _ => {
            for (k, x) in inverse.iter_mut().enumerate() {
                *x = if k / m == k % m { T::ONE } else { T::ZERO };
            }
            let (sound, det) = solve_unpivoted(A, inverse, m, m, least_pivot::<T>());
            Inverted { sound, accurate: true, near: T::ONE, gain: T::ONE, det }
        }
    }
}

/// 1/sin² of the least angle between a column of the matrix, whose squared norms are given, and the
/// span of the others, and the same of columns as long as elsewhere: row i of the inverse has the
/// norm 1/sin over that of column i.
#[inline(always)]
pub(in crate::closure) fn inverse_square_sines<T: Real>(
    inverse: &[T],
    squares: &[T],
    sizes: &[f64],
    m: usize,
) -> [T; 2] {
    let mut largest = [T::ZERO; 2];
    for ((row, square), size) in inverse.chunks_exact(m).zip(squares).zip(sizes) {
        let of_row = row.iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum));
        largest[0] = T::larger(largest[0], of_row * *square);
        largest[1] = T::larger(largest[1], of_row * longer(*square, *size));
    }
    largest
}
