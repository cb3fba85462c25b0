//! Scratch of the fields of actuators.

use sarrus_proto::{MOST_VERTEX_COORDINATES, MOST_VERTICES};

use crate::linalg::Zonotope;
use crate::model::Model;
use crate::scalar::Real;

/// Most actuators of one set of vertices.
pub(crate) const MOST_SEGMENTS: usize = 64;

/// Numbers of the sets of forces and velocities; empty where no plan has such fields.
#[derive(Clone, Debug)]
pub(crate) struct MotorScratch<T> {
    /// Least and greatest force of each actuator (n_u); NaN without a limit.
    pub(crate) limits: Vec<[T; 2]>,
    /// An actuator without a limit that a wanted field depends on was met.
    pub(crate) no_limit: bool,
    /// Segments of a set, a row each, and their number; its lowest corner.
    pub(crate) segments: Vec<T>,
    pub(crate) n: usize,
    pub(crate) base: Vec<T>,
    pub(crate) scratch: Vec<T>,
    pub(crate) signs: Vec<u64>,
    /// Margin of τ_y, infinite without a force and NaN without a limit, and 1 or −1 for the
    /// actuators at their upper or lower limit there (n_u).
    pub(crate) margin: T,
    pub(crate) binding: Vec<T>,
    /// The state of one cluster, kept while it is closed at other velocities.
    pub(crate) kept: Vec<T>,
}

impl<T: Real> MotorScratch<T> {
    /// For every plan on a model. Allocates.
    pub(crate) fn new(model: &Model<T>) -> MotorScratch<T> {
        let n_u = model.sizes().n_u;
        let clusters = || model.clusters.iter();
        let most = |of: &dyn Fn(usize, usize) -> usize| {
            let own = clusters().map(|c| of(c.active.len(), c.n_vy)).max().unwrap_or(0);
            own.max(of(n_u.min(MOST_SEGMENTS), MOST_VERTEX_COORDINATES))
        };
        let widest = clusters().map(|c| c.n_vy).max().unwrap_or(0);
        let kept = clusters().map(|c| 2 * (c.n_q + c.n_v) + c.n_v * c.n_vy).max().unwrap_or(0);
        MotorScratch {
            limits: vec![[T::ZERO; 2]; n_u],
            no_limit: false,
            segments: vec![T::ZERO; most(&|m, p| m * p).max(widest * widest)],
            n: 0,
            base: vec![T::ZERO; widest.max(MOST_VERTEX_COORDINATES)],
            scratch: vec![T::ZERO; most(&Zonotope::<T>::scratch)],
            signs: vec![0; MOST_VERTICES],
            margin: T::ZERO,
            binding: vec![T::ZERO; n_u],
            kept: Vec::with_capacity(kept),
        }
    }
}
