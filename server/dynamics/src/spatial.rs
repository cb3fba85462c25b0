//! Products of three-vectors and 3×3 matrices with fused multiply-add; nalgebra's types are the
//! containers.

pub(crate) mod triples;

use nalgebra::{Matrix3, Vector3};

use crate::scalar::Real;

/// Position of a frame: coordinates x of the frame become R x + p.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose<T> {
    pub(crate) R: Matrix3<T>,
    pub(crate) p: Vector3<T>,
}

impl<C: nalgebra::Scalar + Copy> Pose<C> {
    /// The same pose with every number converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Pose<D> {
        Pose { R: self.R.map(f), p: self.p.map(f) }
    }
}

impl<T: Real> Pose<T> {
    pub(crate) fn identity() -> Pose<T> {
        Pose { R: identity(), p: zero() }
    }

    /// x_a_c = x_a_b · x_b_c.
    #[inline(always)]
    pub(crate) fn then(&self, next: &Pose<T>) -> Pose<T> {
        Pose { R: mul_mat(&self.R, &next.R), p: self.point(&next.p) }
    }

    /// A point of the frame, seen from outside.
    #[inline(always)]
    pub(crate) fn point(&self, x: &Vector3<T>) -> Vector3<T> {
        mul_add(&self.R, x, &self.p)
    }

    /// x_b_a from x_a_b.
    pub(crate) fn inverse(&self) -> Pose<T> {
        Pose { R: self.R.transpose(), p: -t_mul(&self.R, &self.p) }
    }
}

#[inline(always)]
pub(crate) fn zero<T: Real>() -> Vector3<T> {
    Vector3::new(T::ZERO, T::ZERO, T::ZERO)
}

#[inline(always)]
pub(crate) fn identity<T: Real>() -> Matrix3<T> {
    Matrix3::new(T::ONE, T::ZERO, T::ZERO, T::ZERO, T::ONE, T::ZERO, T::ZERO, T::ZERO, T::ONE)
}

/// The same numbers in the scalar of the kernel.
#[inline(always)]
pub(crate) fn lift<T: Real>(v: &Vector3<T::Const>) -> Vector3<T> {
    Vector3::new(T::lift(v[0]), T::lift(v[1]), T::lift(v[2]))
}

/// The same numbers in the scalar of the kernel.
#[inline(always)]
pub(crate) fn lift_mat<T: Real>(m: &Matrix3<T::Const>) -> Matrix3<T> {
    m.map(T::lift)
}

/// a · b.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        a[1].mul_add(b[2], -(a[2] * b[1])),
        a[2].mul_add(b[0], -(a[0] * b[2])),
        a[0].mul_add(b[1], -(a[1] * b[0])),
    )
}

/// c + a × b.
#[inline(always)]
pub(crate) fn cross_add<T: Real>(a: &Vector3<T>, b: &Vector3<T>, c: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        a[1].mul_add(b[2], (-a[2]).mul_add(b[1], c[0])),
        a[2].mul_add(b[0], (-a[0]).mul_add(b[2], c[1])),
        a[0].mul_add(b[1], (-a[1]).mul_add(b[0], c[2])),
    )
}

/// c + a s.
#[inline(always)]
pub(crate) fn scale_add<T: Real>(a: &Vector3<T>, s: T, c: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a[0].mul_add(s, c[0]), a[1].mul_add(s, c[1]), a[2].mul_add(s, c[2]))
}

/// R x.
#[inline(always)]
pub(crate) fn mul<T: Real>(R: &Matrix3<T>, x: &Vector3<T>) -> Vector3<T> {
    let row = |i: usize| R[(i, 0)].mul_add(x[0], R[(i, 1)].mul_add(x[1], R[(i, 2)] * x[2]));
    Vector3::new(row(0), row(1), row(2))
}

/// R x + c.
#[inline(always)]
pub(crate) fn mul_add<T: Real>(R: &Matrix3<T>, x: &Vector3<T>, c: &Vector3<T>) -> Vector3<T> {
    let row =
        |i: usize| R[(i, 0)].mul_add(x[0], R[(i, 1)].mul_add(x[1], R[(i, 2)].mul_add(x[2], c[i])));
    Vector3::new(row(0), row(1), row(2))
}

/// Rᵀ x.
#[inline(always)]
pub(crate) fn t_mul<T: Real>(R: &Matrix3<T>, x: &Vector3<T>) -> Vector3<T> {
    let row = |i: usize| R[(0, i)].mul_add(x[0], R[(1, i)].mul_add(x[1], R[(2, i)] * x[2]));
    Vector3::new(row(0), row(1), row(2))
}

/// A B.
#[inline(always)]
pub(crate) fn mul_mat<T: Real>(A: &Matrix3<T>, B: &Matrix3<T>) -> Matrix3<T> {
    let column = |j: usize| mul(A, &Vector3::new(B[(0, j)], B[(1, j)], B[(2, j)]));
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

/// Column j of R.
#[inline(always)]
pub(crate) fn column<T: Real>(R: &Matrix3<T>, j: usize) -> Vector3<T> {
    Vector3::new(R[(0, j)], R[(1, j)], R[(2, j)])
}

/// E Rz(q) from the cosine and sine of q.
#[inline(always)]
pub(crate) fn turn_z<T: Real>(E: &Matrix3<T>, c: T, s: T) -> Matrix3<T> {
    let x = |i: usize| E[(i, 0)].mul_add(c, E[(i, 1)] * s);
    let y = |i: usize| E[(i, 1)].mul_add(c, -(E[(i, 0)] * s));
    Matrix3::new(x(0), y(0), E[(0, 2)], x(1), y(1), E[(1, 2)], x(2), y(2), E[(2, 2)])
}

/// Rotation matrix of a unit quaternion x, y, z, w.
#[inline(always)]
pub(crate) fn from_quaternion<T: Real>(x: T, y: T, z: T, w: T) -> Matrix3<T> {
    let two = T::from_f64(2.0);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, xz, yz, wx, wy, wz) = (x * y, x * z, y * z, w * x, w * y, w * z);
    Matrix3::new(
        T::ONE - two * (yy + zz),
        two * (xy - wz),
        two * (xz + wy),
        two * (xy + wz),
        T::ONE - two * (xx + zz),
        two * (yz - wx),
        two * (xz - wy),
        two * (yz + wx),
        T::ONE - two * (xx + yy),
    )
}

/// Quaternion x, y, z, w of a rotation matrix, w ≥ 0 (\[S78\]: the largest of four squares is
/// divided by).
pub(crate) fn to_quaternion<T: Real>(R: &Matrix3<T>) -> [T; 4] {
    let r = |i: usize, j: usize| R[(i, j)];
    // four times the squares of x, y, z, w
    let squares = [
        T::ONE + r(0, 0) - r(1, 1) - r(2, 2),
        T::ONE - r(0, 0) + r(1, 1) - r(2, 2),
        T::ONE - r(0, 0) - r(1, 1) + r(2, 2),
        T::ONE + r(0, 0) + r(1, 1) + r(2, 2),
    ];
    let (a, b, c) = (r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
    let (d, e, f) = (r(0, 1) + r(1, 0), r(0, 2) + r(2, 0), r(1, 2) + r(2, 1));
    let candidates = [
        [squares[0], d, e, a],
        [d, squares[1], f, b],
        [e, f, squares[2], c],
        [a, b, c, squares[3]],
    ];
    let (mut best, mut q) = (squares[3], candidates[3]);
    for k in 0..3 {
        for i in 0..4 {
            q[i] = T::select_lt(best, squares[k], candidates[k][i], q[i]);
        }
        best = T::select_lt(best, squares[k], squares[k], best);
    }
    let half = T::from_f64(0.5);
    let scale = half / best.sqrt();
    let sign = T::select_lt(q[3], T::ZERO, -scale, scale);
    q.map(|x| x * sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternion_and_matrix_are_inverse_to_each_other() {
        for [x, y, z, w] in [
            [0.5, 0.5, 0.5, 0.5],
            [0.1, -0.7, 0.7, 0.1],
            [0.99498743710662, 0.0, 0.0, 0.1],
            [0.0, 0.0, 0.6, 0.8],
        ] {
            let n = f64::sqrt(x * x + y * y + z * z + w * w);
            let q = [x / n, y / n, z / n, w / n];
            let back = to_quaternion(&from_quaternion(q[0], q[1], q[2], q[3]));
            for i in 0..4 {
                assert!((q[i] - back[i]).abs() < 4e-16, "{q:?} {back:?}");
            }
        }
    }
}
