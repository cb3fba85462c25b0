//! One cluster as a single joint: its force columns and its block of the mass matrix, from the
//! inertia that each of its bodies supports.
//!
//! With S_i the axes of body i, I_i the inertia that it supports, and G_i the rows of G at its
//! joint, a unit acceleration of the independents takes on body i the forces [J12, part II; F08,
//! 6.2, with columns joined by G]
//!
//! ```text
//! F_i = Σ_children X F + I_i S_i G_i          at the parent body: U = Σ X F
//! D   = Σ_i G_iᵀ S_iᵀ F_i + its mirror image  (each pair of joints once)
//! ```
//!
//! so that the cost grows with bodies × independents, never with the square of the bodies.

use crate::mechanism::{Cluster, GBlock, Motion};
use crate::model::Model;
use crate::scalar::{Real, Symmetric, Triple};
use crate::spatial::Matrix;
use crate::workspace::{BodyState, Composite, Force};

/// One cluster as a single joint: the model and the poses from which its columns are formed.
pub(super) struct ClusterJoint<'a, T: Real> {
    pub(super) model: &'a Model<T>,
    pub(super) cluster: &'a Cluster<T>,
    pub(super) G: GBlock<'a, T>,
    pub(super) motion: &'a [BodyState<T>],
}

impl<T: Real> ClusterJoint<'_, T> {
    /// D (m×m row-major) and U (m columns at the parent body; left zero where that is the world).
    /// `column` gives I_i s for dof k of local body i; `F` is scratch for m columns of each body.
    /// `uncoupled_diagonal` (m) is the diagonal of D if each joint moved alone, Σ_i G_i² s·I_i s;
    /// the ratio of D to it measures the cancellation. M is m where the compiler knows it and
    /// unrolls the loops, else 0.
    #[inline(always)]
    pub(super) fn columns<const M: usize>(
        &self,
        column: impl Fn(usize, Motion, usize) -> Force<T>,
        F: &mut [Force<T>],
        U: &mut [Force<T>],
        D: &mut [T],
        uncoupled_diagonal: &mut [T],
    ) {
        let ClusterJoint { model, cluster, G, motion } = *self;
        let n = cluster.n;
        let m = if M > 0 { M } else { cluster.n_vy };
        let D = &mut D[..m * m];
        D.fill(T::ZERO);
        let none = (T::Triple::zero(), T::Triple::zero());
        F[..n * m].fill(none);
        U[..m].fill(none);
        let uncoupled_diagonal = &mut uncoupled_diagonal[..m];
        uncoupled_diagonal.fill(T::ZERO);
        for i in (0..n).rev() {
            let body = &model.bodies[cluster.body + i];
            let (before, F_i) = F.split_at_mut(i * m);
            let F_i = &mut F_i[..m];
            for k in 0..body.motion.n_v() {
                let G_i = &G.row(body.v - cluster.v + k)[..m];
                let own = column(i, body.motion, k);
                // its own inertia counts half: the mirror image brings the other half
                let half = component::<T>(body.motion, k, &own) * T::from_f64(0.5);
                for l in 0..m {
                    let t = half.mul_add(G_i[l], component(body.motion, k, &F_i[l]));
                    uncoupled_diagonal[l] =
                        (half + half).mul_add(G_i[l] * G_i[l], uncoupled_diagonal[l]);
                    for j in 0..m {
                        D[j * m + l] = G_i[j].mul_add(t, D[j * m + l]);
                    }
                    let g = T::Triple::splat(G_i[l]);
                    F_i[l] = (own.0.mul_add(g, F_i[l].0), own.1.mul_add(g, F_i[l].1));
                }
            }
            let to = match cluster.local_parent[i] {
                0 if cluster.parent == 0 => continue,
                0 => &mut U[..m],
                parent => &mut before[(parent - 1) * m..][..m],
            };
            for (to, force) in to.iter_mut().zip(F_i) {
                let (n, f) = transform_force(force, &motion[cluster.body + i]);
                to.0 += n;
                to.1 += f;
            }
        }
        for k in 0..m {
            for l in 0..=k {
                let x = D[k * m + l] + D[l * m + k];
                D[k * m + l] = x;
                D[l * m + k] = x;
            }
        }
    }
}

/// Component of a force along dof k of a joint.
#[inline(always)]
pub(super) fn component<T: Real>(motion: Motion, k: usize, force: &Force<T>) -> T {
    match (motion, k) {
        (Motion::Revolute, _) => force.0[2],
        (Motion::Prismatic, _) => force.1[2],
        (Motion::Spherical, _) | (Motion::Floating, 0..3) => force.0[k],
        (Motion::Floating, _) => force.1[k - 3],
    }
}

/// X f: n' = R n + p × R f, f' = R f, at the parent's origin in the parent's axes.
#[inline(always)]
pub(super) fn transform_force<T: Real>(force: &Force<T>, state: &BodyState<T>) -> Force<T> {
    let f = state.R.apply(force.1);
    (state.R.apply(force.0).add_cross(state.p, f), f)
}

impl<T: Real> Composite<T> {
    /// The inertia of one body alone.
    #[inline(always)]
    pub(super) fn of(body: &crate::mechanism::Body<T>) -> Composite<T> {
        let inertia = T::Symmetric::new(body.inertia);
        Composite { mass: body.mass, h: T::Triple::of(&body.h), inertia }
    }

    /// Adds another inertia about the same origin.
    #[inline(always)]
    pub(super) fn add(&mut self, other: &Composite<T>) {
        self.mass += other.mass;
        self.h += other.h;
        self.inertia += other.inertia;
    }

    /// Force that a unit acceleration of dof k of a joint takes.
    #[inline(always)]
    pub(super) fn column(&self, motion: Motion, k: usize) -> Force<T> {
        let Composite { mass, h, inertia } = self;
        match motion {
            Motion::Revolute => (inertia.column(2), T::Triple::new(-h[1], h[0], T::ZERO)),
            Motion::Prismatic => {
                (T::Triple::new(h[1], -h[0], T::ZERO), T::Triple::new(T::ZERO, T::ZERO, *mass))
            }
            Motion::Spherical | Motion::Floating => {
                let axis = |i: usize| if k % 3 == i { T::ONE } else { T::ZERO };
                let e = T::Triple::new(axis(0), axis(1), axis(2));
                if k < 3 {
                    (inertia.column(k), T::Triple::zero().add_cross(e, *h))
                } else {
                    (T::Triple::zero().add_cross(*h, e), e.times(T::Triple::splat(*mass)))
                }
            }
        }
    }

    /// The inertia about the parent's origin in the parent's axes:
    /// I' = R I Rᵀ + 2 (b·p) 1 − b pᵀ − p bᵀ with b = R h + m p / 2.
    #[inline(always)]
    pub(super) fn transformed(&self, state: &BodyState<T>) -> Composite<T> {
        let R = &state.R;
        let p = &state.p;
        let h = R.apply(self.h);
        let mass = T::Triple::splat(self.mass);
        let half = self.mass * T::from_f64(0.5);
        let b = T::Triple::splat(half).mul_add(*p, h);
        Composite {
            mass: self.mass,
            h: mass.mul_add(*p, h),
            inertia: self.inertia.rotate(R).parallel_axis(&b, p),
        }
    }
}
