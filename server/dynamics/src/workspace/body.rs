//! Quantities of the recursions for one body, in its own axes at its origin.

use crate::model::{Model, Runs};
use crate::scalar::{Real, Symmetric, Triple};
use crate::spatial::{Columns, Matrix};

/// A moment and a force, in body axes at the body's origin.
pub(crate) type Force<T> = (<T as Real>::Triple, <T as Real>::Triple);

/// Motion of one body and the force through its joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyState<T: Real> {
    /// Pose in the parent.
    pub(crate) R: Columns<T>,
    pub(crate) p: T::Triple,
    /// Angular velocity, velocity of the origin, angular acceleration, classical acceleration of
    /// the origin.
    pub(crate) w: T::Triple,
    pub(crate) v: T::Triple,
    pub(crate) alpha: T::Triple,
    pub(crate) a: T::Triple,
    /// Moment and force that the joint transmits.
    pub(crate) n: T::Triple,
    pub(crate) f: T::Triple,
}

/// Inertia of a body with everything that it supports, as if rigid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Composite<T: Real> {
    pub(crate) mass: T,
    pub(crate) h: T::Triple,
    /// About the body's origin.
    pub(crate) inertia: T::Symmetric,
}

/// Articulated inertia, bias force and acceleration of a body that carries clusters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Articulated<T: Real> {
    pub(crate) J: T::Symmetric,
    pub(crate) H: Columns<T>,
    pub(crate) M: T::Symmetric,
    /// Bias force p.
    pub(crate) n: T::Triple,
    pub(crate) f: T::Triple,
    /// Acceleration: angular, linear.
    pub(crate) alpha: T::Triple,
    pub(crate) a: T::Triple,
}

/// Scratch of the recursion.
#[derive(Clone, Debug)]
pub(crate) struct Embedding<T: Real> {
    pub(crate) bodies: Vec<Articulated<T>>,
    /// Y, a column for each independent: of one joint at its body, else at the cluster's parent.
    pub(crate) Y: Vec<Force<T>>,
    /// L and 1/Δ of each cluster, in the place of its G block.
    pub(crate) factor: Vec<T>,
}

impl<T: Real> Embedding<T> {
    pub(crate) fn new(model: &Model<T>) -> Embedding<T> {
        let bodies = vec![Articulated::none(); model.bodies.len()];
        Embedding {
            bodies,
            Y: vec![(T::Triple::zero(), T::Triple::zero()); model.meta.sizes.n_vy],
            factor: vec![T::ZERO; model.n_g],
        }
    }

    /// 1/Δ of each independent of the given clusters after [`embedded_solve`], in internal order.
    pub(crate) fn inverses<'a, C>(
        &'a self,
        model: &'a Model<C>,
        clusters: &'a Runs,
    ) -> impl Iterator<Item = T> + 'a {
        clusters
            .runs()
            .flat_map(|run| &model.clusters[run])
            .flat_map(|cluster| (0..cluster.n_vy).map(|k| cluster.G(&self.factor)[(k, k)]))
    }
}

impl<T: Real> BodyState<T> {
    /// At the parent, without motion or force.
    pub(crate) fn at_rest() -> BodyState<T> {
        let zero = T::Triple::zero();
        BodyState {
            R: Matrix::identity(),
            p: zero,
            w: zero,
            v: zero,
            alpha: zero,
            a: zero,
            n: zero,
            f: zero,
        }
    }
}

impl<T: Real> Articulated<T> {
    #[inline(always)]
    pub(crate) fn none() -> Articulated<T> {
        let none = T::Symmetric::ZERO;
        let zero = T::Triple::zero();
        Articulated { J: none, H: [zero; 3], M: none, n: zero, f: zero, alpha: zero, a: zero }
    }
}
