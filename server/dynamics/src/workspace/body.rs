//! What the recursions keep for one body, in its own axes at its origin.

use nalgebra::{Matrix3, Vector3};

use crate::model::{Model, Runs};
use crate::scalar::Real;
use crate::spatial::zero;

/// A moment and a force, in body axes at the body's origin.
pub(crate) type Force<T> = (Vector3<T>, Vector3<T>);

/// Motion of one body and the force through its joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyState<T> {
    /// Pose in the parent.
    pub(crate) R: Matrix3<T>,
    pub(crate) p: Vector3<T>,
    /// Angular velocity, velocity of the origin, angular acceleration, classical acceleration of
    /// the origin.
    pub(crate) w: Vector3<T>,
    pub(crate) v: Vector3<T>,
    pub(crate) alpha: Vector3<T>,
    pub(crate) a: Vector3<T>,
    /// Moment and force that the joint transmits.
    pub(crate) n: Vector3<T>,
    pub(crate) f: Vector3<T>,
}

/// Inertia of a body with everything that it supports, as if rigid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Composite<T> {
    pub(crate) mass: T,
    pub(crate) h: Vector3<T>,
    /// xx xy xz yy yz zz about the body's origin.
    pub(crate) inertia: [T; 6],
}

/// Articulated inertia, bias force and acceleration of a body that carries clusters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Articulated<T> {
    /// xx xy xz yy yz zz of J and M.
    pub(crate) J: [T; 6],
    pub(crate) H: Matrix3<T>,
    pub(crate) M: [T; 6],
    /// Bias force p.
    pub(crate) n: Vector3<T>,
    pub(crate) f: Vector3<T>,
    /// Acceleration: angular, linear.
    pub(crate) alpha: Vector3<T>,
    pub(crate) a: Vector3<T>,
}

/// Scratch of the recursion.
#[derive(Clone, Debug)]
pub(crate) struct Embedding<T> {
    pub(crate) bodies: Vec<Articulated<T>>,
    /// Y, a column for each independent: of one joint at its body, else at the cluster's parent.
    pub(crate) Y: Vec<Force<T>>,
    /// L and 1/Δ of each cluster, in the place of its G block.
    pub(crate) factor: Vec<T>,
}

impl<T: Real> Embedding<T> {
    pub(crate) fn new(model: &Model<T::Const>) -> Embedding<T> {
        let bodies = vec![Articulated::none(); model.bodies.len()];
        Embedding {
            bodies,
            Y: vec![(zero(), zero()); model.meta.sizes.n_vy],
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

impl<T: Real> Articulated<T> {
    #[inline(always)]
    pub(crate) fn none() -> Articulated<T> {
        let none = [T::ZERO; 6];
        Articulated {
            J: none,
            H: Matrix3::from_element(T::ZERO),
            M: none,
            n: zero(),
            f: zero(),
            alpha: zero(),
            a: zero(),
        }
    }
}
