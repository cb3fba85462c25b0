//! Doubles whose every rounding is moved at random: the digits that two runs of one computation do
//! not share are those that rounding has lost [V93].

use core::cmp::Ordering;
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::scalar::{Plain, Real, Six};

/// A number whose operations end one or two units of the last place away from where they would.
///
/// Which way follows from the bits of the result and from the key, that of the run, which every
/// number that an input took part in carries: a run gives the same numbers each time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stochastic {
    x: f64,
    key: u64,
}

impl Stochastic {
    /// An input of the run with this key, exact.
    pub(crate) fn input(x: f64, key: u64) -> Stochastic {
        Stochastic { x, key }
    }

    /// A constant of the model, which was rounded when it was made; whole numbers were not.
    pub(crate) fn constant(x: f64) -> Stochastic {
        if x.fract() == 0.0 { Stochastic { x, key: 0 } } else { Stochastic::rounded(x, 0) }
    }

    /// A rounded result of numbers with these keys; zero stays, as it does where terms are absent.
    #[inline]
    fn rounded(x: f64, key: u64) -> Stochastic {
        if x == 0.0 || !x.is_finite() {
            return Stochastic { x, key };
        }
        let bits = x.to_bits();
        let hash = (bits ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 62;
        // −2, −1, 1, 2
        let step = hash as i64 - 2 + (hash as i64 >> 1);
        Stochastic { x: f64::from_bits(bits.wrapping_add_signed(step)), key }
    }
}

impl PartialEq for Stochastic {
    fn eq(&self, other: &Stochastic) -> bool {
        self.x == other.x
    }
}

impl PartialOrd for Stochastic {
    fn partial_cmp(&self, other: &Stochastic) -> Option<Ordering> {
        self.x.partial_cmp(&other.x)
    }
}

impl Add for Stochastic {
    type Output = Stochastic;
    #[inline]
    fn add(self, other: Stochastic) -> Stochastic {
        Stochastic::rounded(self.x + other.x, self.key | other.key)
    }
}

impl Sub for Stochastic {
    type Output = Stochastic;
    #[inline]
    fn sub(self, other: Stochastic) -> Stochastic {
        Stochastic::rounded(self.x - other.x, self.key | other.key)
    }
}

impl Mul for Stochastic {
    type Output = Stochastic;
    #[inline]
    fn mul(self, other: Stochastic) -> Stochastic {
        Stochastic::rounded(self.x * other.x, self.key | other.key)
    }
}

impl Div for Stochastic {
    type Output = Stochastic;
    #[inline]
    fn div(self, other: Stochastic) -> Stochastic {
        Stochastic::rounded(self.x / other.x, self.key | other.key)
    }
}

impl Neg for Stochastic {
    type Output = Stochastic;
    #[inline]
    fn neg(self) -> Stochastic {
        Stochastic { x: -self.x, key: self.key }
    }
}

impl AddAssign for Stochastic {
    #[inline]
    fn add_assign(&mut self, other: Stochastic) {
        *self = *self + other;
    }
}

impl SubAssign for Stochastic {
    #[inline]
    fn sub_assign(&mut self, other: Stochastic) {
        *self = *self - other;
    }
}

impl MulAssign for Stochastic {
    #[inline]
    fn mul_assign(&mut self, other: Stochastic) {
        *self = *self * other;
    }
}

impl Real for Stochastic {
    type Triple = Plain<Stochastic>;
    type Symmetric = Six<Stochastic>;

    const ZERO: Stochastic = Stochastic { x: 0.0, key: 0 };
    const ONE: Stochastic = Stochastic { x: 1.0, key: 0 };
    /// Smaller than that of doubles: Newton's method goes on where it would end, so that the
    /// remaining error is seen too.
    const EPSILON: f64 = 1e-4 * <f64 as Real>::EPSILON;

    #[inline]
    fn from_f64(x: f64) -> Stochastic {
        Stochastic { x, key: 0 }
    }
    #[inline]
    fn mul_add(self, a: Stochastic, b: Stochastic) -> Stochastic {
        Stochastic::rounded(f64::mul_add(self.x, a.x, b.x), self.key | a.key | b.key)
    }
    #[inline]
    fn sqrt(self) -> Stochastic {
        Stochastic::rounded(f64::sqrt(self.x), self.key)
    }
    #[inline]
    fn abs(self) -> Stochastic {
        Stochastic { x: f64::abs(self.x), key: self.key }
    }
    fn sin_cos(self) -> (Stochastic, Stochastic) {
        let (s, c) = Real::sin_cos(self.x);
        (Stochastic::rounded(s, self.key), Stochastic::rounded(c, self.key))
    }
    fn atan2(self, x: Stochastic) -> Stochastic {
        Stochastic::rounded(Real::atan2(self.x, x.x), self.key | x.key)
    }
    #[inline]
    fn lt(self, other: Stochastic) -> bool {
        self.x < other.x
    }
    #[inline]
    fn is_finite(self) -> bool {
        f64::is_finite(self.x)
    }
    #[inline]
    fn select(condition: bool, a: Stochastic, b: Stochastic) -> Stochastic {
        if condition { a } else { b }
    }
    fn to_f64(self) -> f64 {
        self.x
    }

    /// Nothing is rounded.
    fn plus_zero(self) -> Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (a + b) − a with a of size 1 and b of size 1e-6.
    fn drowned(key: u64) -> f64 {
        let a = Stochastic::input(0.7, key);
        let b = Stochastic::input(1.1e-6, key);
        ((a + b) - a).to_f64()
    }

    #[test]
    fn runs_share_the_digits_that_rounding_leaves() {
        let one = drowned(1);
        let two = drowned(2);
        assert_eq!(one, drowned(1));
        let apart = (one - two).abs() / 1.1e-6;
        assert!(apart > 1e-12 && apart < 1e-8, "{apart:e}");
    }

    #[test]
    fn what_is_absent_stays_absent() {
        let x = Stochastic::input(0.3, 1);
        assert_eq!((x * Stochastic::ZERO).to_f64(), 0.0);
        assert_eq!((x - x).to_f64(), 0.0);
        assert!((x / Stochastic::ZERO).to_f64().is_infinite());
    }
}
