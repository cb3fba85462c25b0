//! The compiled robot: flat arrays, immutable, shared by every plan.
//!
//! Bodies are numbered from 1 in depth-first order over clusters; body 0 is the world. Every joint
//! moves along or about the z axis of its body: the frames of the bodies are turned at load so that
//! it does, and a link's own frame survives as a [`Frame`].

mod closures_at_zero;
mod tolerance;

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use sarrus_proto::{ClosureInfo, ModelInfo, Sizes};

pub use closures_at_zero::ClosureAtZero;
pub(crate) use closures_at_zero::judge;

use crate::closure::{Closure, Cut};
use crate::diagnostic::Diagnostic;
use crate::linalg::Branches;
use crate::mechanism::{Freedom, JointTerms, Motion};
use crate::scalar::{Dd, Real};
use crate::spatial::Pose;

/// A robot ready to run, with constants of type `C`.
#[derive(Clone, Debug)]
pub struct Model<C = f64> {
    /// What both precisions share.
    pub(crate) meta: Arc<ModelInfo>,
    /// Gravity {root} `[m/s²]`.
    pub(crate) gravity: Vector3<C>,
    /// Bodies; 0 is the world.
    pub(crate) bodies: Vec<Body<C>>,
    /// Clusters in the order of their bodies.
    pub(crate) clusters: Vec<Cluster<C>>,
    /// The clusters that have something to close, and the free revolute joints as (body, tree
    /// coordinate).
    pub(crate) tied: Vec<usize>,
    pub(crate) free: Vec<(usize, usize)>,
    /// The cluster of each body; 0 (the world) has none.
    pub(crate) cluster_of: Vec<usize>,
    /// The cluster of each internal tree velocity.
    pub(crate) cluster_of_v: Vec<usize>,
    /// One frame for each link, in the order of the description.
    pub(crate) frames: Vec<Frame<C>>,
    /// Numbers in all G blocks together.
    pub(crate) n_g: usize,
    /// Which independent velocity carries which.
    pub(crate) branches: Branches,
    /// Bodies that carry another cluster, or a body of their own that does.
    pub(crate) carries: Vec<bool>,
    /// Largest inertia of each independent at the poses that were tried at load, in internal order
    /// (n_vy).
    pub(crate) inertia: Vec<f64>,
    /// What acts in joints besides their actuators.
    pub(crate) terms: JointTerms<C>,
    pub(crate) order: Order,
    /// The closed pose at y = 0, quaternions at rest (n_q).
    pub(crate) zero: Vec<C>,
    /// Limits that exist, and the effort limit of each actuator.
    pub(crate) limits: Vec<Limit>,
    pub(crate) effort: Vec<f64>,
}

/// Limits of one joint, by internal coordinate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    pub(crate) q: usize,
    pub(crate) v: usize,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) velocity: f64,
}

/// From the order that users see to the order of the bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct Order {
    /// Internal index of each tree coordinate and tree velocity.
    pub(crate) q: Vec<usize>,
    pub(crate) v: Vec<usize>,
    /// For each independent coordinate its tree coordinate; for each independent velocity its tree
    /// velocity and its internal number.
    pub(crate) qy_q: Vec<usize>,
    pub(crate) vy_v: Vec<usize>,
    pub(crate) vy: Vec<usize>,
    /// For each actuator its tree coordinate and velocity.
    pub(crate) u_q: Vec<usize>,
    pub(crate) u_v: Vec<usize>,
    /// Back again: place of each internal tree and independent velocity in the external order; and
    /// the identity.
    pub(crate) v_external: Vec<usize>,
    pub(crate) vy_external: Vec<usize>,
    pub(crate) vy_internal: Vec<usize>,
    /// The tied clusters that have a branch, in the order of their submechanisms.
    pub(crate) branches: Vec<usize>,
}

/// A moving body and the joint that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Body<C> {
    pub(crate) parent: usize,
    pub(crate) motion: Motion,
    /// First internal tree coordinate and velocity.
    pub(crate) q: usize,
    pub(crate) v: usize,
    /// Pose of the body at zero {parent body}.
    pub(crate) E: Matrix3<C>,
    pub(crate) r: Vector3<C>,
    /// Mass, first moment m c, rotational inertia xx xy xz yy yz zz about the body's origin {body}.
    pub(crate) mass: C,
    pub(crate) h: Vector3<C>,
    pub(crate) inertia: [C; 6],
}

/// A link's frame on the body that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Frame<C> {
    pub(crate) body: usize,
    pub(crate) x_body_frame: Pose<C>,
}

/// Tree joints tied by loops or couplings; they hang from one parent body.
#[derive(Clone, Debug)]
pub(crate) struct Cluster<C> {
    /// The body that the cluster hangs from.
    pub(crate) parent: usize,
    /// First body and number of bodies.
    pub(crate) body: usize,
    pub(crate) n: usize,
    /// First internal tree velocity and coordinate; n_v of them.
    pub(crate) v: usize,
    pub(crate) q: usize,
    pub(crate) n_v: usize,
    pub(crate) n_q: usize,
    /// What each local velocity belongs to (n_v).
    pub(crate) freedoms: Vec<Freedom>,
    /// First internal independent velocity; n_vy of them.
    pub(crate) vy: usize,
    pub(crate) n_vy: usize,
    /// First number of the cluster's G block (n_v × n_vy, row-major).
    pub(crate) g: usize,
    /// Local velocities that are independent, in the order of y, and the others; and the same of
    /// the local coordinates.
    pub(crate) independent: Vec<usize>,
    pub(crate) dependent: Vec<usize>,
    pub(crate) independent_q: Vec<usize>,
    pub(crate) dependent_q: Vec<usize>,
    /// Idle velocities, which stand still; they are in neither list.
    pub(crate) locked: Vec<usize>,
    /// Local parent of each local body, counted from 1; 0 is the cluster's parent body.
    pub(crate) local_parent: Vec<usize>,
    /// Actuators: (index in u, local velocity).
    pub(crate) active: Vec<(usize, usize)>,
    pub(crate) cuts: Vec<Cut<C>>,
    /// External index of each local constraint row; the rows that, with the dependents, make the
    /// square system.
    pub(crate) rows: Vec<usize>,
    pub(crate) used: Vec<usize>,
    pub(crate) closure: Closure<C>,
    /// Characteristic length `[m]`.
    pub(crate) length: f64,
}

/// The result of [`Model::compile`]: the robot in both precisions.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// The model for work.
    pub model: Model<f64>,
    /// The same model with constants to 32 digits, for truth.
    pub exact: Model<Dd>,
    /// What is remarkable but no error.
    pub warnings: Vec<Diagnostic>,
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
    /// Names of what has a branch: the submechanism of each tied cluster that is not a pure
    /// coupling (n_branches).
    pub fn branch_names(&self) -> &[String] {
        &self.meta.branches
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
}

impl<C: Real> Model<C> {
    /// The same model over another scalar, every constant converted by `f`; a new scalar needs no
    /// new compilation. Allocates.
    pub fn convert<D: Real>(&self, f: impl Fn(C) -> D + Copy) -> Model<D> {
        self.map(f)
    }
}

impl<C> Model<C> {
    /// True where the joint of a body is independent.
    pub(crate) fn is_independent(&self, i: usize) -> bool {
        let cluster = &self.clusters[self.cluster_of[i]];
        cluster.independent.contains(&(self.bodies[i].v - cluster.v))
    }
}

impl<C: Copy> Model<C> {
    /// The same model with every constant converted.
    pub(crate) fn map<D>(&self, f: impl Fn(C) -> D + Copy) -> Model<D>
    where
        C: nalgebra::Scalar,
        D: nalgebra::Scalar,
    {
        Model {
            meta: self.meta.clone(),
            gravity: self.gravity.map(f),
            bodies: self.bodies.iter().map(|body| body.map(f)).collect(),
            clusters: self.clusters.iter().map(|cluster| cluster.map(f)).collect(),
            tied: self.tied.clone(),
            free: self.free.clone(),
            cluster_of: self.cluster_of.clone(),
            cluster_of_v: self.cluster_of_v.clone(),
            frames: self
                .frames
                .iter()
                .map(|frame| Frame {
                    body: frame.body,
                    x_body_frame: map_pose(&frame.x_body_frame, f),
                })
                .collect(),
            n_g: self.n_g,
            branches: self.branches.clone(),
            carries: self.carries.clone(),
            inertia: self.inertia.clone(),
            terms: self.terms.map(f),
            order: self.order.clone(),
            zero: self.zero.iter().map(|x| f(*x)).collect(),
            limits: self.limits.clone(),
            effort: self.effort.clone(),
        }
    }
}

/// A pose with every number converted.
pub(crate) fn map_pose<C: nalgebra::Scalar + Copy, D: nalgebra::Scalar>(
    pose: &Pose<C>,
    f: impl Fn(C) -> D + Copy,
) -> Pose<D> {
    Pose { R: pose.R.map(f), p: pose.p.map(f) }
}

impl<C: nalgebra::Scalar + Copy> Body<C> {
    fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Body<D> {
        Body {
            parent: self.parent,
            motion: self.motion,
            q: self.q,
            v: self.v,
            E: self.E.map(f),
            r: self.r.map(f),
            mass: f(self.mass),
            h: self.h.map(f),
            inertia: self.inertia.map(f),
        }
    }
}

impl<C: nalgebra::Scalar + Copy> Cluster<C> {
    fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Cluster<D> {
        Cluster {
            parent: self.parent,
            body: self.body,
            n: self.n,
            v: self.v,
            q: self.q,
            n_v: self.n_v,
            n_q: self.n_q,
            freedoms: self.freedoms.clone(),
            vy: self.vy,
            n_vy: self.n_vy,
            g: self.g,
            independent: self.independent.clone(),
            dependent: self.dependent.clone(),
            locked: self.locked.clone(),
            independent_q: self.independent_q.clone(),
            dependent_q: self.dependent_q.clone(),
            local_parent: self.local_parent.clone(),
            active: self.active.clone(),
            cuts: self.cuts.iter().map(|cut| cut.map(f)).collect(),
            rows: self.rows.clone(),
            used: self.used.clone(),
            closure: self.closure.map(f),
            length: self.length,
        }
    }
}

impl<C> Cluster<C> {
    /// True when the cluster is one joint that nothing ties.
    pub(crate) fn is_serial(&self) -> bool {
        matches!(self.closure, Closure::Serial)
    }
}
