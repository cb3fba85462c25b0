//! Linear couplings: dependents that are fixed combinations of the independents (`<mimic>`, geared
//! transmissions, differentials, parallelograms).
//!
//! A bevel gear differential needs no separate closure: with roll and pitch of the cage, its wheels
//! turn by roll + pitch and roll − pitch, two couplings of two masters each. A file of type
//! DIFFERENTIAL (or TRANSMISSION) holds one coupling for each dependent joint; it may express the
//! wheels by the cage or the cage by the wheels.

use crate::closure::{Level, Local, Numerical};
use crate::mechanism::{Body, Cluster, Motion};
use crate::scalar::{Real, constants};

/// q = M y + b.
#[derive(Clone, Debug)]
pub(crate) struct Coupling<T> {
    /// M (n × n_vy, row-major), identity rows at the independents.
    pub(crate) M: Vec<T>,
    /// b (n).
    pub(crate) b: Vec<T>,
    /// Newton's method on the true rows, for loops that are only nearly parallelograms.
    pub(crate) polish: Option<Numerical<T>>,
}

constants! { Coupling:
    list M b;
    each polish;
}

impl<T: Real> Coupling<T> {
    /// Position, velocity and acceleration level; g = 0.
    pub(crate) fn close(
        &self,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        local: &mut Local<'_, T>,
        level: Level,
    ) {
        let m = cluster.n_vy;
        for j in cluster.dependent.iter().copied() {
            let mut q = self.b[j];
            let mut qd = T::ZERO;
            for (k, &i) in cluster.independent.iter().enumerate() {
                let c = self.M[j * m + k];
                q = c.mul_add(local.q[i], q);
                qd = c.mul_add(local.qd[i], qd);
            }
            local.q[j] = q;
            if level >= Level::Velocity {
                local.qd[j] = qd;
            }
        }
        for j in 0..cluster.n {
            if bodies[j].motion == Motion::Revolute {
                let (s, c) = local.q[j].sin_cos();
                local.cos_sin[j] = (c, s);
            }
        }
        if level >= Level::Jacobian {
            for (G, c) in local.G.iter_mut().zip(&self.M) {
                *G = *c;
            }
            local.g.fill(T::ZERO);
        }
    }
}
