//! Springs, dampers and rotors in the joints: parts of C and of M that touch single coordinates
//! [F08, 9.6 for rotors whose gyroscopic part is left out].

use crate::mechanism::{GBlock, Rotor};
use crate::model::{Model, Scope};
use crate::scalar::Real;

/// τ += N² I q̈ + d q̇ + k (q − rest).
#[inline]
pub(super) fn joint_forces<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    q: &[T],
    qd: &[T],
    qdd: &[T],
    tau: &mut [T],
) {
    spring_forces(model, scope, q, tau);
    for damper in scope.dampers.runs().flat_map(|run| &model.terms.dampers[run]) {
        tau[damper.v] = damper.damping.mul_add(qd[damper.v], tau[damper.v]);
    }
    for rotor in scope.rotors.runs().flat_map(|run| &model.terms.rotors[run]) {
        tau[rotor.v] = rotor.inertia.mul_add(qdd[rotor.v], tau[rotor.v]);
    }
}

/// τ += k (q − rest).
#[inline]
pub(super) fn spring_forces<T: Real>(model: &Model<T>, scope: &Scope, q: &[T], tau: &mut [T]) {
    for spring in scope.springs.runs().flat_map(|run| &model.terms.springs[run]) {
        tau[spring.v] = spring.stiffness.mul_add(q[spring.q] - spring.rest, tau[spring.v]);
    }
}

/// D_kl += N² I G_k G_l for each rotor of the cluster with the n_v velocities from `v` on. Pops the
/// rotors of the cluster, and those behind it, off the end of `rotors`.
#[inline(always)]
pub(super) fn add_rotors<T: Real>(
    rotors: &mut &[Rotor<T>],
    (v, n_v): (usize, usize),
    G: GBlock<'_, T>,
    D: &mut [T],
    m: usize,
) {
    if rotors.last().is_some_and(|rotor| rotor.v >= v) {
        add_last_rotors(rotors, (v, n_v), G, D, m);
    }
}

#[inline(never)]
fn add_last_rotors<T: Real>(
    rotors: &mut &[Rotor<T>],
    (v, n_v): (usize, usize),
    G: GBlock<'_, T>,
    D: &mut [T],
    m: usize,
) {
    while let Some((rotor, before)) = rotors.split_last() {
        if rotor.v < v {
            break;
        }
        if rotor.v >= v + n_v {
            *rotors = before;
            continue;
        }
        let g = G.row(rotor.v - v);
        for k in 0..m {
            let x = rotor.inertia * g[k];
            for l in 0..=k {
                D[k * m + l] = x.mul_add(g[l], D[k * m + l]);
            }
        }
        *rotors = before;
    }
}
