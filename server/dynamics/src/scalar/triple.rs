//! Three numbers that are computed with together: what the recursions' vectors, matrices and
//! inertias are made of.
//!
//! Of doubles they stand in one register of four (`packed`), of other scalars beside each other;
//! each number is computed with as if it were alone, so that it has the same bits either way.

#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
mod packed;

#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
pub(super) use packed::{Packed as OfDoubles, Upper as SymmetricOfDoubles};
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
pub(super) type OfDoubles = Plain<f64>;
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
pub(super) type SymmetricOfDoubles = Six<f64>;

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Index, IndexMut, Neg, Sub, SubAssign};

use crate::scalar::Real;

/// Three numbers x, y, z; a matrix is three of them, its columns.
pub trait Triple<T>:
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
    /// The same number three times.
    fn splat(x: T) -> Self;
    /// The columns of a matrix.
    fn columns(matrix: [T; 9]) -> [Self; 3];
    /// self · a, number by number.
    fn times(self, a: Self) -> Self;
    /// self · a + b, number by number.
    fn fused(self, a: Self, b: Self) -> Self;
    /// self · a − b, number by number.
    fn fused_sub(self, a: Self, b: Self) -> Self;
    /// b − self · a, number by number.
    fn fused_from(self, a: Self, b: Self) -> Self;
    /// (y, z, x).
    fn yzx(self) -> Self;
    /// (z, x, y).
    fn zxy(self) -> Self;
    /// Rows of a matrix from its columns.
    fn transposed(columns: &[Self; 3]) -> [Self; 3];
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
    /// Adds what stands on and above the diagonal of a matrix.
    fn add_upper(&mut self, columns: &[T::Triple; 3]);
    /// Adds a bᵀ, of which it is known that it is symmetric.
    fn add_product(&mut self, a: &T::Triple, b: &T::Triple);
    /// R A Rᵀ.
    fn turned(&self, R: &[T::Triple; 3]) -> Self;
    /// A + 2 (b·p) 1 − b pᵀ − p bᵀ.
    fn shifted(&self, b: &T::Triple, p: &T::Triple) -> Self;
}

/// Three numbers beside each other.
#[derive(Clone, Copy, Debug)]
pub struct Plain<T>([T; 3]);

impl<T> Index<usize> for Plain<T> {
    type Output = T;
    #[inline(always)]
    fn index(&self, k: usize) -> &T {
        &self.0[k]
    }
}

impl<T> IndexMut<usize> for Plain<T> {
    #[inline(always)]
    fn index_mut(&mut self, k: usize) -> &mut T {
        &mut self.0[k]
    }
}

impl<T: Real> Add for Plain<T> {
    type Output = Plain<T>;
    #[inline(always)]
    fn add(self, b: Plain<T>) -> Plain<T> {
        Plain([self[0] + b[0], self[1] + b[1], self[2] + b[2]])
    }
}

impl<T: Real> Sub for Plain<T> {
    type Output = Plain<T>;
    #[inline(always)]
    fn sub(self, b: Plain<T>) -> Plain<T> {
        Plain([self[0] - b[0], self[1] - b[1], self[2] - b[2]])
    }
}

impl<T: Real> Neg for Plain<T> {
    type Output = Plain<T>;
    #[inline(always)]
    fn neg(self) -> Plain<T> {
        Plain(self.0.map(|x| -x))
    }
}

impl<T: Real> AddAssign for Plain<T> {
    #[inline(always)]
    fn add_assign(&mut self, b: Plain<T>) {
        *self = *self + b;
    }
}

impl<T: Real> SubAssign for Plain<T> {
    #[inline(always)]
    fn sub_assign(&mut self, b: Plain<T>) {
        *self = *self - b;
    }
}

impl<T: Real> Triple<T> for Plain<T> {
    #[inline(always)]
    fn new(x: T, y: T, z: T) -> Plain<T> {
        Plain([x, y, z])
    }
    #[inline(always)]
    fn splat(x: T) -> Plain<T> {
        Plain([x; 3])
    }
    #[inline(always)]
    fn columns([a, b, c, d, e, f, g, h, i]: [T; 9]) -> [Plain<T>; 3] {
        [Plain([a, b, c]), Plain([d, e, f]), Plain([g, h, i])]
    }
    #[inline(always)]
    fn times(self, a: Plain<T>) -> Plain<T> {
        Plain([self[0] * a[0], self[1] * a[1], self[2] * a[2]])
    }
    #[inline(always)]
    fn fused(self, a: Plain<T>, b: Plain<T>) -> Plain<T> {
        let of = |k: usize| self[k].mul_add(a[k], b[k]);
        Plain([of(0), of(1), of(2)])
    }
    #[inline(always)]
    fn fused_sub(self, a: Plain<T>, b: Plain<T>) -> Plain<T> {
        self.fused(a, -b)
    }
    #[inline(always)]
    fn fused_from(self, a: Plain<T>, b: Plain<T>) -> Plain<T> {
        (-self).fused(a, b)
    }
    #[inline(always)]
    fn yzx(self) -> Plain<T> {
        Plain([self[1], self[2], self[0]])
    }
    #[inline(always)]
    fn zxy(self) -> Plain<T> {
        Plain([self[2], self[0], self[1]])
    }
    #[inline(always)]
    fn transposed([a, b, c]: &[Plain<T>; 3]) -> [Plain<T>; 3] {
        [Plain([a[0], b[0], c[0]]), Plain([a[1], b[1], c[1]]), Plain([a[2], b[2], c[2]])]
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

impl<T: Real<Triple = Plain<T>>> Symmetric<T> for Six<T> {
    const ZERO: Six<T> = Six([T::ZERO; 6]);

    #[inline(always)]
    fn new(six: [T; 6]) -> Six<T> {
        Six(six)
    }

    #[inline(always)]
    fn column(&self, k: usize) -> Plain<T> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        match k {
            0 => Plain([xx, xy, xz]),
            1 => Plain([xy, yy, yz]),
            _ => Plain([xz, yz, zz]),
        }
    }

    #[inline(always)]
    fn add_to_diagonal(&mut self, x: T) {
        for k in [0, 3, 5] {
            self.0[k] += x;
        }
    }

    #[inline(always)]
    fn add_upper(&mut self, columns: &[Plain<T>; 3]) {
        for (x, (i, j)) in self.0.iter_mut().zip(SYMMETRIC) {
            *x += columns[j][i];
        }
    }

    #[inline(always)]
    fn add_product(&mut self, a: &Plain<T>, b: &Plain<T>) {
        for (x, (i, j)) in self.0.iter_mut().zip(SYMMETRIC) {
            *x = a[i].mul_add(b[j], *x);
        }
    }

    #[inline(always)]
    fn turned(&self, R: &[Plain<T>; 3]) -> Six<T> {
        // R A, then entries of (R A) Rᵀ
        let column = |k: usize| {
            let a = self.column(k);
            let of = |i: usize| R[0][i].mul_add(a[0], R[1][i].mul_add(a[1], R[2][i] * a[2]));
            [of(0), of(1), of(2)]
        };
        let (x, y, z) = (column(0), column(1), column(2));
        let entry =
            |i: usize, j: usize| x[i].mul_add(R[0][j], y[i].mul_add(R[1][j], z[i] * R[2][j]));
        Six([entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)])
    }

    #[inline(always)]
    fn shifted(&self, b: &Plain<T>, p: &Plain<T>) -> Six<T> {
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
