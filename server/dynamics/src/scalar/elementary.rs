//! Sine, cosine and the arc tangent as one fixed sequence of IEEE operations, the same in every
//! lane and on every machine.
//!
//! No branch, no table: [`Lane`] has the few operations that the functions need. An implementation
//! whose product is fused and whose other operations round to nearest gives the bits of the `f64`
//! one.

use core::ops::{Add, BitOr, Div, Mul, Neg, Sub};

/// One IEEE double, or a register of several.
pub(super) trait Lane:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The outcome of a comparison in each lane.
    type Mask: Copy + BitOr<Output = Self::Mask>;

    /// One number in all lanes.
    fn of(x: f64) -> Self;
    /// self · a + b, rounded once.
    fn fused(self, a: Self, b: Self) -> Self;
    /// |self|.
    fn absolute(self) -> Self;
    /// self < other.
    fn less(self, other: Self) -> Self::Mask;
    /// `a` where the mask is set, else `b`.
    fn blend(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// A number whose sign bit is bit `k` of this one's representation; its other bits mean
    /// nothing.
    fn sign_from_bit(self, k: u32) -> Self;
    /// This number, negated if `sign` has its sign bit set.
    fn xor_sign(self, sign: Self) -> Self;
}

impl Lane for f64 {
    type Mask = bool;

    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn fused(self, a: f64, b: f64) -> f64 {
        f64::mul_add(self, a, b)
    }
    #[inline(always)]
    fn absolute(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn less(self, other: f64) -> bool {
        self < other
    }
    #[inline(always)]
    fn blend(mask: bool, a: f64, b: f64) -> f64 {
        if mask { a } else { b }
    }
    #[inline(always)]
    fn sign_from_bit(self, k: u32) -> f64 {
        f64::from_bits(self.to_bits() << (63 - k))
    }
    #[inline(always)]
    fn xor_sign(self, sign: f64) -> f64 {
        f64::from_bits(self.to_bits() ^ (sign.to_bits() & SIGN_BIT))
    }
}

const SIGN_BIT: u64 = 1 << 63;

/// From this |x| on, the answer is not a number: the error of a / (π/2) would carry |r| past the
/// polynomials' 0.79.
pub(super) const RANGE: f64 = (1_u64 << 45) as f64;

/// 1.5 · 2⁵²: the sum with a number below 2⁵¹ has that number's nearest integer in its low bits.
const INTEGER: f64 = 6_755_399_441_055_744.0;

/// π/2 in three doubles.
const HALF_PI: [f64; 3] =
    [core::f64::consts::FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33];

/// (sin r − r) / r³ as a polynomial in r², |r| ≤ 0.79: minimax for the relative error of sin (Remez
/// exchange in 60 digits, coefficients rounded from the lowest up, the rest fitted again after
/// each), 2⁻⁵⁷·⁷.
const SIN: [f64; 6] = [
    -0.16666666666666627,
    0.008333333333321128,
    -0.000198412698287716,
    2.7557313329894517e-6,
    -2.5050701023123465e-8,
    1.589346260505195e-10,
];

/// (cos r − 1 + r²/2) / r⁴ as a polynomial in r², |r| ≤ 0.79: found likewise, 2⁻⁶³·⁸.
const COS: [f64; 6] = [
    0.04166666666666659,
    -0.0013888888888872167,
    2.4801587288274786e-5,
    -2.755731400737406e-7,
    2.0875676842343087e-9,
    -1.1357264527674212e-11,
];

/// (sin x, cos x), x in radians.
///
/// Within 0.8 ulp (the largest error seen among 6·10⁷ angles is 0.784) for |x| < 2⁴⁵, next to
/// multiples of π/2 too; in [−1, 1]. NaN from 2⁴⁵ on, where neighbouring doubles are 0.008 rad and
/// more apart: such an angle has no digit. sin(−x) = −sin x and cos(−x) = cos x to the bit.
///
/// Reduction: \[CW80\], with fused products.
#[inline(always)]
pub(super) fn sin_cos<T: Lane>(x: T) -> (T, T) {
    let k = T::of;

    // |x|, and NaN beyond the range
    let a = x.absolute();
    let a = T::blend(a.less(k(RANGE)), a, k(f64::NAN));

    // n = the integer nearest to a / (π/2), also in the low bits of t
    let t = a.fused(k(core::f64::consts::FRAC_2_PI), k(INTEGER));
    let n = t - k(INTEGER);

    // PRECISION: r + dr = a − n π/2; the first product is exact because a and n π/2 are multiples
    // of 2⁻⁵³ that nearly cancel
    let r1 = (-n).fused(k(HALF_PI[0]), a);
    let p = n * k(HALF_PI[1]);
    let r = r1 - p;
    let dr = ((r1 - r) - p) - n.fused(k(HALF_PI[2]), n.fused(k(HALF_PI[1]), -p));

    // the polynomials in z = r²
    let z = r * r;
    let z2 = z * z;
    let six = |c: &[f64; 6]| {
        let pair = |i: usize| k(c[i + 1]).fused(z, k(c[i]));
        pair(4).fused(z2, pair(2)).fused(z2, pair(0))
    };

    // PRECISION: w + e = 1 − r²/2 without its rounding; dr enters as dr cos r, −dr sin r to first
    // order
    let h = r * k(-0.5);
    let w = h.fused(r, k(1.0));
    let e = h.fused(r, k(1.0) - w);
    let sin = (z * r).fused(six(&SIN), dr * w) + r;
    let cos = z2.fused(six(&COS), (-r).fused(dr, e)) + w;

    // back to the quadrant n mod 4 and the sign of x; n is odd where n/2 − 1/4 rounds down
    let m = n.fused(k(0.5), k(-0.25));
    let odd = ((m + k(INTEGER)) - k(INTEGER)).less(m);
    let (sin, cos) = (T::blend(odd, cos, sin), T::blend(odd, sin, cos));
    let ones = t.sign_from_bit(0);
    let twos = t.sign_from_bit(1);
    (sin.xor_sign(twos).xor_sign(x), cos.xor_sign(twos).xor_sign(ones))
}

/// (atan t − t) / t³ as a polynomial in t², 0 ≤ t ≤ 1: found as [`SIN`] is, 2⁻⁵⁷·⁴.
const ATAN: [f64; 20] = [
    -0.3333333333333307,
    0.19999999999951748,
    -0.1428571428258798,
    0.11111111007338594,
    -0.09090907007735875,
    0.07692279888162858,
    -0.06666404417138774,
    0.05880529771477943,
    -0.05253526622905692,
    0.04722347851942683,
    -0.04219242335356976,
    0.03664313690283263,
    -0.029905714468253217,
    0.021987041303159906,
    -0.013902545824928843,
    0.007197862857381006,
    -0.0028855974234600888,
    0.0008315550737838101,
    -0.00015221011472297077,
    1.3229893501518314e-5,
];

/// The angle of the point (x, y) in [−π, π], with the signed zeros and infinities of IEEE 754.
///
/// Within 1.4 ulp (the largest error seen among 7·10⁷ points is 1.341, near the diagonals; 0.6 near
/// the axes) for all sizes of x and y. atan2(−y, x) = −atan2(y, x) to the bit.
#[inline(always)]
pub(super) fn atan2<T: Lane>(y: T, x: T) -> T {
    let k = T::of;

    // the shorter and the longer coordinate; at the origin and at infinity a point in the same
    // direction, NaN kept
    let ay = y.absolute();
    let ax = x.absolute();
    let steep = ax.less(ay);
    let short = T::blend(steep, ax, ay);
    let long = T::blend(steep, ay, ax);
    let largest = k(f64::MAX);
    let edge = largest.less(long) | long.less(k(f64::from_bits(1)));
    let short = T::blend(edge, T::blend(largest.less(short), k(1.0), short * k(0.0)), short);
    let long = T::blend(edge, k(1.0), long);

    // t = the tangent of the angle to the nearest axis; the quotient's rounding error times atan′ =
    // 1 / (1 + t²), ± 4 %
    let t = short / long;
    let z = t * t;
    let dt = ((-t).fused(long, short) / long) * z.fused(k(-0.5), k(0.957));

    // the angle's size is base ± atan t: 0 + or π − where flat, π/2 ∓ where steep
    let flat = T::blend(steep, k(0.0), k(1.0));
    let side = flat.xor_sign(x);
    let turn = (flat - k(0.5)).xor_sign(x);
    let t = t.xor_sign(turn);
    let dt = dt.xor_sign(turn);

    // the polynomial in z = t²
    let z2 = z * z;
    let z4 = z2 * z2;
    let z8 = z4 * z4;
    let four = |i: usize| {
        let pair = |i: usize| k(ATAN[i + 1]).fused(z, k(ATAN[i]));
        pair(i + 2).fused(z2, pair(i))
    };
    let eight = |i: usize| four(i + 4).fused(z4, four(i));
    let p = four(16).fused(z8, eight(8)).fused(z8, eight(0));

    // PRECISION: base + t is rounded into s and its error kept
    let base = (-side).fused(k(HALF_PI[0]), k(HALF_PI[0]));
    let s = base + t;
    let e = ((base - s) + t) + dt + (-side).fused(k(HALF_PI[1]), k(HALF_PI[1]));
    ((z * t).fused(p, e) + s).xor_sign(y)
}

#[cfg(test)]
mod tests {
    use super::super::double_double::for_tests::{Random, angles, sines, ulps};
    use super::super::{Dd, Real};
    use super::*;

    const SEED: u64 = 20_250_117;

    /// Largest error in ulp of sine and cosine, measured by double-double, over angles given by
    /// `next`.
    fn worst_sin_cos(count: usize, mut next: impl FnMut() -> f64) -> (f64, f64) {
        (0..count).fold((0.0, 0.0), |worst, _| {
            let x = next();
            let ((s, c), (true_s, true_c)) = (sin_cos(x), Dd::from(x).sin_cos());
            (ulps(s, true_s).max(worst.0), ulps(c, true_c).max(worst.1))
        })
    }

    #[test]
    fn sine_and_cosine_agree_with_the_table() {
        for [x, sh, sl, ch, cl] in sines() {
            let (s, c) = sin_cos(x);
            let es = ulps(s, Dd { hi: sh, lo: sl });
            let ec = ulps(c, Dd { hi: ch, lo: cl });
            assert!(es <= 0.8 && ec <= 0.8, "x = {x:e}: {es} and {ec} ulp");
        }
    }

    #[test]
    fn arc_tangent_agrees_with_the_table() {
        for [y, x, hi, lo] in angles() {
            let angle = atan2(y, x);
            let error = ulps(angle, Dd { hi, lo });
            assert!(
                error <= 1.4 && angle.is_sign_negative() == y.is_sign_negative(),
                "atan2({y:e}, {x:e}): {error} ulp"
            );
        }
    }

    #[test]
    fn sine_and_cosine_of_random_angles_are_within_four_fifths_of_an_ulp() {
        let mut random = Random(SEED);
        let turn = worst_sin_cos(50_000, || random.unit() * 3.2);
        let million = worst_sin_cos(50_000, || random.unit() * 1e6);
        let range = worst_sin_cos(50_000, || random.spread(-60.0, 44.99));
        let multiple = worst_sin_cos(50_000, || {
            let n = (random.unit() * 1e6).round();
            n * core::f64::consts::FRAC_PI_2 * (1.0 + random.spread(-60.0, -20.0))
        });
        println!(
            "seed {SEED}, largest errors in ulp (sin, cos): {turn:?} {million:?} {range:?} \
             {multiple:?}"
        );
        for (s, c) in [turn, million, range, multiple] {
            assert!(s <= 0.8 && c <= 0.8);
        }
    }

    #[test]
    fn arc_tangents_of_random_points_are_within_seven_fifths_of_an_ulp() {
        let mut random = Random(SEED);
        let mut worst = [0.0_f64; 3];
        for _ in 0..50_000 {
            let near = (random.unit(), random.unit());
            let wide = (random.spread(-500.0, 500.0), random.spread(-500.0, 500.0));
            let axis = (random.spread(-20.0, 20.0), random.spread(-3.0, 3.0));
            for (worst, (y, x)) in worst.iter_mut().zip([near, wide, axis]) {
                let truth = Dd::from(y).atan2(Dd::from(x));
                *worst = if truth.hi.abs() > 1e-290 {
                    ulps(atan2(y, x), truth).max(*worst)
                } else {
                    *worst
                };
            }
        }
        println!("seed {SEED}, largest errors in ulp: {worst:?}");
        assert!(worst.iter().all(|&e| e <= 1.4));
    }

    #[test]
    fn symmetries_hold_to_the_bit() {
        let mut random = Random(SEED);
        let bits = |(a, b): (f64, f64)| (a.to_bits(), b.to_bits());
        for i in 0..20_000 {
            let x = if i == 0 { 0.0 } else { random.spread(-1000.0, 44.0) };
            let y = random.spread(-1000.0, 1000.0);
            let (s, c) = sin_cos(x);
            assert_eq!(bits(sin_cos(-x)), bits((-s, c)), "x = {x:e}");
            assert!(s.abs() <= 1.0 && c.abs() <= 1.0, "x = {x:e}");
            assert_eq!(atan2(-y, x).to_bits(), (-atan2(y, x)).to_bits(), "{y:e} {x:e}");
        }
    }

    #[test]
    fn special_values_are_those_of_ieee_754() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, RANGE, -f64::MAX] {
            let (s, c) = sin_cos(x);
            assert!(s.is_nan() && c.is_nan());
        }
        assert!(sin_cos(RANGE.next_down()).0.is_finite());

        let values = [0.0, 5e-324, 1.0, f64::MAX, f64::INFINITY, f64::NAN].map(|v: f64| [v, -v]);
        for (&y, &x) in
            values.iter().flatten().flat_map(|y| values.iter().flatten().map(move |x| (y, x)))
        {
            let own = atan2(y, x);
            let std = f64::atan2(y, x);
            assert!(
                own.to_bits() == std.to_bits() || (own.is_nan() && std.is_nan()),
                "atan2({y:e}, {x:e}) = {own:e}, not {std:e}"
            );
        }
    }
}
