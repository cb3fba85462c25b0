//! Double-double: the sum of two doubles, about 32 decimal digits. The reference for the other
//! scalars.

mod angle;
#[cfg(test)]
pub(super) mod for_tests;

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::scalar::{Plain, Real, Six};

/// hi + lo with |lo| ≤ ulp(hi) / 2, about 106 bits.
///
/// With u = 2⁻⁵³ the relative error of a sum or difference is at most 3 u², of a product 4 u², of a
/// square root 25/8 u² (proven). A quotient, sine, cosine and arc tangent stay below 4 u² too (not
/// proven; the largest seen: 1.6, 1.9, 1.9 and 3.1 u²). All this holds while no part underflows,
/// |x| > 1e-270. Infinite operands and overflow give NaN.
///
/// Its operations are calls: inlined, they would make a third of this crate's code.
///
/// Sources: \[HLB01\]; \[JMP17\], "JMP" below; see [`crate::guide::bibliography`].
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Dd {
    pub(crate) hi: f64,
    pub(crate) lo: f64,
}

/// a + b = s + e exactly (Knuth; JMP algorithm 2).
#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let b1 = s - a;
    (s, (a - (s - b1)) + (b - b1))
}

/// a + b = s + e exactly for |a| ≥ |b| or a = 0 (Dekker; JMP algorithm 1).
#[inline(always)]
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// a b = p + e exactly (JMP algorithm 3).
#[inline(always)]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    (p, a.mul_add(b, -p))
}

impl Dd {
    /// The leading part: the nearest double.
    pub const fn hi(self) -> f64 {
        self.hi
    }

    /// The trailing part.
    pub const fn lo(self) -> f64 {
        self.lo
    }

    /// a + b for |a| ≥ |b|, normalised.
    #[inline(always)]
    fn fast(a: f64, b: f64) -> Dd {
        let (hi, lo) = fast_two_sum(a, b);
        Dd { hi, lo }
    }
}

impl From<f64> for Dd {
    #[inline(always)]
    fn from(x: f64) -> Dd {
        Dd { hi: x, lo: 0.0 }
    }
}

impl Neg for Dd {
    type Output = Dd;
    #[inline(always)]
    fn neg(self) -> Dd {
        Dd { hi: -self.hi, lo: -self.lo }
    }
}

impl Add for Dd {
    type Output = Dd;
    /// JMP algorithm 6: also for cancelling signs.
    #[inline(never)]
    fn add(self, b: Dd) -> Dd {
        let (sh, sl) = two_sum(self.hi, b.hi);
        let (th, tl) = two_sum(self.lo, b.lo);
        let v = Dd::fast(sh, sl + th);
        Dd::fast(v.hi, tl + v.lo)
    }
}

impl Sub for Dd {
    type Output = Dd;
    #[inline(never)]
    fn sub(self, b: Dd) -> Dd {
        self + -b
    }
}

impl Mul for Dd {
    type Output = Dd;
    /// JMP algorithm 12.
    #[inline(never)]
    fn mul(self, b: Dd) -> Dd {
        let (p, e) = two_product(self.hi, b.hi);
        let cross = self.lo.mul_add(b.hi, self.hi.mul_add(b.lo, self.lo * b.lo));
        Dd::fast(p, e + cross)
    }
}

impl Mul<f64> for Dd {
    type Output = Dd;
    /// JMP algorithm 9.
    #[inline(never)]
    fn mul(self, b: f64) -> Dd {
        let (p, e) = two_product(self.hi, b);
        Dd::fast(p, self.lo.mul_add(b, e))
    }
}

impl Div for Dd {
    type Output = Dd;
    /// Long division with three quotient digits \[HLB01\].
    #[inline(never)]
    fn div(self, b: Dd) -> Dd {
        let q1 = self.hi / b.hi;
        let r1 = self - b * q1;
        let q2 = r1.hi / b.hi;
        let r2 = r1 - b * q2;
        let q3 = r2.hi / b.hi;
        let q = Dd::fast(q1, q2);
        Dd::fast(q.hi, q.lo + q3)
    }
}

assigned!(Dd);

impl Real for Dd {
    type Triple = Plain<Dd>;
    type Symmetric = Six<Dd>;

    const ZERO: Dd = Dd { hi: 0.0, lo: 0.0 };
    const ONE: Dd = Dd { hi: 1.0, lo: 0.0 };
    /// 4 u² = 2⁻¹⁰⁴, the bound of one operation; numbers themselves are spaced finer.
    const EPSILON: f64 = f64::EPSILON * f64::EPSILON;

    #[inline(always)]
    fn from_f64(x: f64) -> Dd {
        Dd::from(x)
    }
    /// Two roundings: a product, then a sum.
    #[inline(never)]
    fn mul_add(self, a: Dd, b: Dd) -> Dd {
        self * a + b
    }
    /// The double root and one correction from its exact residual (\[LLMPR23\], algorithm
    /// SQRTDWtoDW).
    fn sqrt(self) -> Dd {
        if self.hi == 0.0 {
            return self;
        }
        let s = self.hi.sqrt();
        let residual = (-s).mul_add(s, self.hi) + self.lo;
        Dd::fast(s, residual / (s + s))
    }
    #[inline(always)]
    fn abs(self) -> Dd {
        if self.hi.is_sign_negative() { -self } else { self }
    }
    fn sin_cos(self) -> (Dd, Dd) {
        angle::sin_cos(self)
    }
    fn atan2(self, x: Dd) -> Dd {
        angle::atan2(self, x)
    }
    #[inline(always)]
    fn lt(self, other: Dd) -> bool {
        self < other
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.hi.is_finite() && self.lo.is_finite()
    }
    #[inline(always)]
    fn select(condition: bool, a: Dd, b: Dd) -> Dd {
        if condition { a } else { b }
    }
    fn nearest_whole(self) -> Dd {
        Dd::from(self.hi.nearest_whole())
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self.hi
    }
}

#[cfg(test)]
mod tests {
    use super::for_tests::{Random, relative};
    use super::*;

    const SEED: u64 = 20_250_118;
    const EPSILON: f64 = Dd::EPSILON;

    #[test]
    fn sums_products_quotients_and_roots_undo_each_other() {
        let mut random = Random(SEED);
        for _ in 0..20_000 {
            let a = random.unit_dd();
            let b = random.unit_dd() * random.spread(-60.0, 60.0);
            let size = a.hi.abs().max(b.hi.abs());
            assert!((((a + b) - a) - b).hi.abs() <= 4.0 * EPSILON * size, "{a:?} {b:?}");
            assert!(relative((a * b) / b, a) <= 2.0 * EPSILON, "{a:?} {b:?}");
            assert!(relative((a / b) * b, a) <= 2.0 * EPSILON, "{a:?} {b:?}");
            assert!(relative(b.abs().sqrt() * b.abs().sqrt(), b.abs()) <= 3.0 * EPSILON, "{b:?}");
            assert!(relative(a.mul_add(b, -(a * b)) + b, b) == 0.0, "{a:?} {b:?}");
        }
    }

    #[test]
    fn cancelling_signs_keep_the_relative_error() {
        // (1 + 2⁻⁵³ + 2⁻¹⁰⁶) − (1 + 2⁻⁵³) and its like, where a sum without the trailing parts' own
        // error loses all digits
        let h = 2.0_f64.powi(-53);
        let l = 2.0_f64.powi(-106);
        assert_eq!(Dd { hi: 1.0, lo: h + l } - Dd { hi: 1.0, lo: h }, Dd::from(0.0));
        assert_eq!(Dd { hi: 1.0, lo: h } - Dd { hi: 1.0, lo: -h }, Dd::from(2.0 * h));
        assert_eq!((Dd::ONE + Dd::from(l)) - Dd::ONE, Dd::from(l));
        assert_eq!((Dd::from(1e16) + Dd::ONE) + Dd::from(-1e16), Dd::ONE);
    }

    #[test]
    fn results_are_normalised() {
        let mut random = Random(SEED);
        for _ in 0..20_000 {
            let a = random.unit_dd();
            let b = random.unit_dd() * random.spread(-60.0, 44.0);
            let (s, c) = b.sin_cos();
            for v in [a + b, a - b, a * b, a / b, a.abs().sqrt(), s, c, a.atan2(b)] {
                assert_eq!(v.hi + v.lo, v.hi, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn zero_and_faults_are_told_apart() {
        let zero = Dd::ZERO;
        assert_eq!(zero.sqrt(), zero);
        assert!(
            !(-Dd::ONE).sqrt().is_finite()
                && !(Dd::ONE / zero).is_finite()
                && !Dd::from(f64::INFINITY).is_finite()
        );
        assert!(Real::lt(Dd::ONE, Dd { hi: 1.0, lo: 1e-20 }) && !Real::lt(Dd::ONE, Dd::ONE));
        assert_eq!(Dd { hi: -1.0, lo: 1e-20 }.abs(), Dd { hi: 1.0, lo: -1e-20 });
    }
}
