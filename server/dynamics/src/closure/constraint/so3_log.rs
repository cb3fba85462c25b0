//! Rotation vectors, the residuals of angular rows.

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Real, Triple};
use crate::spatial::to_quaternion;

/// Rotation vector of a rotation matrix, |θ| ≤ π.
pub(in crate::closure) fn log<T: Real>(R: &Matrix3<T>) -> Vector3<T> {
    let [x, y, z, w] = to_quaternion(R);
    let v = Vector3::new(x, y, z);
    let square = v.dot(v);
    let small = T::from_f64(T::EPSILON);
    let norm = T::select_lt(square, small, T::ONE, square).sqrt();
    let two = T::from_f64(2.0);
    let factor = T::select_lt(square, small, two / w, two * norm.atan2(w) / norm);
    v * factor
}

/// c(θ²) = (1 − (θ/2) cot(θ/2)) / θ² and its derivative by θ².
pub(in crate::closure) fn log_factors<T: Real>(theta: &Vector3<T>) -> (T, T) {
    let square = (*theta).dot(*theta);
    let small = T::from_f64(T::EPSILON);
    let s = T::select_lt(square, small, T::ONE, square);
    let half = T::from_f64(0.5);
    let x = half * s.sqrt();
    let (sine, cosine) = x.sin_cos();
    let cot = cosine / sine;
    let f = x * cot;
    let c = (T::ONE - f) / s;
    let df = (cot - x / (sine * sine)) / (T::from_f64(8.0) * x);
    let dc = -(df + c) / s;
    // PRECISION: the differences lose all digits of dc near θ = 0; its series is exact to rounding
    // where θ⁸ is
    let near = T::from_f64(T::EPSILON.sqrt().sqrt());
    let series = [3.0 / 1_209_600.0, 2.0 / 30_240.0]
        .into_iter()
        .fold(T::from_f64(4.0 / 47_900_160.0), |sum, x| sum.mul_add(square, T::from_f64(x)));
    let series = series.mul_add(square, T::ONE / T::from_f64(720.0));
    let c = T::select_lt(square, small, T::ONE / T::from_f64(12.0), c);
    (c, T::select_lt(square, near, series, dc))
}

/// The second derivative of c by θ², from c and its first one; with f = (θ/2) cot(θ/2) it follows
/// from 2 θ² f′ = f − θ²/4 − f².
pub(in crate::closure) fn second_factor<T: Real>(theta: &Vector3<T>, (c, dc): (T, T)) -> T {
    let square = (*theta).dot(*theta);
    let near = T::from_f64(T::EPSILON.sqrt().sqrt());
    let s = T::select_lt(square, near, T::ONE, square);
    let two = T::from_f64(2.0);
    let f = T::ONE - s * c;
    let df = -(s.mul_add(dc, c));
    let ddf = -(df + T::from_f64(0.25) + two * f * df) / (two * s);
    let series = [12.0 / 47_900_160.0, 6.0 / 1_209_600.0, 2.0 / 30_240.0]
        .into_iter()
        .fold(T::ZERO, |sum, x| sum.mul_add(square, T::from_f64(x)));
    T::select_lt(square, near, series, -(two.mul_add(dc, ddf)) / s)
}

/// A = 1 − ½ [θ]× + c [θ]×², the matrix of θ̇ = A ω.
pub(in crate::closure) fn rate_matrix<T: Real>(theta: &Vector3<T>, c: T) -> Matrix3<T> {
    let half = T::from_f64(0.5);
    let unit = |i: usize| {
        let e = Vector3::new(
            if i == 0 { T::ONE } else { T::ZERO },
            if i == 1 { T::ONE } else { T::ZERO },
            if i == 2 { T::ONE } else { T::ZERO },
        );
        let theta_e = (*theta).cross(e);
        e.add_scaled(theta_e, -half).add_scaled((*theta).cross(theta_e), c)
    };
    Matrix3::from_columns(&[unit(0), unit(1), unit(2)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{Dd, Real};

    #[test]
    fn the_factors_of_a_rotation_vector_keep_their_digits_at_every_angle() {
        for k in 0..400 {
            let angle = 10.0_f64.powf(-10.0 + f64::from(k) * 0.026);
            let theta = Vector3::new(0.36, -0.48, 0.8) * angle;
            let exact = theta.map(Dd::from);
            let ((c, dc), (true_c, true_dc)) = (log_factors(&theta), log_factors(&exact));
            let square = angle * angle;
            // as far as they matter: with the square of the angle
            let errors =
                [(c - true_c.to_f64()).abs() * square, (dc - true_dc.to_f64()).abs() * square];
            assert!(
                errors[0] < 1e-15 && errors[1] < 1e-11 && dc > 0.0,
                "θ = {angle:e}: {errors:?}"
            );
        }
    }
}
