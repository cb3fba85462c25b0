//! Errors relative to size: |a − b| ≤ tolerance × max(‖b‖∞, s).

use sarrus_dynamics::scalar::Real;

/// The largest difference of two arrays, relative to the larger of ‖b‖∞ and `least`.
pub fn error_by_size<T: Real>(a: &[T], b: &[T], least: f64) -> f64 {
    assert_eq!(a.len(), b.len(), "arrays of different lengths");
    let size = b.iter().fold(least, |size, x| size.max(x.to_f64().abs()));
    let worst = a.iter().zip(b).fold(0.0, |worst: f64, (a, b)| {
        let difference = (*a - *b).to_f64().abs();
        if difference.is_nan() { f64::INFINITY } else { worst.max(difference) }
    });
    if worst == 0.0 { 0.0 } else { worst / size }
}

/// Panics with the name if the error exceeds the tolerance.
pub fn assert_close<T: Real>(what: &str, a: &[T], b: &[T], least: f64, tolerance: f64) {
    let error = error_by_size(a, b, least);
    assert!(
        error <= tolerance,
        "{what}: error {error:.3e} by size, allowed {tolerance:.1e}\n left {a:?}\nright {b:?}"
    );
}

/// ‖x‖∞.
pub fn largest<T: Real>(x: &[T]) -> f64 {
    x.iter().fold(0.0, |size, x| size.max(x.to_f64().abs()))
}
