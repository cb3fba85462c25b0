//! Gains towards a target: a proportional and a derivative term.

use sarrus_dynamics::scalar::Real;

/// τ += kp (target − x), τ += −kd ẋ; without a coordinate x there is no first term.
///
/// `pull` is kp, target and x, `drag` is kd and ẋ.
pub(super) fn add<T: Real>(tau: &mut T, pull: Option<(f64, f64, T)>, drag: (f64, T)) {
    if let Some((stiffness, target, x)) = pull {
        *tau += T::from_f64(stiffness) * (T::from_f64(target) - x);
    }
    let (damping, v) = drag;
    *tau += -(T::from_f64(damping) * v);
}
