//! The numbers that every kernel is written over.

/// `+=`, `-=` and `*=` of a scalar, by its `+`, `-` and `*`.
#[macro_export]
macro_rules! assigned {
    ($scalar:ty $(, $S:ident: $bound:path)?) => {
        impl $(<$S: $bound>)? core::ops::AddAssign for $scalar {
            #[inline(always)]
            fn add_assign(&mut self, other: $scalar) {
                *self = *self + other;
            }
        }

        impl $(<$S: $bound>)? core::ops::SubAssign for $scalar {
            #[inline(always)]
            fn sub_assign(&mut self, other: $scalar) {
                *self = *self - other;
            }
        }

        impl $(<$S: $bound>)? core::ops::MulAssign for $scalar {
            #[inline(always)]
            fn mul_assign(&mut self, other: $scalar) {
                *self = *self * other;
            }
        }
    };
}

mod branch_value;
mod constants;
mod double_double;
mod dual;
mod elementary;
mod lanes;
mod noise;
mod packet;
mod triple;

pub use branch_value::{BranchValue, DOUBTFUL};
pub(crate) use constants::{Each, constants};
pub use double_double::Dd;
pub use dual::Dual;
pub(crate) use lanes::FUSED;
pub(crate) use noise::noise;
pub use packet::LANES;
pub(crate) use packet::{Divergence, Packet};
pub use triple::{Plain, Six, Symmetric, Triple};

use core::array;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use wide::f64x4;

/// A real number as kernels see it: `f64` and its packet of several states, double-double, dual
/// and counting numbers.
///
/// Kernels choose between numbers by [`Real::select`] and [`Real::select_lt`]. They branch on a
/// comparison only if all states of a packet must take the same branch or be answered one by one.
pub trait Real:
    Copy
    + Debug
    + PartialEq
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// Three numbers, [`Plain`] unless the processor takes them together.
    type Triple: Triple<Self>;
    /// A symmetric matrix, [`Six`] with [`Plain`].
    type Symmetric: Symmetric<Self>;

    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Unit roundoff: the largest relative error of one operation.
    const EPSILON: f64;
    /// Whether several angles cost less together than one by one.
    const TOGETHER: bool = false;
    /// Whether doubtful answers are compared with double-double; elsewhere the doubt alone decides.
    const PROBED: bool = false;
    /// Whether one run stands for others, so that rows change places by [`Real::select`] and not by
    /// a branch.
    const STRAIGHT: bool = false;
    /// Whether the operations of one run serve other poses: pivots are those of each.
    const RECORDED: bool = false;
    /// Whether kernels are compiled for each small width and for joints in series. Rare scalars do
    /// without, since each copy takes time to compile.
    const UNROLLED: bool = false;

    /// An exactly representable number.
    fn from_f64(x: f64) -> Self;
    /// self · a + b, rounded once where the scalar can.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Square root; NaN below zero.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// (sin x, cos x), x in radians.
    fn sin_cos(self) -> (Self, Self);
    /// The angle of the point (x, self) in (−π, π].
    fn atan2(self, x: Self) -> Self;
    /// (sin x, cos x) of several angles, the bits of each alone.
    #[inline(always)]
    fn sin_cos_of<const N: usize>(angles: [Self; N]) -> [(Self, Self); N] {
        angles.map(Self::sin_cos)
    }
    /// The angles of several points (x, y), the bits of each alone.
    #[inline(always)]
    fn angles_of<const N: usize>(points: [(Self, Self); N]) -> [Self; N] {
        points.map(|(x, y)| y.atan2(x))
    }
    /// self < other.
    fn lt(self, other: Self) -> bool;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> bool;
    /// Zero at every pose that a recorded run serves; not known elsewhere.
    #[inline(always)]
    fn is_always_zero(self) -> bool {
        false
    }
    /// `a` if the condition holds, else `b`.
    fn select(condition: bool, a: Self, b: Self) -> Self;
    /// `a` where x < y, else `b`. Each state of a packet chooses for itself, whereas the outcome of
    /// [`Real::lt`] is that of the first state.
    #[inline(always)]
    fn select_lt(x: Self, y: Self, a: Self, b: Self) -> Self {
        Self::select(x.lt(y), a, b)
    }
    /// The larger one; this one where either is NaN.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self::select_lt(self, other, other, self)
    }
    /// The nearest whole number, of numbers up to 2^51; its derivative is zero.
    #[inline(always)]
    fn nearest_whole(self) -> Self {
        // doubles from 2^52 on are whole
        let large = Self::from_f64(1.5 * (1_u64 << 52) as f64);
        self + large - large
    }
    /// The nearest double.
    fn to_f64(self) -> f64;
    /// The nearest double, on which a plan branches as `value` describes; a scalar that records its
    /// operations takes note.
    #[inline(always)]
    fn to_branch_value(self, _value: BranchValue) -> f64 {
        self.to_f64()
    }
    /// Hyperbolic tangent, of few operations that every scalar has: the continued fraction of
    /// Lambert at a 128th of the number, then tanh 2x = 2 tanh x / (1 + tanh² x).
    fn tanh(self) -> Self {
        const FAR: f64 = 40.0;
        const HALVES: u32 = 7;
        let far = Self::from_f64(FAR);
        let x = Self::select_lt(far, self, far, Self::select_lt(self, -far, -far, self));
        let x = x * Self::from_f64(1.0 / f64::from(1 << HALVES));
        let square = x * x;
        let mut below = Self::from_f64(25.0);
        for odd in (1..25).rev().step_by(2) {
            below = Self::from_f64(f64::from(odd - 1)) + square / below;
        }
        let mut tanh = x / below;
        for _ in 0..HALVES {
            tanh = (tanh + tanh) / tanh.mul_add(tanh, Self::ONE);
        }
        tanh
    }
    /// This number, but 0 for −0: no sign of a zero in an answer depends on the order in which
    /// a kernel adds zeros to it.
    #[inline(always)]
    fn plus_zero(self) -> Self {
        self + Self::ZERO
    }
}

/// True if every number is finite. The loop does not end early, so that the compiler takes several
/// numbers at once.
#[inline]
pub(crate) fn all_finite<T: Real>(x: &[T]) -> bool {
    x.iter().fold(true, |all, x| all & x.is_finite())
}

/// A register of up to four numbers, filled up with ones.
#[inline(always)]
fn filled<const N: usize>(x: [f64; N]) -> f64x4 {
    f64x4::new(array::from_fn(|k| x.get(k).copied().unwrap_or(1.0)))
}

impl Real for f64 {
    type Triple = triple::OfDoubles;
    type Symmetric = triple::SymmetricOfDoubles;

    const ZERO: f64 = 0.0;
    const ONE: f64 = 1.0;
    const EPSILON: f64 = f64::EPSILON / 2.0;
    const TOGETHER: bool = FUSED;
    const PROBED: bool = true;
    const UNROLLED: bool = true;

    #[inline(always)]
    fn from_f64(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn mul_add(self, a: f64, b: f64) -> f64 {
        f64::mul_add(self, a, b)
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline]
    fn sin_cos(self) -> (f64, f64) {
        elementary::sin_cos(self)
    }
    #[inline]
    fn atan2(self, x: f64) -> f64 {
        elementary::atan2(self, x)
    }
    #[inline]
    fn sin_cos_of<const N: usize>(angles: [f64; N]) -> [(f64, f64); N] {
        if !(Self::TOGETHER && matches!(N, 2..=4)) {
            return angles.map(elementary::sin_cos);
        }
        let (sines, cosines) = elementary::sin_cos(filled(angles));
        let sines = sines.to_array();
        let cosines = cosines.to_array();
        array::from_fn(|k| (sines[k], cosines[k]))
    }
    #[inline]
    fn angles_of<const N: usize>(points: [(f64, f64); N]) -> [f64; N] {
        if !(Self::TOGETHER && matches!(N, 2..=4)) {
            return points.map(|(x, y)| elementary::atan2(y, x));
        }
        let x = filled(points.map(|point| point.0));
        let y = filled(points.map(|point| point.1));
        let angles = elementary::atan2(y, x).to_array();
        array::from_fn(|k| angles[k])
    }
    #[inline(always)]
    fn lt(self, other: f64) -> bool {
        self < other
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
    #[inline(always)]
    fn select(condition: bool, a: f64, b: f64) -> f64 {
        if condition { a } else { b }
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}
