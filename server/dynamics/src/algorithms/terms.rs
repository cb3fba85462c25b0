//! Springs, dampers and rotors in the joints: parts of C and of M that touch single coordinates
//! [F08, 9.6 for rotors whose gyroscopic part is left out].

use crate::mechanism::Rotor;
use crate::model::Model;
use crate::scalar::Real;

/// τ += N² I q̈ + d q̇ + k (q − rest).
#[inline]
pub(super) fn joint_forces<T: Real>(
    model: &Model<T::Const>,
    q: &[T],
    qd: &[T],
    qdd: &[T],
    tau: &mut [T],
) {
    for spring in &model.terms.springs {
        tau[spring.v] =
            T::lift(spring.stiffness).mul_add(q[spring.q] - T::lift(spring.rest), tau[spring.v]);
    }
    for damper in &model.terms.dampers {
        tau[damper.v] = T::lift(damper.damping).mul_add(qd[damper.v], tau[damper.v]);
    }
    for rotor in &model.terms.rotors {
        tau[rotor.v] = T::lift(rotor.inertia).mul_add(qdd[rotor.v], tau[rotor.v]);
    }
}

/// D_kl += N² I G_k G_l for each rotor of the cluster that has the velocities from `v` on: the last
/// ones of `rotors`, which are taken off.
#[inline]
pub(super) fn add_rotors<T: Real>(
    rotors: &mut &[Rotor<T::Const>],
    v: usize,
    G: &[T],
    D: &mut [T],
    m: usize,
) {
    while let Some((rotor, before)) = rotors.split_last() {
        if rotor.v < v {
            break;
        }
        let g = &G[(rotor.v - v) * m..][..m];
        for k in 0..m {
            let x = T::lift(rotor.inertia) * g[k];
            for l in 0..=k {
                D[k * m + l] = x.mul_add(g[l], D[k * m + l]);
            }
        }
        *rotors = before;
    }
}
