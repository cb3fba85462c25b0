//! Numbers as integer codes over a range: the packing of MIT mode and CyberGear.

/// The codes 0 … 2^bits − 1 represent `low` … `high` in equal steps, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    low: f64,
    /// The upper end.
    pub(super) high: f64,
    range: f64,
    /// The last code.
    most: f64,
    /// The value of one step.
    pub(super) step: f64,
}

impl Scale {
    pub(super) const fn between(low: f64, high: f64, bits: u32) -> Scale {
        let range = high - low;
        let most = ((1_u32 << bits) - 1) as f64;
        Scale { low, high, range, most, step: range / most }
    }

    /// The nearest code; values beyond an end get its code, and NaN gets that of zero. `odd`
    /// decides values exactly between two codes: a range around zero has no code for zero, and
    /// alternating between the two beside it gives zero on average.
    pub(super) fn code(self, value: f64, odd: bool) -> u16 {
        let value = if value.is_nan() { 0.0 } else { value };
        let value = if value < self.low { self.low } else { value };
        let value = if value > self.high { self.high } else { value };
        let place = (value - self.low) / self.range * self.most;
        let below = place.floor();
        let half = if odd { 0.5_f64.next_down() } else { 0.5 };
        below as u16 + u16::from(place - below > half)
    }

    /// The code next to a value on the side of zero, to a millionth of a step; where there is none,
    /// as beside zero itself, the nearest. With the code's value.
    pub(super) fn toward_zero(self, value: f64, odd: bool) -> (u16, f64) {
        let code = self.code(value, odd);
        let nearest = self.value(code);
        if nearest.abs() <= value.abs() + 1e-6 * self.step {
            return (code, nearest);
        }
        let inward = if value > 0.0 { code.saturating_sub(1) } else { code.saturating_add(1) };
        let inner = self.value(inward);
        let is_closer = nearest.abs() - inner.abs() > 0.5 * self.step;
        if is_closer { (inward, inner) } else { (code, nearest) }
    }

    /// A code with its value, or the one beside it whose value is between two bounds.
    pub(super) fn within(self, (code, value): (u16, f64), least: f64, most: f64) -> u16 {
        let slack = 1e-6 * self.step;
        if value < least - slack {
            code.saturating_add(1).min(self.most as u16)
        } else if value > most + slack {
            code.saturating_sub(1)
        } else {
            code
        }
    }

    /// The value of a code.
    pub(super) fn value(self, code: u16) -> f64 {
        self.value_at(i64::from(code))
    }

    /// The value of a code that was counted on beyond the ends.
    pub(super) fn value_at(self, code: i64) -> f64 {
        code as f64 / self.most * self.range + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_comes_back_as_itself() {
        for bits in [12, 16] {
            for scale in [
                Scale::between(-12.5, 12.5, bits),
                Scale::between(-95.5, 95.5, bits),
                Scale::between(0.0, 500.0, bits),
            ] {
                for code in 0..=u16::MAX >> (16 - bits) {
                    assert_eq!(scale.code(scale.value(code), false), code);
                    assert_eq!(scale.code(scale.value(code) + 0.49 * scale.step, true), code);
                }
            }
        }
    }

    #[test]
    fn towards_zero_no_code_is_larger_than_its_value() {
        let scale = Scale::between(-18.0, 18.0, 12);
        let half = 0.5 * scale.step;
        for n in 0..20_000 {
            let value = -18.0 + 36.0 * f64::from(n) / 19_999.0;
            let sent = scale.toward_zero(value, n % 2 == 0).1;
            assert!(sent.abs() <= value.abs() + 1e-8 || value.abs() < half, "{value} {sent}");
            assert!((sent - value).abs() <= scale.step * (1.0 + 1e-6), "{value} {sent}");
        }
        for code in 0..=4095 {
            assert_eq!(scale.toward_zero(scale.value(code), true).0, code, "a code's own value");
        }
        let gain = Scale::between(0.0, 500.0, 12);
        assert_eq!((gain.toward_zero(0.12, false).0, gain.toward_zero(0.13, false).0), (0, 1));
        assert_eq!(gain.toward_zero(1e300, false).0, 4095);
    }

    #[test]
    fn values_beyond_the_ends_saturate_and_nan_is_zero() {
        let scale = Scale::between(-12.5, 12.5, 12);
        assert_eq!((scale.code(f64::INFINITY, false), scale.code(1e300, false)), (4095, 4095));
        assert_eq!((scale.code(f64::NEG_INFINITY, false), scale.code(-1e300, false)), (0, 0));
        assert_eq!((scale.code(f64::NAN, false), scale.code(f64::NAN, true)), (2047, 2048));
        assert_eq!(Scale::between(0.0, 500.0, 12).code(-1.0, false), 0);
    }
}
