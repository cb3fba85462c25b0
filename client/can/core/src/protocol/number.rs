//! Converts numbers to the words of frames: saturating, never NaN.

/// The nearest single; values beyond its range saturate, NaN is 0.
pub(super) fn single(value: f64) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32 }
}

/// The nearest whole number of steps; values beyond −`most` … `most` saturate, NaN is 0.
pub(super) fn steps(value: f64, step: f64, most: i32) -> i32 {
    let most = f64::from(most);
    let steps = (value / step).round().clamp(-most, most);
    if steps.is_nan() { 0 } else { steps as i32 }
}

/// As [`steps`], towards zero, to a millionth of a step: for torques and gains, which rounding must
/// not enlarge.
pub(super) fn steps_toward_zero(value: f64, step: f64, most: i32) -> i32 {
    let whole = (value / step).abs() + 1e-6;
    steps(whole.floor().copysign(value), 1.0, most)
}

/// A torque within ± `limit`.
pub(super) fn limited(torque: f64, limit: f64) -> f64 {
    if limit >= 0.0 { torque.clamp(-limit, limit) } else { torque }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_overflows_and_nothing_is_nan() {
        assert_eq!((single(1e300), single(-1e300), single(f64::NAN)), (f32::MAX, f32::MIN, 0.0));
        assert_eq!(
            (steps(33.0, 0.001, 32_767), steps(-1e300, 0.001, 32_767), steps(f64::NAN, 1.0, 9)),
            (32_767, -32_767, 0)
        );
        assert_eq!(
            (steps(1.0, 1e-9, i32::MAX), steps(-3.0, 1e-9, i32::MAX)),
            (1_000_000_000, -i32::MAX)
        );
        assert_eq!((steps(0.0014, 0.001, 32_767), steps(0.0016, 0.001, 32_767)), (1, 2));
        assert_eq!(
            [0.0019, -0.0019, 0.002, f64::NAN, -1e300]
                .map(|value| steps_toward_zero(value, 0.001, 32_767)),
            [1, -1, 2, 0, -32_767]
        );
        assert_eq!(
            (limited(5.0, 2.0), limited(-5.0, 2.0), limited(5.0, f64::INFINITY)),
            (2.0, -2.0, 5.0)
        );
    }
}
