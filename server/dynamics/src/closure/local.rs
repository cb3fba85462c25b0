//! The numbers of one cluster while it is closed, and the scratch that all clusters share.

use nalgebra::Vector3;

use crate::closure::plane::PlaneLink;
use crate::closure::{MOST, constraint_jacobian, local_poses};
use crate::mechanism::{Body, Cluster};
use crate::scalar::Real;
use crate::spatial::{Pose, zero};

/// Operations that the iterations of a request may spend: of any, of one between those of others,
/// and of one that searches as long as it takes.
pub(crate) const BUDGET: u64 = 1_150_000;
pub(crate) const TURN: u64 = BUDGET / 16;
pub(crate) const UNBOUNDED: u64 = u64::MAX;

/// The level up to which a closure is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    /// q.
    Position,
    /// And G.
    Jacobian,
    /// And q̇.
    Velocity,
    /// And g.
    Acceleration,
}

/// The numbers of one cluster, by local coordinate (q), velocity (q̇, G, g) or body (cos_sin).
pub(crate) struct Local<'a, T> {
    /// The cluster and its bodies.
    pub(crate) cluster: &'a Cluster<T>,
    pub(crate) bodies: &'a [Body<T>],
    /// The closed pose from which a numerical closure continues (n_q).
    pub(crate) start: &'a [T],
    /// It is the zero pose, as the request gives no other: seeds may serve.
    pub(crate) from_zero: bool,
    /// One of many attempts: a failure needs no cause, and only a short path is followed.
    pub(crate) is_trial: bool,
    /// The tree velocity at that pose, if given (n_v).
    pub(crate) tangent: Option<&'a [T]>,
    /// Tree coordinates, independents set (n_q).
    pub(crate) q: &'a mut [T],
    /// Cosine and sine of each revolute coordinate (n).
    pub(crate) cos_sin: &'a mut [(T, T)],
    /// Tree velocities, independents set (n_v).
    pub(crate) qd: &'a mut [T],
    /// Loop Jacobian (n_v × n_vy, row-major).
    pub(crate) G: &'a mut [T],
    /// Bias (n_v).
    pub(crate) g: &'a mut [T],
    /// Scratch, shared by all clusters.
    pub(crate) scratch: &'a mut Scratch<T>,
}

impl<T: Real> Local<'_, T> {
    /// Poses of all local bodies, with cosines and sines.
    pub(in crate::closure) fn pose(&mut self) {
        local_poses(self.cluster, self.bodies, self.q, self.cos_sin, &mut self.scratch.pose);
    }
}

/// Scratch for the largest cluster.
#[derive(Clone, Debug)]
pub(crate) struct Scratch<T> {
    /// Pose of each local body in the cluster's parent body; entry 0 is that body (n + 1).
    pub(crate) pose: Vec<Pose<T>>,
    /// Pose at zero of the body's own joint, of bodies whose parent stands still within a block
    /// (n).
    pub(crate) base: Vec<Pose<T>>,
    /// Velocity and acceleration of each local body at q̈ = 0, cluster axes: ω, v, α, a of the
    /// origin (n + 1).
    pub(crate) rate: Vec<Rate<T>>,
    /// Of each local joint its twist for a unit of its rate (n); of each local body that for each
    /// independent and for q̈ = g; entry 0 stands still (n + 1).
    pub(crate) screw: Vec<Twist<T>>,
    pub(crate) twist: Vec<[Twist<T>; MOST + 1]>,
    /// Links of a plane mechanism; entry 0 is the cluster's parent body (n + 1).
    pub(crate) plane: Vec<PlaneLink<T>>,
    /// Constraint Jacobian (n_c × n_v).
    pub(crate) K: Vec<T>,
    /// Residuals and right-hand sides.
    pub(crate) phi: Vec<T>,
    /// Square and right-hand side matrices of the blocks, and their inverses one after the other.
    pub(crate) A: Vec<T>,
    pub(crate) B: Vec<T>,
    pub(crate) inverse: Vec<T>,
    /// A matrix that may have to be inverted once more.
    pub(crate) spare: Vec<T>,
    /// Which choice among redundant rows is in use.
    pub(crate) choice: usize,
    /// Determinant of each block at the pose that Newton's method leaves.
    pub(crate) branch: Vec<T>,
    /// Gain of each block, see [`crate::closure::Outcome::gain`].
    pub(crate) gain: Vec<T>,
    /// Newton's last step.
    pub(crate) step: Vec<T>,
    /// Of a block by itself: coordinates, velocities, which are zero, cosines and sines (n each).
    pub(crate) of_part: [Vec<T>; 2],
    pub(crate) turns_of_part: Vec<(T, T)>,
    /// The last closed pose on a path, and the goal (n_q each).
    pub(crate) last: Vec<T>,
    pub(crate) goal: Vec<T>,
    /// Operations that the request may still spend on iterations.
    pub(crate) left: u64,
}

/// A turn, and the velocity that goes with it of a point in the origin {cluster's parent body}.
pub(crate) type Twist<T> = [Vector3<T>; 2];

/// Rates of a local body, cluster axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate<T> {
    pub(crate) w: Vector3<T>,
    pub(crate) v: Vector3<T>,
    pub(crate) alpha: Vector3<T>,
    pub(crate) a: Vector3<T>,
}

impl<T: Real> Scratch<T> {
    /// Poses and K of one cluster at a pose, outside any workspace. Allocates.
    pub(crate) fn at(cluster: &Cluster<T>, bodies: &[Body<T>], q: &[T]) -> Scratch<T> {
        let mut scratch = Scratch::new(cluster.n_q, cluster.rows.len());
        local_poses(cluster, bodies, q, &mut vec![(T::ONE, T::ZERO); cluster.n], &mut scratch.pose);
        constraint_jacobian(cluster, &scratch.pose, q, &mut scratch.K);
        scratch
    }

    /// For clusters of up to n joints and this many rows.
    pub(crate) fn new(n: usize, rows: usize) -> Scratch<T> {
        let of = |n: usize| vec![T::ZERO; n];
        let side = n.max(rows);
        Scratch {
            pose: vec![Pose::identity(); n + 1],
            base: vec![Pose::identity(); n],
            rate: vec![Rate { w: zero(), v: zero(), alpha: zero(), a: zero() }; n + 1],
            screw: vec![[zero(); 2]; n],
            twist: vec![[[zero(); 2]; MOST + 1]; n + 1],
            plane: vec![PlaneLink::at_rest(); n + 1],
            K: of(rows * n),
            phi: of(side),
            A: of(side * side),
            B: of(side * side),
            inverse: of(side * side),
            spare: of(side * side),
            choice: 0,
            branch: of(n),
            gain: of(n),
            step: of(side),
            of_part: [of(n), of(n)],
            turns_of_part: vec![(T::ONE, T::ZERO); n],
            last: of(n),
            goal: of(n),
            left: UNBOUNDED,
        }
    }

    /// Takes operations from those that are left; false where none is left.
    #[inline(always)]
    pub(crate) fn spend(&mut self, operations: u64) -> bool {
        self.left = self.left.saturating_sub(operations);
        self.left > 0
    }
}
