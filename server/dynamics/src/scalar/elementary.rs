pub(super) fn sin_cos(x: f64) -> (f64, f64) { f64::sin_cos(x) }
pub(super) fn atan2(y: f64, x: f64) -> f64 { f64::atan2(y, x) }
