//! Couplings: dependents that are fixed combinations of the independents (`<mimic>`, geared
//! transmissions, differentials, parallelograms), and of curves over joints before them (cams,
//! knees).
//!
//! A bevel gear differential needs no separate closure: with roll and pitch of the cage, its wheels
//! turn by roll + pitch and roll − pitch, two couplings of two masters each. A file of type
//! DIFFERENTIAL (or TRANSMISSION) holds one coupling for each dependent joint; it may express the
//! wheels by the cage or the cage by the wheels.

use crate::closure::{Level, Local, Numerical};
use crate::mechanism::{Cluster, Curve, Motion};
use crate::scalar::{Real, constants};

/// q = M y + b + Σ share · f(q).
#[derive(Clone, Debug)]
pub(crate) struct Coupling<T> {
    /// M (n × n_vy, row-major), identity rows at the independents.
    pub(crate) M: Vec<T>,
    /// b (n).
    pub(crate) b: Vec<T>,
    /// Curves, each after those that move its joint, and their shares in the joints (n).
    pub(crate) curves: Vec<(Curve<T>, Vec<T>)>,
    /// Newton's method on the true rows, for loops that are only nearly parallelograms.
    pub(crate) polish: Option<Numerical<T>>,
}

constants! { Coupling:
    list M b;
    each polish;
    other curves: |f, (curve, shares)| (curve.map(f), shares.each(|x| f(*x)));
}

impl<T: Real> Coupling<T> {
    /// The dependents where the independents are zero.
    pub(crate) fn at_zero(&self, cluster: &Cluster<T>, q: &mut [T]) {
        cluster.dependent.iter().for_each(|j| q[*j] = self.b[*j]);
        for (curve, shares) in &self.curves {
            let f = curve.at(q[curve.of.q])[0];
            cluster.dependent.iter().for_each(|j| q[*j] += shares[*j] * f);
        }
    }

    /// Position, velocity and acceleration level.
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) {
        let &mut Local { cluster, bodies, .. } = local;
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
        if level >= Level::Jacobian {
            local.G.copy_from_slice(&self.M);
            local.g.fill(T::ZERO);
        }
        for (curve, shares) in &self.curves {
            let [f, f1, f2, _] = curve.at(local.q[curve.of.q]);
            let v = curve.of.v;
            let rate = local.qd[v];
            for j in cluster.dependent.iter().copied() {
                let share = shares[j];
                local.q[j] = share.mul_add(f, local.q[j]);
                if level >= Level::Jacobian {
                    for k in 0..m {
                        local.G[j * m + k] =
                            (share * f1).mul_add(local.G[v * m + k], local.G[j * m + k]);
                    }
                }
                if level >= Level::Velocity {
                    local.qd[j] = (share * f1).mul_add(rate, local.qd[j]);
                }
                if level >= Level::Acceleration {
                    let bias = f1.mul_add(local.g[v], f2 * rate * rate);
                    local.g[j] = share.mul_add(bias, local.g[j]);
                }
            }
        }
        for j in 0..cluster.n {
            if bodies[j].motion == Motion::Revolute {
                let (s, c) = local.q[j].sin_cos();
                local.cos_sin[j] = (c, s);
            }
        }
    }
}
