//! Several doubles side by side, one operation on all of them at once.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use wide::{bytemuck, f64x4, f64x8, u64x4, u64x8};

use crate::scalar::elementary::{self, Lane};
use crate::scalar::{Mask, Plain, Real, Six};

/// How many states go abreast: 8 where AVX-512 is compiled for, else 4, be it in one register or
/// in two.
pub const LANES: usize = if cfg!(target_feature = "avx512f") { 8 } else { 4 };

/// True where every operation on lanes is one of the processor's and rounds as the single one does;
/// elsewhere a fused product is two operations.
pub(crate) const FUSED: bool = cfg!(any(
    all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"),
    target_arch = "aarch64"
));

/// N doubles, each of which is computed with as if it were alone: with fused multiply-add at
/// compile time the bits of every lane are those of `f64`. N is 4 or 8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes<const N: usize>(<Width<N> as Packed>::Vector)
where
    Width<N>: Packed;

/// The outcome of a comparison in each of N lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneMask<const N: usize>(<Width<N> as Packed>::Vector)
where
    Width<N>: Packed;

/// A number of lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Width<const N: usize>;

/// A number of lanes for which there are registers.
pub(crate) trait Packed:
    Copy + core::fmt::Debug + PartialEq + Send + Sync + 'static
{
    /// The registers.
    type Vector: Vector;
}

/// Registers of doubles; a mask has all bits of a lane set, or none.
pub(crate) trait Vector:
    Copy
    + core::fmt::Debug
    + PartialEq
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + Not<Output = Self>
{
    /// 0 in all lanes.
    const ZERO: Self;
    /// 1 in all lanes.
    const ONE: Self;
    /// The same in all lanes.
    fn splat(x: f64) -> Self;
    /// self · a + b.
    fn fused(self, a: Self, b: Self) -> Self;
    /// Square root.
    fn root(self) -> Self;
    /// Without the sign.
    fn absolute(self) -> Self;
    /// The mask of self < other.
    fn less(self, other: Self) -> Self;
    /// The mask of self = other.
    fn equal(self, other: Self) -> Self;
    /// `a` where this mask is set, else `b`.
    fn blend(self, a: Self, b: Self) -> Self;
    /// One bit for each lane of this mask, lane 0 the lowest.
    fn bits(self) -> u32;
    /// As [`Lane::sign_from_bit`].
    fn sign_from_bit(self, k: u32) -> Self;
    /// As [`Lane::xor_sign`].
    fn xor_sign(self, sign: Self) -> Self;
}

/// As many numbers as lanes.
pub(crate) trait Transposed<const N: usize>: Sized {
    /// The k-th has lane k of the first, of the second and so on.
    fn transposed(numbers: [Self; N]) -> [Self; N];
}

macro_rules! vector {
    ($lanes:literal, $vector:ident, $bits:ident) => {
        impl Packed for Width<$lanes> {
            type Vector = $vector;
        }

        impl From<[f64; $lanes]> for Lanes<$lanes> {
            #[inline(always)]
            fn from(lanes: [f64; $lanes]) -> Lanes<$lanes> {
                Lanes($vector::new(lanes))
            }
        }

        impl From<Lanes<$lanes>> for [f64; $lanes] {
            #[inline(always)]
            fn from(lanes: Lanes<$lanes>) -> [f64; $lanes] {
                lanes.0.to_array()
            }
        }

        impl Transposed<$lanes> for Lanes<$lanes> {
            #[inline(always)]
            fn transposed(numbers: [Lanes<$lanes>; $lanes]) -> [Lanes<$lanes>; $lanes] {
                $vector::transpose(numbers.map(|x| x.0)).map(Lanes)
            }
        }

        impl Vector for $vector {
            const ZERO: $vector = $vector::splat(0.0);
            const ONE: $vector = $vector::splat(1.0);

            #[inline(always)]
            fn splat(x: f64) -> $vector {
                $vector::splat(x)
            }
            #[inline(always)]
            fn fused(self, a: $vector, b: $vector) -> $vector {
                self.mul_add(a, b)
            }
            #[inline(always)]
            fn root(self) -> $vector {
                self.sqrt()
            }
            #[inline(always)]
            fn absolute(self) -> $vector {
                self.abs()
            }
            #[inline(always)]
            fn less(self, other: $vector) -> $vector {
                self.simd_lt(other)
            }
            #[inline(always)]
            fn equal(self, other: $vector) -> $vector {
                self.simd_eq(other)
            }
            #[inline(always)]
            fn blend(self, a: $vector, b: $vector) -> $vector {
                self.select(a, b)
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                self.to_bitmask()
            }
            #[inline(always)]
            fn sign_from_bit(self, k: u32) -> $vector {
                let bits: $bits = bytemuck::cast(self);
                bytemuck::cast(bits << u64::from(63 - k))
            }
            #[inline(always)]
            fn xor_sign(self, sign: $vector) -> $vector {
                self ^ (sign & $vector::splat(-0.0))
            }
        }
    };
}

vector!(4, f64x4, u64x4);
vector!(8, f64x8, u64x8);

impl<const N: usize> Lanes<N>
where
    Width<N>: Packed,
{
    /// The same number in all lanes.
    #[inline(always)]
    pub(crate) fn splat(x: f64) -> Lanes<N> {
        Lanes(Vector::splat(x))
    }

    /// self = other.
    #[inline(always)]
    pub(crate) fn equal(self, other: Lanes<N>) -> LaneMask<N> {
        LaneMask(self.0.equal(other.0))
    }
}

impl<const N: usize> LaneMask<N>
where
    Width<N>: Packed,
{
    /// Set in no lane.
    pub(crate) const NONE: LaneMask<N> = LaneMask(<Width<N> as Packed>::Vector::ZERO);

    /// One bit for each lane, lane 0 the lowest.
    #[inline(always)]
    pub(crate) fn bits(self) -> u32 {
        self.0.bits()
    }
}

impl<const N: usize> BitAnd for LaneMask<N>
where
    Width<N>: Packed,
{
    type Output = LaneMask<N>;
    #[inline(always)]
    fn bitand(self, other: LaneMask<N>) -> LaneMask<N> {
        LaneMask(self.0 & other.0)
    }
}

impl<const N: usize> BitOr for LaneMask<N>
where
    Width<N>: Packed,
{
    type Output = LaneMask<N>;
    #[inline(always)]
    fn bitor(self, other: LaneMask<N>) -> LaneMask<N> {
        LaneMask(self.0 | other.0)
    }
}

impl<const N: usize> Not for LaneMask<N>
where
    Width<N>: Packed,
{
    type Output = LaneMask<N>;
    #[inline(always)]
    fn not(self) -> LaneMask<N> {
        LaneMask(!self.0)
    }
}

impl<const N: usize> Mask for LaneMask<N>
where
    Width<N>: Packed,
{
    #[inline(always)]
    fn splat(value: bool) -> LaneMask<N> {
        if value { !LaneMask::NONE } else { LaneMask::NONE }
    }
    #[inline(always)]
    fn all(self) -> bool {
        (!self).bits() == 0
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

macro_rules! operator {
    ($($trait:ident $function:ident $assign:ident $assigned:ident),*) => {$(
        impl<const N: usize> $trait for Lanes<N>
        where
            Width<N>: Packed,
        {
            type Output = Lanes<N>;
            #[inline(always)]
            fn $function(self, other: Lanes<N>) -> Lanes<N> {
                Lanes($trait::$function(self.0, other.0))
            }
        }

        impl<const N: usize> $assign for Lanes<N>
        where
            Width<N>: Packed,
        {
            #[inline(always)]
            fn $assigned(&mut self, other: Lanes<N>) {
                *self = $trait::$function(*self, other);
            }
        }
    )*};
}

operator!(
    Add add AddAssign add_assign,
    Sub sub SubAssign sub_assign,
    Mul mul MulAssign mul_assign
);

impl<const N: usize> Div for Lanes<N>
where
    Width<N>: Packed,
{
    type Output = Lanes<N>;
    #[inline(always)]
    fn div(self, other: Lanes<N>) -> Lanes<N> {
        Lanes(self.0 / other.0)
    }
}

impl<const N: usize> Neg for Lanes<N>
where
    Width<N>: Packed,
{
    type Output = Lanes<N>;
    #[inline(always)]
    fn neg(self) -> Lanes<N> {
        Lanes(-self.0)
    }
}

impl<const N: usize> Real for Lanes<N>
where
    Width<N>: Packed,
{
    type Mask = LaneMask<N>;
    type Const = f64;
    type Triple = Plain<Lanes<N>>;
    type Symmetric = Six<Lanes<N>>;

    const ZERO: Lanes<N> = Lanes(<Width<N> as Packed>::Vector::ZERO);
    const ONE: Lanes<N> = Lanes(<Width<N> as Packed>::Vector::ONE);
    const EPSILON: f64 = <f64 as Real>::EPSILON;

    #[inline(always)]
    fn lift(constant: f64) -> Lanes<N> {
        Lanes::splat(constant)
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Lanes<N> {
        Lanes::splat(x)
    }
    #[inline(always)]
    fn mul_add(self, a: Lanes<N>, b: Lanes<N>) -> Lanes<N> {
        Lanes(self.0.fused(a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Lanes<N> {
        Lanes(self.0.root())
    }
    #[inline(always)]
    fn abs(self) -> Lanes<N> {
        Lanes(self.0.absolute())
    }
    #[inline]
    fn sin_cos(self) -> (Lanes<N>, Lanes<N>) {
        elementary::sin_cos(self)
    }
    #[inline]
    fn atan2(self, x: Lanes<N>) -> Lanes<N> {
        elementary::atan2(self, x)
    }
    #[inline(always)]
    fn lt(self, other: Lanes<N>) -> LaneMask<N> {
        LaneMask(self.0.less(other.0))
    }
    #[inline(always)]
    fn is_finite(self) -> LaneMask<N> {
        self.abs().lt(Lanes::splat(f64::INFINITY))
    }
    #[inline(always)]
    fn select(mask: LaneMask<N>, a: Lanes<N>, b: Lanes<N>) -> Lanes<N> {
        Lanes(mask.0.blend(a.0, b.0))
    }
}

impl<const N: usize> Lane for Lanes<N>
where
    Width<N>: Packed,
{
    #[inline(always)]
    fn sign_from_bit(self, k: u32) -> Lanes<N> {
        Lanes(self.0.sign_from_bit(k))
    }
    #[inline(always)]
    fn xor_sign(self, sign: Lanes<N>) -> Lanes<N> {
        Lanes(self.0.xor_sign(sign.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::double_double::reference::Random;
    use super::*;

    const SEED: u64 = 20_251_122;
    const ARGUMENTS: usize = 1_000_000;

    /// The same bits, or both no number.
    fn same(a: f64, b: f64) -> bool {
        a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
    }

    /// Compares functions of two numbers, N arguments at a time.
    fn compare<const N: usize>(
        next: &mut impl FnMut() -> f64,
        lanes: impl Fn(Lanes<N>, Lanes<N>) -> Lanes<N>,
        single: impl Fn(f64, f64) -> f64,
    ) where
        Width<N>: Packed,
        Lanes<N>: From<[f64; N]>,
        [f64; N]: From<Lanes<N>>,
    {
        for _ in 0..ARGUMENTS / N {
            let (a, b): ([f64; N], [f64; N]) = ([(); N].map(|()| next()), [(); N].map(|()| next()));
            let found: [f64; N] = lanes(a.into(), b.into()).into();
            for k in 0..N {
                let own = single(a[k], b[k]);
                assert!(same(found[k], own), "({:e}, {:e}): {:e}, {own:e}", a[k], b[k], found[k]);
            }
        }
    }

    fn every_function<const N: usize>()
    where
        Width<N>: Packed,
        Lanes<N>: From<[f64; N]>,
        [f64; N]: From<Lanes<N>>,
    {
        let special = [
            0.0,
            -0.0,
            5e-324,
            1.0,
            -1.0,
            f64::MAX,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            elementary::RANGE,
        ];
        let mut random = Random(SEED);
        println!("seed {SEED}");
        // sizes of every kind, turns, and numbers with nothing usual about them
        let mut count = 0_usize;
        let mut next = || {
            count += 1;
            match count % 7 {
                0 => special[count / 7 % special.len()],
                1 | 2 => random.spread(-1000.0, 1000.0),
                3 => random.unit() * 1e6,
                _ => random.unit() * 3.2,
            }
        };
        compare(&mut next, |a: Lanes<N>, _| a.sin_cos().0, |a, _| Real::sin_cos(a).0);
        compare(&mut next, |a: Lanes<N>, _| a.sin_cos().1, |a, _| Real::sin_cos(a).1);
        compare(&mut next, |a: Lanes<N>, b| a.atan2(b), Real::atan2);
        compare(&mut next, |a: Lanes<N>, b| a.mul_add(b, a - b), |a, b| f64::mul_add(a, b, a - b));
        compare(&mut next, |a: Lanes<N>, b| -(a / b) + a * b, |a, b| -(a / b) + a * b);
        compare(&mut next, |a: Lanes<N>, _| a.sqrt(), |a, _| a.sqrt());
        // and the sign of zero, which a sum with it hides
        compare(&mut next, |a: Lanes<N>, _| -a, |a, _| -a);
        compare(&mut next, |a: Lanes<N>, b| a.xor_sign(b), |a, b| a.xor_sign(b));
        let (one, two) = (Lanes::<N>::ONE, Lanes::from_f64(2.0));
        let chosen = |a: Lanes<N>, b| Lanes::select(a.lt(b) & b.is_finite(), one, two);
        let single = |a: f64, b: f64| if a < b && b.is_finite() { 1.0 } else { 2.0 };
        compare(&mut next, chosen, single);
    }

    #[test]
    fn each_of_four_lanes_has_the_bits_of_a_double_alone() {
        if FUSED {
            every_function::<4>();
        }
    }

    #[test]
    fn each_of_eight_lanes_has_the_bits_of_a_double_alone() {
        if FUSED {
            every_function::<8>();
        }
    }
}
