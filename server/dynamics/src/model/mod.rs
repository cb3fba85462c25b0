//! The compiled robot: flat arrays, immutable, shared by every plan.
//!
//! Bodies are numbered from 1 in depth-first order over clusters; body 0 is the world. Every joint
//! moves along or about the z axis of its body: loading rotates the frames of the bodies
//! accordingly, and keeps a link's own frame as a [`Frame`].

mod bound;
mod closures_at_zero;
mod compiled;
mod method;
mod order;
mod parts;
mod runs;
mod scope;
mod tolerance;

use std::sync::Arc;

use nalgebra::Vector3;
use sarrus_proto::{ClosureInfo, ModelInfo, Sizes};

pub(crate) use bound::ACTUATOR_STEPS;
pub use bound::Bound;
pub use closures_at_zero::ClosureAtZero;
pub(crate) use closures_at_zero::assess;
pub use compiled::Compiled;
pub use method::Method;
pub(crate) use order::{Limit, Order};
pub use parts::Part;
pub(crate) use runs::Runs;
pub(crate) use scope::{Direct, Roots, Scope};

use crate::closure::Closure;
use crate::linalg::TreeSparsity;
use crate::mechanism::{Body, Cluster, Frame, JointTerms, Motor};
use crate::scalar::{Real, constants};

/// Ratio of a joint's inertia to its articulated inertia above which forward dynamics loses more
/// than six digits and compilation warns.
pub(crate) const UNEQUAL: f64 = 1e6;

/// A robot ready to run, with constants of type `C`.
#[derive(Clone, Debug)]
pub struct Model<C = f64> {
    /// Names and sizes, shared by both precisions.
    pub(crate) meta: Arc<ModelInfo>,
    /// Gravity {root} `[m/s²]`.
    pub(crate) gravity: Vector3<C>,
    /// Bodies; 0 is the world.
    pub(crate) bodies: Vec<Body<C>>,
    /// Clusters in the order of their bodies.
    pub(crate) clusters: Vec<Cluster<C>>,
    /// How each of them is closed.
    pub(crate) closures: Vec<Closure<C>>,
    /// The clusters that have something to close.
    pub(crate) closed_clusters: Vec<usize>,
    /// The cluster of each body; 0 (the world) has none.
    pub(crate) cluster_of: Vec<usize>,
    /// The cluster of each internal tree velocity.
    pub(crate) cluster_of_v: Vec<usize>,
    /// One frame for each link, in the order of the description.
    pub(crate) frames: Vec<Frame<C>>,
    /// Numbers in all G blocks together.
    pub(crate) n_g: usize,
    /// Which independent velocity supports which.
    pub(crate) sparsity: TreeSparsity,
    /// Bodies that have a child cluster, or support a body of their own cluster that has one.
    pub(crate) has_child_cluster: Vec<bool>,
    /// Largest inertia of each independent at the poses that were tried at load, in internal order
    /// (n_vy).
    pub(crate) inertia: Vec<f64>,
    /// By how many unit roundoffs accelerations were off at these poses, by recursion and by
    /// projection; zero where that was not tried.
    pub(crate) growth: [f64; 2],
    /// M_y was positive definite at none of these poses: the pivots of a recursion are rounding,
    /// and forward dynamics has no answer.
    pub(crate) is_massless: bool,
    /// Springs, dampers and rotors.
    pub(crate) terms: JointTerms<C>,
    pub(crate) order: Order,
    /// The closed pose at y = 0, quaternions at rest (n_q).
    pub(crate) zero: Vec<C>,
    /// The zero pose as it was described, which it is found from: all joints at rest but those of
    /// [`crate::description::Description::zero_pose`] (n_q).
    pub(crate) described_zero: Vec<f64>,
    /// Limits that exist, and the effort limit of each actuator.
    pub(crate) limits: Vec<Limit>,
    pub(crate) effort: Vec<f64>,
    /// Limits of each actuator (n_u).
    pub(crate) motors: Vec<Motor>,
}

impl<C> Model<C> {
    /// Names, orders, sizes, limits and closures; without the warnings of files.
    pub fn info(&self) -> &ModelInfo {
        &self.meta
    }
    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.meta.robot
    }
    /// A number that differs whenever any name, order or constant differs.
    pub fn fingerprint(&self) -> u64 {
        self.meta.fingerprint
    }
    /// Sizes of all coordinate vectors.
    pub fn sizes(&self) -> Sizes {
        self.meta.sizes
    }
    /// Names in the order of q̇ (n_v).
    pub fn tree_names(&self) -> &[String] {
        &self.meta.tree
    }
    /// Names in the order of q (n_q).
    pub fn tree_q_names(&self) -> &[String] {
        &self.meta.tree_q
    }
    /// Names in the order of ẏ (n_vy).
    pub fn independent_names(&self) -> &[String] {
        &self.meta.independent
    }
    /// Names in the order of y (n_qy).
    pub fn independent_q_names(&self) -> &[String] {
        &self.meta.independent_q
    }
    /// Names in the order of u (n_u).
    pub fn active_names(&self) -> &[String] {
        &self.meta.active
    }
    /// Names of the rows of K (n_c).
    pub fn loop_names(&self) -> &[String] {
        &self.meta.loops
    }
    /// Names of the links; an index into them names a frame in a plan.
    pub fn link_names(&self) -> &[String] {
        &self.meta.links
    }
    /// How each submechanism is closed, in the order of the description.
    pub fn closures(&self) -> &[ClosureInfo] {
        &self.meta.closures
    }
    /// The cluster of each actuator, in the order of u (n_u): actuators of one number act on one
    /// closed mechanism.
    pub fn actuator_clusters(&self) -> Vec<usize> {
        let mut clusters = vec![0; self.meta.active.len()];
        for (c, cluster) in self.clusters.iter().enumerate() {
            cluster.active.iter().for_each(|(u, _)| clusters[*u] = c);
        }
        clusters
    }
    /// Least and greatest force of an actuator at a speed; `None` without a limit.
    pub fn actuator_forces(&self, u: usize, speed: f64) -> Option<[f64; 2]> {
        let motor = self.motors.get(u).filter(|motor| motor.has_effort())?;
        Some(motor.forces(speed))
    }
    /// The cluster of each independent velocity, in the order of ẏ (n_vy).
    pub fn independent_clusters(&self) -> Vec<usize> {
        self.order.vy_v.iter().map(|v| self.cluster_of_v[*v]).collect()
    }
}

impl<C: Real> Model<C> {
    /// Converts the model to another scalar, every constant by `f`, without a new compilation.
    /// Allocates.
    pub fn convert<D: Real>(&self, f: impl Fn(C) -> D + Copy) -> Model<D> {
        self.map(f)
    }
}

impl<C> Model<C> {
    /// The bodies of a cluster.
    #[inline(always)]
    pub(crate) fn bodies_of(&self, cluster: &Cluster<C>) -> &[Body<C>] {
        &self.bodies[cluster.bodies()]
    }

    /// True where the joint of a body is independent.
    pub(crate) fn is_independent(&self, i: usize) -> bool {
        let cluster = &self.clusters[self.cluster_of[i]];
        cluster.independent.contains(&(self.bodies[i].v - cluster.v))
    }
}

constants! { Model:
    keep meta closed_clusters cluster_of cluster_of_v n_g sparsity has_child_cluster inertia growth
        is_massless order described_zero limits effort motors;
    list zero;
    map gravity terms;
    each bodies clusters closures frames;
}
