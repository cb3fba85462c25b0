//! A closed pose near a given one.
//!
//! ```text
//!   minimise  Σ w_j (d_j / l_j)²   subject to   φ(q) = 0        d = q − near
//! ```
//! cluster by cluster, since φ is. d_j is the distance along a tree velocity from the given pose: a
//! difference of coordinates, of a quaternion the rotation vector from the given turn and the
//! difference of the positions. l_j is 1 rad for a turn and the cluster's length for a slide. First
//! the rows are closed ([`close`]), then the pose descends along the closed poses until the
//! distance is stationary ([`descend`]).

mod close;
mod descend;
mod open;
mod problem;
mod rezero;

use problem::Candidate;

use crate::model::{Model, assess};

pub use open::OpenModel;
use problem::Problem;
pub use rezero::{closing_placements, displaced, rezeroed};
pub(crate) use rezero::{has_moved, moved, n_q, placed, placement};

/// A closed pose near a given one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assembled {
    /// Tree coordinates `[m, rad]` (n_q).
    pub q: Vec<f64>,
    /// Largest scaled loop residual, as the field `residual` has it.
    pub residual: f64,
    /// Residual at the given pose.
    pub residual_before: f64,
    /// √ Σ w_j (d_j / l_j)² over the joints that are not kept fixed.
    pub distance: f64,
    /// Steps taken, over all clusters.
    pub iterations: u32,
    /// Branch of each closed cluster that is not a pure coupling: the sign of det K_d, 1 or −1;
    /// empty for an open model.
    pub branch: Vec<f64>,
}

/// Why there is no closed pose.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AssembleError {
    /// A list of another length than the model's.
    #[error("{found} numbers in {what}, expected {expected}")]
    WrongSize {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that the model needs.
        expected: usize,
    },
    /// A coordinate of the given pose that is no number, or a quaternion that is not of unit
    /// length.
    #[error("the given pose has {found} at {name}, expected {expected}")]
    BadPose {
        /// The coordinate.
        name: String,
        /// The given value.
        found: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// A weight that is negative or no number, or only a part of a quaternion joint kept fixed.
    #[error("the weight of {name} is {found}, expected {expected}")]
    BadWeights {
        /// The tree velocity.
        name: String,
        /// The given value.
        found: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// The loops cannot be closed by going downhill, from the given pose and from others around it.
    #[error(
        "no closed pose was found near the given one; the nearest still has a residual of \
        {residual:.3e}"
    )]
    Unreachable {
        /// Largest scaled loop residual of the nearest pose.
        residual: f64,
        /// The pose of least residual that was found (n_q).
        nearest: Vec<f64>,
    },
    /// A closed pose was found, but not the nearest one around it within the steps that are
    /// allowed.
    #[error("a closed pose was found, but the distance still falls with a slope of {slope:.3e}")]
    NotConverged {
        /// Slope of the distance along the closed poses.
        slope: f64,
        /// Largest scaled loop residual of the pose.
        residual: f64,
        /// The closed pose that was found (n_q).
        nearest: Vec<f64>,
    },
}

impl Model<f64> {
    /// Finds a closed pose near a given one: a local minimum of √ Σ w_j (d_j / l_j)² among the
    /// closed poses.
    ///
    /// `near` `[m, rad]` (n_q) need not be closed. `weights` (n_v) are the costs of a rotation by
    /// 1 rad, or of a slide by the length of the joint's mechanism; 0 makes a joint free, infinity
    /// fixes it at the given pose (of a joint of several degrees of freedom all or none). Limits of
    /// joints are ignored. Joints outside loops stay.
    ///
    /// Cost: singular value decompositions of each closed cluster's rows, some milliseconds.
    /// Allocates.
    ///
    /// # Errors
    /// Lists of a wrong length or with numbers that mean nothing; no closed pose; no minimum.
    ///
    /// # Example
    /// ```
    /// use sarrus_dynamics::{AssembleError, Assembled, Model};
    /// /// The closed pose that moves the k-th joint not at all.
    /// fn holding(model: &Model, near: &[f64], k: usize) -> Result<Assembled, AssembleError> {
    ///     let mut weights = vec![1.0; model.sizes().n_v];
    ///     weights[k] = f64::INFINITY;
    ///     model.assemble(near, &weights)
    /// }
    /// ```
    pub fn assemble(&self, near: &[f64], weights: &[f64]) -> Result<Assembled, AssembleError> {
        let order = &self.order;
        let (near, weights) = checked(self, near, weights)?;
        let mut q = near.clone();
        let mut found = Assembled::default();
        let mut open = false;
        let mut slope = 0.0;
        // a cluster without ranked rows has no branch
        let judged = |c: &&usize| !self.clusters[**c].used.is_empty();
        let branches: Vec<usize> = order.branches.iter().filter(judged).copied().collect();
        found.branch = vec![0.0; branches.len()];

        // one cluster does not know of another
        for &c in &self.closed_clusters {
            let cluster = &self.clusters[c];
            let bodies = self.bodies_of(cluster);
            let range = cluster.coordinates();
            let problem =
                Problem::new(cluster, bodies, &near[range.clone()], &weights[cluster.velocities()]);
            let mut candidate = Candidate::new(&problem, near[range.clone()].to_vec());
            found.residual_before = found.residual_before.max(candidate.residual);
            let closed = problem.close_somewhere(&mut candidate, &mut found.iterations);
            if closed {
                slope = f64::max(slope, problem.descend(&mut candidate, &mut found.iterations));
            }
            open |= !closed;
            found.residual = found.residual.max(candidate.residual);
            q[range].copy_from_slice(&candidate.q);
            if let Some(at) = branches.iter().position(|branch| *branch == c) {
                found.branch[at] = assess(cluster, bodies, &candidate.q).1;
            }
            // squared distance of the joints that may move
            let gone = problem.away(&candidate.q);
            let square: f64 =
                problem.free.iter().map(|v| weights[cluster.v + v] * gone[*v] * gone[*v]).sum();
            found.distance = found.distance.hypot(square.sqrt());
        }
        found.q = order.q.iter().map(|at| q[*at]).collect();
        if open {
            return Err(AssembleError::Unreachable { residual: found.residual, nearest: found.q });
        }
        if slope > descend::FLAT {
            return Err(AssembleError::NotConverged {
                slope,
                residual: found.residual,
                nearest: found.q,
            });
        }
        Ok(found)
    }

    /// The zero pose of the joints as described, closed or not; quaternions at rest (n_q).
    pub fn tree_zero(&self) -> Vec<f64> {
        self.order.q.iter().map(|at| self.described_zero[*at]).collect()
    }

    /// Unit of distance along each tree velocity in [`Model::assemble`]: 1 rad, or the length of
    /// the joint's cluster `[m]` (n_v).
    pub fn tree_units(&self) -> Vec<f64> {
        let mut units = vec![1.0; self.order.v.len()];
        for cluster in &self.clusters {
            let own = problem::units(cluster).into_iter().enumerate();
            own.for_each(|(v, x)| units[cluster.v + v] = x);
        }
        self.order.v.iter().map(|at| units[*at]).collect()
    }
}

/// The given pose and weights in the order of the bodies; quaternions to the last digit of unit
/// length.
fn checked(
    model: &Model<f64>,
    near: &[f64],
    weights: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), AssembleError> {
    let size = |what, found, expected| {
        if found == expected {
            Ok(())
        } else {
            Err(AssembleError::WrongSize { what, found, expected })
        }
    };
    let bad_pose = |name: String, found, expected| AssembleError::BadPose { name, found, expected };
    let bad_weights =
        |name: String, found, expected| AssembleError::BadWeights { name, found, expected };
    size("the given pose", near.len(), model.order.q.len())?;
    size("the weights", weights.len(), model.order.v.len())?;
    let mut q = vec![0.0; near.len()];
    let mut w = vec![0.0; weights.len()];
    for ((&x, &at), name) in near.iter().zip(&model.order.q).zip(model.tree_q_names()) {
        if !x.is_finite() {
            return Err(bad_pose(name.clone(), x, "a finite number"));
        }
        q[at] = x;
    }
    let names = model.tree_names();
    for ((&x, &at), name) in weights.iter().zip(&model.order.v).zip(names) {
        if x.is_nan() || x < 0.0 {
            return Err(bad_weights(name.clone(), x, "0 (free) or more, infinite (fixed)"));
        }
        w[at] = x;
    }
    for body in model.bodies[1..].iter().filter(|body| body.motion.n_q() > 1) {
        let four = &mut q[body.q + body.motion.n_q() - 4..body.q + body.motion.n_q()];
        let length = four.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (length - 1.0).abs() > 1e-6 {
            let at = model.order.q.iter().position(|at| *at == body.q);
            let name = at.and_then(|e| model.tree_q_names().get(e)).cloned().unwrap_or_default();
            return Err(bad_pose(name, length, "a quaternion of unit length"));
        }
        four.iter_mut().for_each(|x| *x /= length);
        // a part of a turn cannot be held while the rest goes on
        let velocities = body.v..body.v + body.motion.n_v();
        let fixed = w[velocities.clone()].iter().filter(|x| x.is_infinite()).count();
        if fixed != 0 && fixed != velocities.len() {
            let name = names[model.order.v_external[body.v]].clone();
            return Err(bad_weights(name, w[body.v], "all freedoms of this joint fixed or none"));
        }
    }
    Ok((q, w))
}
