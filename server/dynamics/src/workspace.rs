use nalgebra::{Matrix3, Vector3};

use crate::algorithms::{Embedding, Force};
use crate::closure::{Rate, Scratch, constraint_jacobian, local_poses};
use crate::model::{Body, Cluster, Model};
use crate::plan::Plan;
use crate::scalar::{Real, Scalar};
use crate::spatial::{Pose, identity, zero};

/// All scratch of one model, allocated once. Nothing that a request leaves here is read by the next
/// one.
#[derive(Clone, Debug)]
pub struct Workspace<T> {
    // coordinates, in the order of the bodies
    /// Tree coordinates, velocities, accelerations.
    pub(crate) q: Vec<T>,
    pub(crate) qd: Vec<T>,
    pub(crate) qdd: Vec<T>,
    /// The closed pose that numerical closures start from.
    pub(crate) start: Vec<T>,
    /// The velocity there, and whether one was given.
    pub(crate) start_rate: Vec<T>,
    pub(crate) tangent: bool,
    /// The actuator coordinates that one cluster has to reach.
    pub(crate) goal_u: Vec<T>,
    /// The step of the independents towards them.
    pub(crate) step_y: Vec<T>,
    /// Independent accelerations.
    pub(crate) ydd: Vec<T>,

    // closures
    /// (cos q, sin q) of each revolute body's joint; 0 is the world.
    pub(crate) turn: Vec<(T, T)>,
    /// G blocks of all clusters, row-major, and g.
    pub(crate) G: Vec<T>,
    pub(crate) g: Vec<T>,
    pub(crate) scratch: Scratch<T>,

    // recursions
    pub(crate) motion: Vec<BodyState<T>>,
    pub(crate) composite: Vec<Composite<T>>,
    pub(crate) embedding: Embedding<T>,
    /// Pose of each body {root}.
    pub(crate) world: Vec<Pose<T>>,
    /// External wrench on each body, `[n; f]` at its origin {body}.
    pub(crate) wrench: Vec<(Vector3<T>, Vector3<T>)>,
    /// Forces on tree, independent and actuator coordinates.
    pub(crate) tau_q: Vec<T>,
    pub(crate) tau_y: Vec<T>,
    pub(crate) tau_u: Vec<T>,
    pub(crate) tau_rest: Vec<T>,
    /// Reduced mass matrix and its factor, packed by `Model::branches`; reduced bias force.
    pub(crate) M_y: Vec<T>,
    pub(crate) C_y: Vec<T>,
    pub(crate) factor: Vec<T>,
    /// Force columns of the cluster that is carried towards the root: `[n; f]` for each of its
    /// independents.
    pub(crate) columns: Vec<Force<T>>,
    /// The same inside one cluster, for each of its bodies (n × n_vy), and its block of the mass
    /// matrix (n_vy × n_vy).
    pub(crate) inside: Vec<Force<T>>,
    pub(crate) block: Vec<T>,
    /// Matrix, right-hand side and scaling of the tree under its constraints; empty where no plan
    /// asks for that method.
    pub(crate) kkt: Vec<T>,
    pub(crate) kkt_rhs: Vec<T>,
    pub(crate) kkt_scale: Vec<T>,
    /// Dense scratch for what is asked rarely: conditions, actuator maps, λ, Jacobians.
    pub(crate) dense: Vec<T>,
    pub(crate) dense_rhs: Vec<T>,
    pub(crate) dense_spare: Vec<T>,
    /// One frame's Jacobian (6 × n_vy), and the tree forces that only the loops can supply.
    pub(crate) jacobian: Vec<T>,
    pub(crate) loop_q: Vec<T>,
    needs: Needs,
}

/// The square matrices that a plan needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Needs {
    /// M_y and its factor.
    pub(crate) mass_matrix: bool,
    /// Dense scratch as wide as the robot, not only as its largest cluster.
    pub(crate) dense: bool,
    /// The tree under its constraints.
    pub(crate) kkt: bool,
}

impl Needs {
    /// What either needs.
    fn and(self, other: Needs) -> Needs {
        Needs {
            mass_matrix: self.mass_matrix | other.mass_matrix,
            dense: self.dense | other.dense,
            kkt: self.kkt | other.kkt,
        }
    }
}

/// What the recursions keep for one body, in its own axes at its origin.
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

/// What a child needs of its parent's motion.
pub(crate) struct Rates<T> {
    pub(crate) w: Vector3<T>,
    pub(crate) alpha: Vector3<T>,
    pub(crate) a: Vector3<T>,
}

impl<T: Real> BodyState<T> {
    #[inline(always)]
    pub(crate) fn rates(&self) -> Rates<T> {
        Rates { w: self.w, alpha: self.alpha, a: self.a }
    }
}

/// Inertia of a body with everything that it carries, as if rigid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Composite<T> {
    pub(crate) mass: T,
    pub(crate) h: Vector3<T>,
    /// xx xy xz yy yz zz about the body's origin.
    pub(crate) inertia: [T; 6],
}

impl<T: Scalar> Workspace<T> {
    /// Scratch for every plan on this model but those that force [`crate::Method::Kkt`]. Allocates;
    /// nothing after it does.
    pub fn new(model: &Model<T>) -> Workspace<T> {
        Workspace::sized(model, Needs { mass_matrix: true, dense: true, kkt: false })
    }

    /// Scratch for these plans on this model and for no others, without the square matrices that
    /// none of them needs: that of a robot with a thousand joints is then a thousand times as
    /// small. Allocates; nothing after it does.
    pub fn for_plans<'a>(
        model: &Model<T>,
        plans: impl IntoIterator<Item = &'a Plan>,
    ) -> Workspace<T> {
        Workspace::sized(
            model,
            plans.into_iter().fold(Needs::default(), |needs, plan| needs.and(plan.needs())),
        )
    }

    /// True where it is large enough for a plan that needs this.
    pub(crate) fn serves(&self, needs: Needs) -> bool {
        self.needs.and(needs) == self.needs
    }

    /// Scratch with these square matrices and no others.
    pub(crate) fn sized(model: &Model<T>, needs: Needs) -> Workspace<T> {
        let sizes = model.sizes();
        let bodies = model.bodies.len();
        let at_rest = BodyState {
            R: identity(),
            p: zero(),
            w: zero(),
            v: zero(),
            alpha: zero(),
            a: zero(),
            n: zero(),
            f: zero(),
        };
        let of = |n: usize| vec![T::ZERO; n];
        let clusters = || model.clusters.iter();
        let widest = clusters().map(|c| c.n_vy).max().unwrap_or(0);
        let largest = clusters().map(|c| c.n_q).max().unwrap_or(0);
        let rows = clusters().map(|c| c.rows.len()).max().unwrap_or(0);
        let widest_u = clusters().map(|c| c.active.len()).max().unwrap_or(0);
        let side =
            if needs.dense { sizes.n_vy.max(sizes.n_u) } else { widest_u }.max(largest).max(rows)
                + 6;
        let packed = if needs.mass_matrix { model.branches.len } else { 0 };
        let kkt =
            if needs.kkt { sizes.n_v + clusters().map(|c| c.used.len()).sum::<usize>() } else { 0 };
        Workspace {
            q: of(sizes.n_q),
            qd: of(sizes.n_v),
            qdd: of(sizes.n_v),
            start: of(sizes.n_q),
            start_rate: of(sizes.n_v),
            tangent: false,
            goal_u: of(sizes.n_u),
            step_y: of(sizes.n_vy),
            ydd: of(sizes.n_vy),
            turn: vec![(T::ONE, T::ZERO); bodies],
            G: free_jacobians(model),
            g: of(sizes.n_v),
            scratch: Scratch::new(largest, rows),
            motion: vec![at_rest; bodies],
            composite: vec![Composite { mass: T::ZERO, h: zero(), inertia: [T::ZERO; 6] }; bodies],
            embedding: Embedding::new(model),
            world: vec![Pose::identity(); bodies],
            wrench: vec![(zero(), zero()); bodies],
            tau_q: of(sizes.n_v),
            tau_y: of(sizes.n_vy),
            tau_u: of(sizes.n_u),
            tau_rest: of(sizes.n_vy),
            M_y: of(packed),
            C_y: of(sizes.n_vy),
            factor: of(packed),
            columns: vec![(zero(), zero()); widest],
            inside: vec![(zero(), zero()); clusters().map(|c| c.n * c.n_vy).max().unwrap_or(0)],
            block: of(widest * widest),
            kkt: of(kkt * kkt),
            kkt_rhs: of(kkt),
            kkt_scale: of(kkt),
            needs,
            dense: of(side * side),
            dense_rhs: of(side * side),
            dense_spare: of(side * side),
            jacobian: of(6 * sizes.n_vy),
            loop_q: of(sizes.n_v),
        }
    }
}

/// G blocks with the identity at every free joint, which no request changes.
fn free_jacobians<T: Scalar>(model: &Model<T>) -> Vec<T> {
    let mut G = vec![T::ZERO; model.n_g];
    for cluster in model.clusters.iter().filter(|c| c.is_serial()) {
        for k in 0..cluster.n_v {
            G[cluster.g + k * cluster.n_vy + k] = T::ONE;
        }
    }
    G
}

impl<T: Real> Scratch<T> {
    /// Poses and K of one cluster at a pose, outside any workspace. Allocates.
    pub(crate) fn at(
        cluster: &Cluster<T::Const>,
        bodies: &[Body<T::Const>],
        q: &[T],
    ) -> Scratch<T> {
        let mut scratch = Scratch::new(cluster.n_q, cluster.rows.len());
        local_poses(cluster, bodies, q, &mut vec![(T::ONE, T::ZERO); cluster.n], &mut scratch.pose);
        constraint_jacobian(cluster, &scratch.pose, &mut scratch.K);
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
            K: of(rows * n),
            phi: of(side),
            A: of(side * side),
            B: of(side * side),
            inverse: of(side * side),
            branch: of(n),
            step: of(side),
            last: of(n),
            goal: of(n),
        }
    }
}
