//! Linear couplings: dependents that are fixed combinations of the independents (`<mimic>`, geared
//! transmissions, differentials, parallelograms).
//!
//! A bevel gear differential needs no closure of its own: with roll and pitch of the cage, its
//! wheels turn by roll + pitch and roll − pitch, two couplings of two masters each. A file of type
//! DIFFERENTIAL (or TRANSMISSION) holds one coupling for each dependent joint; whether it gives the
//! wheels by the cage or the cage by the wheels does not matter.

use crate::closure::{Level, Local, Numerical};
use crate::mechanism::{Body, Cluster, Motion};
use crate::scalar::Real;

/// q = M y + b.
#[derive(Clone, Debug)]
pub(crate) struct Coupling<C> {
    /// M (n × n_vy, row-major), identity rows at the independents.
    pub(crate) M: Vec<C>,
    /// b (n).
    pub(crate) b: Vec<C>,
    /// Newton's method on the true rows, of loops that are only nearly parallelograms.
    pub(crate) polish: Option<Numerical<C>>,
}

impl<C: nalgebra::Scalar + Copy> Coupling<C> {
    /// Position, velocity and acceleration level; g = 0.
    pub(crate) fn close<T: Real<Const = C>>(
        &self,
        cluster: &Cluster<C>,
        bodies: &[Body<C>],
        local: &mut Local<'_, T>,
        level: Level,
    ) {
        let m = cluster.n_vy;
        for j in cluster.dependent.iter().copied() {
            let (mut q, mut qd) = (T::lift(self.b[j]), T::ZERO);
            for (k, &i) in cluster.independent.iter().enumerate() {
                let c = T::lift(self.M[j * m + k]);
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
                *G = T::lift(*c);
            }
            local.g.fill(T::ZERO);
        }
    }

    /// The same coupling with every constant converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Coupling<D> {
        Coupling {
            M: self.M.iter().map(|x| f(*x)).collect(),
            b: self.b.iter().map(|x| f(*x)).collect(),
            polish: self.polish.as_ref().map(|numerical| numerical.map(f)),
        }
    }
}
