//! The numbers that every kernel is written over.

mod abreast;
mod counted;
mod double_double;
mod dual;
mod elementary;
mod figure;
mod lanes;
mod noise;
mod single;
mod stochastic;
mod triple;

pub(crate) use abreast::{Abreast, Marks};
pub use counted::Counted;
pub use double_double::Dd;
pub use dual::Dual;
pub use figure::{DOUBTFUL, Figure};
pub use lanes::LANES;
pub(crate) use lanes::{FUSED, Lanes};
pub(crate) use noise::noise;
pub(crate) use stochastic::Stochastic;
pub use triple::{Plain, Six, Symmetric, Triple};

use core::array;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

/// A real number as kernels see it: `f64`, `f32`, double-double, dual numbers, lanes of doubles.
///
/// Kernels never branch on a value: comparisons give a [`Mask`], choices are made by
/// [`Real::select`].
pub trait Real:
    Copy
    + Debug
    + PartialEq
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
    /// The outcome of a comparison, one bit for each lane.
    type Mask: Mask;
    /// The scalar in which the model's constants are kept.
    type Const: Copy + Debug + PartialEq + Send + Sync + 'static;
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

    /// A constant of the model, the same in all lanes.
    fn lift(constant: Self::Const) -> Self;
    /// An exactly representable number, the same in all lanes.
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
    fn lt(self, other: Self) -> Self::Mask;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> Self::Mask;
    /// `a` where the mask is set, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// `a` where x < y, else `b`: the choice of kernels on the straight path. Of states abreast
    /// each gets its own by it, whereas a mask is that of the first.
    #[inline(always)]
    fn select_lt(x: Self, y: Self, a: Self, b: Self) -> Self {
        Self::select(x.lt(y), a, b)
    }
}

/// The outcome of a comparison, one bit for each lane.
pub trait Mask:
    Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// The same outcome in all lanes.
    fn splat(value: bool) -> Self;
    /// Set in every lane.
    fn all(self) -> bool;
    /// Set in some lane.
    fn any(self) -> bool;
}

impl Mask for bool {
    #[inline(always)]
    fn splat(value: bool) -> bool {
        value
    }
    #[inline(always)]
    fn all(self) -> bool {
        self
    }
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
}

/// True where every number is finite in every lane. None ends the loop early, so that the compiler
/// takes several at once.
#[inline]
pub(crate) fn all_finite<T: Real>(x: &[T]) -> bool {
    x.iter().fold(T::Mask::splat(true), |all, x| all & x.is_finite()).all()
}

/// A scalar of one lane: code off the straight path may branch on it.
pub trait Scalar: Real<Mask = bool, Const = Self> + PartialOrd {
    /// Whether doubtful answers are computed again to count their digits; elsewhere the doubt alone
    /// decides.
    const PROBED: bool = false;
    /// Whether one run stands for others, so that rows change places by [`Real::select`] and not by
    /// a branch.
    const STRAIGHT: bool = false;

    /// The larger one; this one where either is no number.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self::select_lt(self, other, other, self)
    }

    /// The nearest double.
    fn to_f64(self) -> f64;

    /// The nearest double, by which a plan decides what `figure` says; a scalar that records what
    /// is done takes note.
    #[inline(always)]
    fn to_figure(self, _figure: Figure) -> f64 {
        self.to_f64()
    }

    /// The same number, but 0 for −0: what an answer has, so that no sign of a zero hangs on the
    /// order in which a kernel adds nothing to it.
    #[inline(always)]
    fn plus_zero(self) -> Self {
        self + Self::ZERO
    }
}

/// Four of up to four numbers.
#[inline(always)]
fn filled<const N: usize>(x: [f64; N]) -> [f64; 4] {
    array::from_fn(|k| x.get(k).copied().unwrap_or(1.0))
}

impl Real for f64 {
    type Mask = bool;
    type Const = f64;
    type Triple = triple::OfDoubles;
    type Symmetric = triple::SymmetricOfDoubles;

    const ZERO: f64 = 0.0;
    const ONE: f64 = 1.0;
    const EPSILON: f64 = f64::EPSILON / 2.0;
    const TOGETHER: bool = FUSED;

    #[inline(always)]
    fn lift(constant: f64) -> f64 {
        constant
    }
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
        let (sines, cosines) = Lanes::from(filled(angles)).sin_cos();
        let (sines, cosines): ([f64; 4], [f64; 4]) = (sines.into(), cosines.into());
        array::from_fn(|k| (sines[k], cosines[k]))
    }
    #[inline]
    fn angles_of<const N: usize>(points: [(f64, f64); N]) -> [f64; N] {
        if !(Self::TOGETHER && matches!(N, 2..=4)) {
            return points.map(|(x, y)| elementary::atan2(y, x));
        }
        let (x, y) = (points.map(|point| point.0), points.map(|point| point.1));
        let angles: [f64; 4] = Lanes::from(filled(y)).atan2(Lanes::from(filled(x))).into();
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
    fn select(mask: bool, a: f64, b: f64) -> f64 {
        if mask { a } else { b }
    }
}

impl Scalar for f64 {
    const PROBED: bool = true;

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}
