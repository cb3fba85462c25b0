//! Single precision: about seven decimal digits, for robots that are asked to be fast rather than
//! exact, and to see what that costs.

use crate::scalar::{Plain, Real, Scalar, Six, elementary};

/// From this |x| on, sine and cosine are not numbers: neighbouring angles are 0.008 rad and more
/// apart, as at the end of the range in double.
const RANGE: f32 = (1_u32 << 16) as f32;

/// The elementary functions are those of `f64`, rounded: within 0.5001 ulp, the same bits on every
/// machine.
impl Real for f32 {
    type Mask = bool;
    type Const = f32;
    type Triple = Plain<f32>;
    type Symmetric = Six<f32>;

    const ZERO: f32 = 0.0;
    const ONE: f32 = 1.0;
    const EPSILON: f64 = f32::EPSILON as f64 / 2.0;

    #[inline(always)]
    fn lift(constant: f32) -> f32 {
        constant
    }
    /// Rounded where the number has more digits.
    #[inline(always)]
    fn from_f64(x: f64) -> f32 {
        x as f32
    }
    #[inline(always)]
    fn mul_add(self, a: f32, b: f32) -> f32 {
        f32::mul_add(self, a, b)
    }
    #[inline(always)]
    fn sqrt(self) -> f32 {
        f32::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> f32 {
        f32::abs(self)
    }
    #[inline]
    fn sin_cos(self) -> (f32, f32) {
        let x = if self.abs() < RANGE { self } else { f32::NAN };
        let (s, c) = elementary::sin_cos(f64::from(x));
        (s as f32, c as f32)
    }
    #[inline]
    fn atan2(self, x: f32) -> f32 {
        elementary::atan2(f64::from(self), f64::from(x)) as f32
    }
    #[inline(always)]
    fn lt(self, other: f32) -> bool {
        self < other
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
    #[inline(always)]
    fn select(mask: bool, a: f32, b: f32) -> f32 {
        if mask { a } else { b }
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Dd;
    use super::super::double_double::reference::Random;
    use super::*;

    const SEED: u64 = 20_250_121;

    /// |x − truth| in units of the last place of x.
    fn ulps(x: f32, truth: Dd) -> f64 {
        let unit = f64::from(x.abs().next_up() - x.abs());
        (Dd::from(f64::from(x)) - truth).hi().abs() / unit
    }

    #[test]
    fn elementary_functions_are_rounded_once() {
        let mut random = Random(SEED);
        let mut worst = 0.0_f64;
        for k in 0..60_000 {
            let size = if k % 2 == 0 { 3.2 } else { 6e4 };
            let (x, y) = ((random.unit() * size) as f32, random.unit() as f32);
            let [wide_x, wide_y] = [x, y].map(|x| Dd::from(f64::from(x)));
            let ((s, c), (true_s, true_c)) = (Real::sin_cos(x), wide_x.sin_cos());
            worst = worst
                .max(ulps(s, true_s))
                .max(ulps(c, true_c))
                .max(ulps(Real::atan2(y, x), wide_y.atan2(wide_x)));
        }
        println!("seed {SEED}, largest error {worst} ulp");
        assert!(worst < 0.5001);
    }

    #[test]
    fn an_angle_that_says_nothing_has_no_sine() {
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, RANGE, -f32::MAX] {
            assert!(Real::sin_cos(x).0.is_nan() && Real::sin_cos(x).1.is_nan());
        }
        assert!(Real::sin_cos(RANGE.next_down()).0.is_finite());
    }
}
