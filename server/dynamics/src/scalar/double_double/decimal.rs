//! Decimal text to double-double.

use super::Dd;
use crate::scalar::Real;

/// Digits that fit a double exactly.
const GROUP: usize = 15;

impl Dd {
    /// Reads a decimal number such as `-0.1234567890123456789012345678901e-5`.
    ///
    /// Relative error: 8 u² and 4 u² more for every 22 places that the decimal point moves, u = 2⁻⁵³; exact for integers below
    /// 10³⁰. Digits after the 45th are dropped. `None` for anything else than digits, one point, signs and an exponent, and for
    /// numbers out of range. Allocates.
    ///
    /// ```
    /// use sarrus_dynamics::scalar::Dd;
    /// let third = Dd::parse_decimal("0.333333333333333333333333333333333333").unwrap();
    /// assert!((third * 3.0 - Dd::from(1.0)).hi().abs() < 1e-31);
    /// assert_eq!(Dd::parse_decimal("-1.5e1"), Some(Dd::from(-15.0)));
    /// ```
    pub fn parse_decimal(text: &str) -> Option<Dd> {
        let (negative, text) = match text.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, text.strip_prefix('+').unwrap_or(text)),
        };
        let (mantissa, exponent) = match text.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
            None => (text, 0),
        };
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits: Vec<u8> = whole.bytes().chain(fraction.bytes()).collect();
        if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
            return None;
        }

        // the leading digits as an integer, exact group by exact group
        let zeros = digits.iter().take_while(|&&d| d == b'0').count();
        let kept = digits.len().min(zeros + 3 * GROUP);
        let mut value = Dd::ZERO;
        for group in digits[zeros..kept].chunks(GROUP) {
            let number = group.iter().fold(0.0, |n, &d| n * 10.0 + f64::from(d - b'0'));
            value = value * power_of_ten(group.len()) + Dd::from(number);
        }

        // the point, at most 22 places at a time
        let dropped = digits.len() - kept;
        let mut places = (i64::from(exponent) + dropped as i64 - fraction.len() as i64).clamp(-1000, 1000);
        while places != 0 {
            let step = places.unsigned_abs().min(22) as usize;
            let factor = power_of_ten(step);
            (value, places) =
                if places > 0 { (value * factor, places - step as i64) } else { (value / Dd::from(factor), places + step as i64) };
        }
        value.is_finite().then_some(if negative { -value } else { value })
    }
}

/// 10ⁿ, exact for n ≤ 22.
fn power_of_ten(n: usize) -> f64 {
    (0..n).fold(1.0, |p, _| p * 10.0)
}
