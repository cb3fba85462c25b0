//! Vectors and 3×3 matrices: the container is nalgebra's, the products are those of [`Triple`] and
//! [`Matrix`], with fused multiply-add. They take arguments by value, so that no call resolves to a
//! product of nalgebra, which takes references and rounds twice.

use core::array;

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Real, Triple, constants};

/// A matrix as the recursions hold it: three columns.
pub(crate) type Columns<T> = [<T as Real>::Triple; 3];

/// A 3×3 matrix by its columns.
pub(crate) trait Matrix<T: Real>: Copy {
    /// A column.
    type Vector: Triple<T>;

    /// From its columns.
    fn of_columns(columns: [Self::Vector; 3]) -> Self;
    /// Column k.
    fn col(&self, k: usize) -> Self::Vector;
    /// 1.
    #[inline(always)]
    fn identity() -> Self {
        let unit = |k: usize| {
            let mut e = Self::Vector::zero();
            e[k] = T::ONE;
            e
        };
        Self::of_columns([unit(0), unit(1), unit(2)])
    }
    /// R x.
    #[inline(always)]
    fn apply(&self, x: Self::Vector) -> Self::Vector {
        let [x, y, z] = x.spread();
        self.col(0).mul_add(x, self.col(1).mul_add(y, self.col(2).times(z)))
    }
    /// R x + c.
    #[inline(always)]
    fn apply_add(&self, x: Self::Vector, c: Self::Vector) -> Self::Vector {
        let [x, y, z] = x.spread();
        self.col(0).mul_add(x, self.col(1).mul_add(y, self.col(2).mul_add(z, c)))
    }
    /// Rᵀ.
    #[inline(always)]
    fn rows(&self) -> Self {
        Self::of_columns(Triple::transposed(&[self.col(0), self.col(1), self.col(2)]))
    }
    /// Rᵀ x.
    #[inline(always)]
    fn apply_transposed(&self, x: Self::Vector) -> Self::Vector {
        self.rows().apply(x)
    }
    /// A B.
    #[inline(always)]
    fn times(&self, B: Self) -> Self {
        Self::of_columns(array::from_fn(|k| self.apply(B.col(k))))
    }
    /// E Rz(q) from the cosine and sine of q.
    #[inline(always)]
    fn turn_z(&self, cos: T, sin: T) -> Self {
        let x = self.col(0);
        let y = self.col(1);
        let c = Triple::splat(cos);
        let s = Triple::splat(sin);
        Self::of_columns([x.mul_add(c, y.times(s)), y.mul_sub(c, x.times(s)), self.col(2)])
    }
}

impl<T: Real, V: Triple<T>> Matrix<T> for [V; 3] {
    type Vector = V;

    #[inline(always)]
    fn of_columns(columns: [V; 3]) -> [V; 3] {
        columns
    }
    #[inline(always)]
    fn col(&self, k: usize) -> V {
        self[k]
    }
}

impl<T: Real> Matrix<T> for Matrix3<T> {
    type Vector = Vector3<T>;

    #[inline(always)]
    fn of_columns(columns: [Vector3<T>; 3]) -> Matrix3<T> {
        Matrix3::from_columns(&columns)
    }
    #[inline(always)]
    fn col(&self, k: usize) -> Vector3<T> {
        Vector3::new(self[(0, k)], self[(1, k)], self[(2, k)])
    }
}

/// Position of a frame: coordinates x of the frame become R x + p.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose<T> {
    pub(crate) R: Matrix3<T>,
    pub(crate) p: Vector3<T>,
}

constants! { Pose:
    map R p;
}

impl<T: Real> Pose<T> {
    pub(crate) fn identity() -> Pose<T> {
        Pose { R: Matrix::identity(), p: zero() }
    }

    /// The pose whose axes and origin a recursion holds.
    #[inline(always)]
    pub(crate) fn of(R: &Columns<T>, p: &T::Triple) -> Pose<T> {
        Pose { R: Matrix3::from_columns(&R.map(|x| x.vector())), p: p.vector() }
    }

    /// x_a_c = x_a_b · x_b_c.
    #[inline(always)]
    pub(crate) fn then(&self, next: &Pose<T>) -> Pose<T> {
        Pose { R: self.R.times(next.R), p: self.point(&next.p) }
    }

    /// A point of the frame, seen from outside.
    #[inline(always)]
    pub(crate) fn point(&self, x: &Vector3<T>) -> Vector3<T> {
        self.R.apply_add(*x, self.p)
    }

    /// x_b_a from x_a_b.
    pub(crate) fn inverse(&self) -> Pose<T> {
        Pose { R: self.R.transpose(), p: -self.R.apply_transposed(self.p) }
    }
}

/// A spatial vector at a fixed origin: a motion [ω; v] or a force [n; f].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spatial<T: Real> {
    pub(crate) a: T::Triple,
    pub(crate) l: T::Triple,
}

impl<T: Real> Spatial<T> {
    #[inline(always)]
    pub(crate) fn zero() -> Spatial<T> {
        Spatial { a: T::Triple::zero(), l: T::Triple::zero() }
    }

    /// The motion of a turn about, or a slide along, an axis through a point.
    #[inline(always)]
    pub(crate) fn joint(axis: T::Triple, point: T::Triple, slides: bool) -> Spatial<T> {
        if slides {
            Spatial { a: T::Triple::zero(), l: axis }
        } else {
            Spatial { a: axis, l: point.cross(axis) }
        }
    }

    /// self + b s.
    #[inline(always)]
    pub(crate) fn add_scaled(self, b: Spatial<T>, s: T) -> Spatial<T> {
        Spatial { a: self.a.add_scaled(b.a, s), l: self.l.add_scaled(b.l, s) }
    }

    /// self + b.
    #[inline(always)]
    pub(crate) fn plus(self, b: Spatial<T>) -> Spatial<T> {
        Spatial { a: self.a + b.a, l: self.l + b.l }
    }

    /// self − b.
    #[inline(always)]
    pub(crate) fn minus(self, b: Spatial<T>) -> Spatial<T> {
        Spatial { a: self.a - b.a, l: self.l - b.l }
    }

    /// Motion × motion [F08, 2.33].
    #[inline(always)]
    pub(crate) fn cross(self, m: Spatial<T>) -> Spatial<T> {
        Spatial { a: self.a.cross(m.a), l: self.a.cross(m.l).add_cross(self.l, m.a) }
    }

    /// Motion ×* force [F08, 2.34].
    #[inline(always)]
    pub(crate) fn cross_force(self, f: Spatial<T>) -> Spatial<T> {
        Spatial { a: self.a.cross(f.a).add_cross(self.l, f.l), l: self.a.cross(f.l) }
    }

    /// Power of a force along a motion.
    #[inline(always)]
    pub(crate) fn dot(self, f: Spatial<T>) -> T {
        total(self.along(f, T::Triple::zero()))
    }

    /// The products of the power, added to others.
    #[inline(always)]
    pub(crate) fn along(self, f: Spatial<T>, others: T::Triple) -> T::Triple {
        self.l.mul_add(f.l, self.a.mul_add(f.a, others))
    }

    /// Velocity of the point that moves with the body.
    #[inline(always)]
    pub(crate) fn at(self, point: T::Triple) -> T::Triple {
        self.l.add_cross(self.a, point)
    }
}

/// x + y + z.
#[inline(always)]
pub(crate) fn total<T: Real, V: Triple<T>>(x: V) -> T {
    x[0] + x[1] + x[2]
}

/// The zero vector.
#[inline(always)]
pub(crate) fn zero<T: Real>() -> Vector3<T> {
    Triple::zero()
}

/// A [p]×ᵀ, whose row i is p × (row i of A).
#[inline(always)]
pub(crate) fn cross_rows<T: Real, V: Triple<T>>(p: V, A: &[V; 3]) -> [V; 3] {
    let [x, y, z] = p.spread();
    [y.mul_sub(A[2], z.times(A[1])), z.mul_sub(A[0], x.times(A[2])), x.mul_sub(A[1], y.times(A[0]))]
}

/// Rotation matrix of a unit quaternion x, y, z, w.
#[inline(always)]
pub(crate) fn from_quaternion<T: Real>(x: T, y: T, z: T, w: T) -> Matrix3<T> {
    let two = T::from_f64(2.0);
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    let xy = x * y;
    let xz = x * z;
    let yz = y * z;
    let wx = w * x;
    let wy = w * y;
    let wz = w * z;
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
    let a = r(2, 1) - r(1, 2);
    let b = r(0, 2) - r(2, 0);
    let c = r(1, 0) - r(0, 1);
    let d = r(0, 1) + r(1, 0);
    let e = r(0, 2) + r(2, 0);
    let f = r(1, 2) + r(2, 1);
    let candidates = [
        [squares[0], d, e, a],
        [d, squares[1], f, b],
        [e, f, squares[2], c],
        [a, b, c, squares[3]],
    ];
    let mut best = squares[3];
    let mut q = candidates[3];
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
