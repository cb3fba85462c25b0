//! Three numbers in one operation: the vectors, columns of matrices and inertias of the recursions.
//!
//! Doubles share one register of four (`packed`), other scalars form an array. Each number is
//! computed as if alone, so both give the same bits.

#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
mod packed;

#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
pub(super) use packed::{Packed as OfDoubles, Upper as SymmetricOfDoubles};
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
pub(super) type OfDoubles = Plain<f64>;
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
pub(super) type SymmetricOfDoubles = Six<f64>;

use core::array;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Index, IndexMut, Neg, Sub, SubAssign};

use nalgebra::{Matrix3, Vector3};

use crate::scalar::Real;

/// Three numbers x, y, z.
///
/// Vectors are passed by value, so a call cannot resolve to nalgebra's `dot` or `cross`, which
/// round twice and take references.
pub trait Triple<T: Real>:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Index<usize, Output = T>
    + IndexMut<usize>
{
    /// From its numbers.
    fn new(x: T, y: T, z: T) -> Self;
    /// One number three times.
    fn splat(x: T) -> Self;
    /// The columns of a matrix, whose numbers are given column by column.
    fn columns_from(matrix: [T; 9]) -> [Self; 3];
    /// self · a, number by number.
    fn times(self, a: Self) -> Self;
    /// self · a + b, number by number.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// self · a − b, number by number.
    fn mul_sub(self, a: Self, b: Self) -> Self;
    /// b − self · a, number by number.
    fn neg_mul_add(self, a: Self, b: Self) -> Self;
    /// (y, z, x).
    fn rotate_left(self) -> Self;
    /// (z, x, y).
    fn rotate_right(self) -> Self;
    /// Rows of a matrix from its columns.
    fn transposed(columns: &[Self; 3]) -> [Self; 3];

    /// 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(T::ZERO)
    }
    /// From nalgebra's vector.
    #[inline(always)]
    fn of(v: &Vector3<T>) -> Self {
        Self::new(v[0], v[1], v[2])
    }
    /// As nalgebra's vector.
    #[inline(always)]
    fn vector(self) -> Vector3<T> {
        Vector3::new(self[0], self[1], self[2])
    }
    /// The columns of nalgebra's matrix.
    #[inline(always)]
    fn columns_of(matrix: &Matrix3<T>) -> [Self; 3] {
        Self::columns_from(array::from_fn(|k| matrix[k]))
    }
    /// Each number three times.
    #[inline(always)]
    fn spread(self) -> [Self; 3] {
        [Self::splat(self[0]), Self::splat(self[1]), Self::splat(self[2])]
    }
    /// self · b.
    #[inline(always)]
    fn dot(self, b: Self) -> T {
        self[0].mul_add(b[0], self[1].mul_add(b[1], self[2] * b[2]))
    }
    /// self × b.
    #[inline(always)]
    fn cross(self, b: Self) -> Self {
        // z, x, y of the product
        self.mul_sub(b.rotate_left(), self.rotate_left().times(b)).rotate_left()
    }
    /// self + a × b.
    #[inline(always)]
    fn add_cross(self, a: Self, b: Self) -> Self {
        let rest = a.rotate_right().neg_mul_add(b.rotate_left(), self);
        a.rotate_left().mul_add(b.rotate_right(), rest)
    }
    /// self + a s.
    #[inline(always)]
    fn add_scaled(self, a: Self, s: T) -> Self {
        a.mul_add(Self::splat(s), self)
    }
}

/// A symmetric matrix.
pub trait Symmetric<T: Real>: Copy + Debug + Send + Sync + 'static + AddAssign {
    /// 0.
    const ZERO: Self;

    /// From xx xy xz yy yz zz.
    fn new(six: [T; 6]) -> Self;
    /// Column k.
    fn column(&self, k: usize) -> T::Triple;
    /// Adds x to the diagonal.
    fn add_to_diagonal(&mut self, x: T);
    /// Adds the upper triangle of a matrix.
    fn add_upper(&mut self, columns: &[T::Triple; 3]);
    /// Adds a bᵀ, which has to be symmetric.
    fn add_product(&mut self, a: &T::Triple, b: &T::Triple);
    /// R A Rᵀ.
    fn rotate(&self, R: &[T::Triple; 3]) -> Self;
    /// A + 2 (b·p) 1 − b pᵀ − p bᵀ.
    fn parallel_axis(&self, b: &T::Triple, p: &T::Triple) -> Self;
}

/// Three numbers side by side.
pub type Plain<T> = Vector3<T>;

impl<T: Real> Triple<T> for Vector3<T> {
    #[inline(always)]
    fn new(x: T, y: T, z: T) -> Vector3<T> {
        Vector3::new(x, y, z)
    }
    #[inline(always)]
    fn splat(x: T) -> Vector3<T> {
        Vector3::new(x, x, x)
    }
    #[inline(always)]
    fn columns_from([a, b, c, d, e, f, g, h, i]: [T; 9]) -> [Vector3<T>; 3] {
        [Vector3::new(a, b, c), Vector3::new(d, e, f), Vector3::new(g, h, i)]
    }
    #[inline(always)]
    fn times(self, a: Vector3<T>) -> Vector3<T> {
        Vector3::new(self[0] * a[0], self[1] * a[1], self[2] * a[2])
    }
    #[inline(always)]
    fn mul_add(self, a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        let of = |k: usize| self[k].mul_add(a[k], b[k]);
        Vector3::new(of(0), of(1), of(2))
    }
    #[inline(always)]
    fn mul_sub(self, a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        self.mul_add(a, -b)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        (-self).mul_add(a, b)
    }
    #[inline(always)]
    fn rotate_left(self) -> Vector3<T> {
        Vector3::new(self[1], self[2], self[0])
    }
    #[inline(always)]
    fn rotate_right(self) -> Vector3<T> {
        Vector3::new(self[2], self[0], self[1])
    }
    #[inline(always)]
    fn transposed([a, b, c]: &[Vector3<T>; 3]) -> [Vector3<T>; 3] {
        [
            Vector3::new(a[0], b[0], c[0]),
            Vector3::new(a[1], b[1], c[1]),
            Vector3::new(a[2], b[2], c[2]),
        ]
    }
}

/// Where xx xy xz yy yz zz stand.
const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// A symmetric matrix as xx xy xz yy yz zz.
#[derive(Clone, Copy, Debug)]
pub struct Six<T>([T; 6]);

impl<T: Real> AddAssign for Six<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Six<T>) {
        for (x, y) in self.0.iter_mut().zip(other.0) {
            *x += y;
        }
    }
}

impl<T: Real<Triple = Vector3<T>>> Symmetric<T> for Six<T> {
    const ZERO: Six<T> = Six([T::ZERO; 6]);

    #[inline(always)]
    fn new(six: [T; 6]) -> Six<T> {
        Six(six)
    }

    #[inline(always)]
    fn column(&self, k: usize) -> Vector3<T> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        match k {
            0 => Vector3::new(xx, xy, xz),
            1 => Vector3::new(xy, yy, yz),
            _ => Vector3::new(xz, yz, zz),
        }
    }

    #[inline(always)]
    fn add_to_diagonal(&mut self, x: T) {
        for k in [0, 3, 5] {
            self.0[k] += x;
        }
    }

    #[inline(always)]
    fn add_upper(&mut self, columns: &[Vector3<T>; 3]) {
        for (x, (i, j)) in self.0.iter_mut().zip(SYMMETRIC) {
            *x += columns[j][i];
        }
    }

    #[inline(always)]
    fn add_product(&mut self, a: &Vector3<T>, b: &Vector3<T>) {
        for (x, (i, j)) in self.0.iter_mut().zip(SYMMETRIC) {
            *x = a[i].mul_add(b[j], *x);
        }
    }

    #[inline(always)]
    fn rotate(&self, R: &[Vector3<T>; 3]) -> Six<T> {
        // R A, then entries of (R A) Rᵀ
        let column = |k: usize| {
            let a = self.column(k);
            let of = |i: usize| R[0][i].mul_add(a[0], R[1][i].mul_add(a[1], R[2][i] * a[2]));
            [of(0), of(1), of(2)]
        };
        let x = column(0);
        let y = column(1);
        let z = column(2);
        let entry =
            |i: usize, j: usize| x[i].mul_add(R[0][j], y[i].mul_add(R[1][j], z[i] * R[2][j]));
        Six([entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)])
    }

    #[inline(always)]
    fn parallel_axis(&self, b: &Vector3<T>, p: &Vector3<T>) -> Six<T> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        let products = [b[0] * p[0], b[1] * p[1], b[2] * p[2]];
        let mixed = |i: usize, j: usize| -(b[i].mul_add(p[j], p[i] * b[j]));
        let two = T::from_f64(2.0);
        Six([
            two.mul_add(products[1] + products[2], xx),
            xy + mixed(0, 1),
            xz + mixed(0, 2),
            two.mul_add(products[0] + products[2], yy),
            yz + mixed(1, 2),
            two.mul_add(products[0] + products[1], zz),
        ])
    }
}
