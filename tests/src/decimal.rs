//! Decimal text to double-double.

use sarrus_dynamics::scalar::{Dd, Real};

/// Digits that fit a double exactly.
const GROUP: usize = 15;

/// Reads a decimal number such as `-0.1234567890123456789012345678901e-5`.
///
/// Relative error: 8 u² and 4 u² more for every 22 places that the decimal point moves, u =
/// 2⁻⁵³; exact for integers below 10³⁰. Digits after the 45th are dropped. `None` for text with
/// anything but digits, one point, signs and an exponent, and for numbers out of range.
/// Allocates.
pub fn decimal(text: &str) -> Option<Dd> {
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
    let mut places =
        (i64::from(exponent) + dropped as i64 - fraction.len() as i64).clamp(-1000, 1000);
    while places != 0 {
        let step = places.unsigned_abs().min(22) as usize;
        let factor = power_of_ten(step);
        (value, places) = if places > 0 {
            (value * factor, places - step as i64)
        } else {
            (value / Dd::from(factor), places + step as i64)
        };
    }
    value.is_finite().then_some(if negative { -value } else { value })
}

/// 10ⁿ, exact for n ≤ 22.
fn power_of_ten(n: usize) -> f64 {
    (0..n).fold(1.0, |p, _| p * 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(hi: f64, lo: f64) -> Dd {
        Dd::from(hi) + Dd::from(lo)
    }

    fn relative(value: Dd, truth: Dd) -> f64 {
        ((value - truth).hi() / truth.hi()).abs()
    }

    #[test]
    fn decimal_text_gives_the_nearest_pair() {
        let pi = pair(core::f64::consts::PI, 1.2246467991473532e-16);
        let cases = [
            ("3.14159265358979323846264338327950288419716939937510582", pi),
            ("-314159265358979323846264338327950288419.716939937510582E-38", -pi),
            ("+0.000314159265358979323846264338327950288419716939937510582e4", pi),
            ("0.1", pair(0.1, -5.551115123125783e-18)),
            ("1e-30", pair(1e-30, -8.333642060758599e-47)),
        ];
        for (text, truth) in cases {
            let error = decimal(text).map(|v| relative(v, truth));
            assert!(error.is_some_and(|e| e <= 3.0 * Dd::EPSILON), "{text}: {error:?}");
        }
        for (text, exact) in [
            ("0", 0.0),
            ("-12.5", -12.5),
            (".5", 0.5),
            ("5.", 5.0),
            ("1e20", 1e20),
            ("00012", 12.0),
            ("1e-999999999", 0.0),
        ] {
            assert_eq!(decimal(text), Some(Dd::from(exact)), "{text}");
        }
    }

    #[test]
    fn other_text_is_refused() {
        for text in [
            "", ".", "-", "e5", "1e", "1e5.0", "1..2", "--1", "nan", "inf", "1 ", "1_0", "0x1",
            "1e999", "１",
        ] {
            assert_eq!(decimal(text), None, "{text}");
        }
    }
}
