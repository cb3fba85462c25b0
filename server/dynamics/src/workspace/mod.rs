//! All numbers of one request while it is answered: the data dictionary, stage by stage. Lengths in
//! metres, angles in radians, forces in newtons, moments in newton metres; coordinates and
//! velocities in the order of the bodies. Each stage or field names the file that writes it.

mod body;
mod derivatives;
mod motors;
mod probe;
mod search;

use nalgebra::Vector3;
use sarrus_proto::MAX_FRAMES;

pub(crate) use body::{Articulated, BodyState, Composite, Embedding, Force};
pub(crate) use derivatives::{Column, Derivatives, Moving, Seen, Supported};
pub(crate) use motors::{MOST_SEGMENTS, MotorScratch};
use probe::longest_input;
pub(crate) use probe::{Again, Probe};
pub(crate) use search::{Search, TASK_ROWS};

use crate::closure::{
    self, BUDGET, Closure, Level, Local, Numerical, Outcome, Scratch, TURN, UNBOUNDED,
};
use crate::mechanism::{Body, Cluster};
use crate::model::Model;
use crate::scalar::{Real, Symmetric, Triple};
use crate::spatial::{Pose, zero};

/// The part of the budget that a request may spend which starts from its answer: its scalar costs
/// as much more.
const RESUMED: u64 = 32;

/// All scratch of one model, allocated once. Nothing that a request leaves here is read by the next
/// one.
#[derive(Clone, Debug)]
pub struct Workspace<T: Real> {
    // state: written by `plan/state.rs`
    /// Tree coordinates `[rad, m]` (n_q), velocities and accelerations (n_v).
    pub(crate) q: Vec<T>,
    pub(crate) qd: Vec<T>,
    pub(crate) qdd: Vec<T>,
    /// The closed pose that numerical closures start from (n_q), and whether it is the answer of
    /// this request in another scalar (`plan/diagnostics/digits.rs`).
    pub(crate) start: Vec<T>,
    pub(crate) resumes: bool,
    /// The velocity there (n_v), and whether it was given.
    pub(crate) start_rate: Vec<T>,
    pub(crate) tangent: bool,
    /// The actuator coordinates that one cluster has to reach (n_u).
    pub(crate) goal_u: Vec<T>,
    /// The step of the independents towards them (n_vy).
    pub(crate) step_y: Vec<T>,
    /// Independent accelerations (n_vy): right-hand side, then solution of M_y ÿ = b.
    pub(crate) ydd: Vec<T>,

    // closures: written by `closure/`
    /// (cos q, sin q) of each revolute body's joint (bodies); 0 is the world. Those of free joints
    /// by `plan/run.rs`.
    pub(crate) cos_sin: Vec<(T, T)>,
    /// G blocks of all clusters, row-major, read by [`Cluster::G`]; g (n_v).
    pub(crate) G: Vec<T>,
    pub(crate) g: Vec<T>,
    /// Scratch of one cluster at a time.
    pub(crate) scratch: Scratch<T>,

    // recursions: written by `algorithms/`
    /// Motion and force of each body (bodies) {body}.
    pub(crate) motion: Vec<BodyState<T>>,
    /// Composite inertia of each body (bodies) {body}.
    pub(crate) composite: Vec<Composite<T>>,
    /// Articulated inertias and factors of the recursion over clusters.
    pub(crate) embedding: Embedding<T>,
    /// Pose of each body (bodies) {root}.
    pub(crate) world: Vec<Pose<T>>,
    /// External wrench on each body, `[n; f]` at its origin (bodies) {body}.
    pub(crate) wrench: Vec<(Vector3<T>, Vector3<T>)>,
    /// Force columns of the cluster in hand on their way to the root: `[n; f]` for each of its
    /// independents (largest n_vy of a cluster) {body that they have reached}.
    pub(crate) columns: Vec<Force<T>>,
    /// Columns inside one cluster, for each of its bodies (n × n_vy) {body}, and its block of the
    /// mass matrix (n_vy × n_vy).
    pub(crate) inside: Vec<Force<T>>,
    pub(crate) block: Vec<T>,
    /// Diagonal of a cluster's block for joints that move alone (n_vy); zero for free joints.
    pub(crate) uncoupled_diagonal: Vec<T>,
    /// Reduced mass matrix and its factor, packed by `Model::sparsity`; reduced bias force (n_vy).
    pub(crate) M_y: Vec<T>,
    pub(crate) C_y: Vec<T>,
    /// C_y − Gᵀ Σ Jᵀ w, where a field reads it (n_vy).
    pub(crate) C_net: Vec<T>,
    pub(crate) factor: Vec<T>,

    // forces: written by `plan/forces.rs` and `plan/actuation.rs`
    /// Forces on tree (n_v), independent (n_vy) and actuator coordinates (n_u), and the part
    /// of τ_y that no actuator can give (n_vy) `[N m, N]`.
    pub(crate) tau_q: Vec<T>,
    pub(crate) tau_y: Vec<T>,
    pub(crate) tau_u: Vec<T>,
    pub(crate) tau_rest: Vec<T>,
    /// Σ |terms| of each independent force (n_vy).
    pub(crate) tau_terms: Vec<T>,
    /// The tree forces that only the loops can supply (n_v).
    pub(crate) loop_q: Vec<T>,
    /// Matrix (n²), right-hand side and scaling (n) of the tree under its constraints, with n of
    /// n_v and the used rows; empty where no plan asks for that method. By `plan/kkt.rs`.
    pub(crate) kkt: Vec<T>,
    pub(crate) kkt_rhs: Vec<T>,
    pub(crate) kkt_scale: Vec<T>,

    /// Of the fields of actuators, by `plan/motors.rs`.
    pub(crate) motors: Option<Box<MotorScratch<T>>>,

    // rare outputs: conditions, actuator maps, λ, Jacobians
    /// Square dense scratch.
    pub(crate) dense: Vec<T>,
    pub(crate) dense_rhs: Vec<T>,
    pub(crate) dense_spare: Vec<T>,
    /// Forces of the actuators by those on the tree, a row of each tree velocity (n_v × actuators
    /// of a cluster), by `plan/regressor.rs`.
    pub(crate) actuation: Vec<T>,
    /// One frame's Jacobian (6 × n_vy) {root axes at the frame}, by `plan/output.rs`.
    pub(crate) jacobian: Vec<T>,
    /// Matrices of the frames together, by `plan/task/space.rs`.
    pub(crate) task: Vec<T>,
    /// Of searches for positions, by `plan/task/`.
    pub(crate) search: Option<Box<Search>>,
    /// Given numbers and precomputed closure results, by `plan/closed.rs`.
    pub(crate) closed: Vec<T>,
    /// Scratch to compute doubtful answers again, for scalars that support it.
    pub(crate) probe: Option<Box<Probe>>,
    /// Where a plan needs them.
    pub(crate) derivatives: Option<Box<Derivatives<T>>>,
    /// Requests have a small part of their budget: those of others wait meanwhile.
    in_turns: bool,
    needs: Needs,
    /// The model that it was made for.
    fingerprint: u64,
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
    /// Derivatives.
    pub(crate) derivatives: bool,
    /// Fields of actuators.
    pub(crate) motors: bool,
    /// Frames whose inertia is asked for.
    pub(crate) frames: usize,
    /// Positions are searched for.
    pub(crate) search: bool,
}

impl Needs {
    /// Union of two needs.
    pub(crate) fn and(self, other: Needs) -> Needs {
        Needs {
            mass_matrix: self.mass_matrix | other.mass_matrix,
            dense: self.dense | other.dense,
            kkt: self.kkt | other.kkt,
            derivatives: self.derivatives | other.derivatives,
            motors: self.motors | other.motors,
            frames: self.frames.max(other.frames),
            search: self.search | other.search,
        }
    }
}

impl<T: Real> Workspace<T> {
    /// Scratch for every plan on this model but those that force [`crate::Method::Kkt`]. Allocates;
    /// nothing after it does.
    pub fn new(model: &Model<T>) -> Workspace<T> {
        // packets of states have none of the rare ones
        let frames = if T::STRAIGHT { 0 } else { MAX_FRAMES };
        let needs = Needs {
            mass_matrix: true,
            dense: true,
            kkt: false,
            derivatives: true,
            motors: true,
            frames,
            search: true,
        };
        let probe = Probe::for_any_plan(model, needs);
        let most = longest_input(model) + most_closed(model);
        Workspace::sized(model, needs).with_probe(probe).with_room_for_closed(most)
    }

    /// The workspace's numbers of one cluster.
    #[inline(always)]
    pub(crate) fn local<'a>(
        &'a mut self,
        cluster: &'a Cluster<T>,
        bodies: &'a [Body<T>],
    ) -> Local<'a, T> {
        let q = cluster.coordinates();
        let v = cluster.velocities();
        Local {
            cluster,
            bodies,
            start: &self.start[q.clone()],
            from_zero: false,
            is_trial: false,
            tangent: self.tangent.then_some(&self.start_rate[v.clone()]),
            q: &mut self.q[q],
            cos_sin: &mut self.cos_sin[cluster.bodies()],
            qd: &mut self.qd[v.clone()],
            G: &mut self.G[cluster.block()],
            g: &mut self.g[v],
            scratch: &mut self.scratch,
        }
    }

    /// Poses of a cluster's bodies at q, into the scratch of closures.
    pub(crate) fn local_poses(&mut self, cluster: &Cluster<T>, bodies: &[Body<T>]) {
        let q = &self.q[cluster.coordinates()];
        let cos_sin = &mut self.cos_sin[cluster.bodies()];
        closure::local_poses(cluster, bodies, q, cos_sin, &mut self.scratch.pose);
    }

    /// Poses and K of a cluster at q, into the scratch of closures.
    pub(crate) fn constraint_jacobian(&mut self, cluster: &Cluster<T>, bodies: &[Body<T>]) {
        self.local_poses(cluster, bodies);
        let q = &self.q[cluster.coordinates()];
        closure::constraint_jacobian(cluster, &self.scratch.pose, q, &mut self.scratch.K);
    }

    /// Closes cluster c of a model down to a level, as [`crate::closure::Closure::close`] does.
    pub(crate) fn close(&mut self, model: &Model<T>, c: usize, level: Level) -> Outcome {
        self.close_from(model, c, level, false, false)
    }

    /// As `close`, for one of many attempts.
    pub(crate) fn try_to_close(&mut self, model: &Model<T>, c: usize, level: Level) -> Outcome {
        self.close_from(model, c, level, false, true)
    }

    /// As `close`; `zero` is true if the start is the model's zero pose for lack of another.
    pub(crate) fn close_from(
        &mut self,
        model: &Model<T>,
        c: usize,
        level: Level,
        zero: bool,
        is_trial: bool,
    ) -> Outcome {
        let cluster = &model.clusters[c];
        if let Closure::Numerical(numerical) = &model.closures[c] {
            self.bring_start(cluster, numerical);
        }
        let mut local =
            Local { from_zero: zero, is_trial, ..self.local(cluster, model.bodies_of(cluster)) };
        let outcome = model.closures[c].close(&mut local, level);
        if !zero || cluster.windings.leave(local.q) {
            cluster.windings.count(local.start, local.q);
        }
        outcome
    }

    /// Answers requests in turns from now on: each has a small part of its budget, and one that
    /// needs more is [`crate::Plan::is_cut_short`].
    pub fn answer_in_turns(&mut self) {
        self.in_turns = true;
    }

    /// True after [`Workspace::answer_in_turns`].
    pub(crate) fn is_in_turns(&self) -> bool {
        self.in_turns
    }

    /// True if the last request took its whole turn.
    pub(crate) fn is_cut(&self) -> bool {
        self.in_turns && self.scratch.left == 0
    }

    /// Operations that the iterations of a request may spend; of one that starts from its answer in
    /// another scalar as many as it takes there.
    pub(crate) fn budget(&self, searches: bool) -> u64 {
        match (self.resumes, self.in_turns, searches) {
            (true, ..) => BUDGET / RESUMED,
            (_, true, _) => TURN,
            (_, _, true) => UNBOUNDED,
            (_, _, false) => BUDGET,
        }
    }

    /// Brings the start of a cluster within half a turn of its independents.
    #[inline]
    pub(crate) fn bring_start(&mut self, cluster: &Cluster<T>, numerical: &Numerical<T>) {
        let at = cluster.coordinates();
        let start = &mut self.start[at.clone()];
        let q = &self.q[at];
        numerical.turns.iter().for_each(|turn| turn.bring(start, q));
    }

    /// True where it was made for this model.
    pub(crate) fn belongs_to<C>(&self, model: &Model<C>) -> bool {
        self.fingerprint == model.fingerprint()
    }

    /// True where it is large enough for a plan that needs this.
    pub(crate) fn serves(&self, needs: Needs) -> bool {
        self.needs.and(needs) == self.needs
    }

    /// Adds scratch to compute doubtful answers again.
    pub(crate) fn with_probe(self, probe: Option<Box<Probe>>) -> Workspace<T> {
        Workspace { probe, ..self }
    }

    /// Adds room for this many given numbers and closure results.
    pub(crate) fn with_room_for_closed(self, most: usize) -> Workspace<T> {
        Workspace { closed: vec![T::ZERO; most], ..self }
    }

    /// Scratch with these square matrices and no others; without a probe.
    pub(crate) fn sized(model: &Model<T>, needs: Needs) -> Workspace<T> {
        // positions are searched for in doubles alone
        let needs = Needs { search: needs.search && T::PROBED, ..needs };
        let sizes = model.sizes();
        let bodies = model.bodies.len();
        let none = T::Triple::zero();
        let massless = Composite { mass: T::ZERO, h: none, inertia: T::Symmetric::ZERO };
        let of = |n: usize| vec![T::ZERO; n];
        let clusters = || model.clusters.iter();
        let widest = clusters().map(|c| c.n_vy).max().unwrap_or(0);
        let largest = clusters().map(|c| c.n_q).max().unwrap_or(0);
        let rows = clusters().map(|c| c.rows.len()).max().unwrap_or(0);
        let widest_u = clusters().map(|c| c.active.len()).max().unwrap_or(0);
        let uneven = clusters().filter(|c| c.active.len() != c.n_vy).map(|c| c.active.len()).sum();
        let side =
            if needs.dense { sizes.n_vy.max(sizes.n_u) } else { widest_u }.max(largest).max(rows)
                + 6;
        let packed = if needs.mass_matrix { model.sparsity.len } else { 0 };
        let kkt =
            if needs.kkt { sizes.n_v + clusters().map(|c| c.used.len()).sum::<usize>() } else { 0 };
        Workspace {
            q: of(sizes.n_q),
            qd: of(sizes.n_v),
            qdd: of(sizes.n_v),
            start: of(sizes.n_q),
            resumes: false,
            start_rate: of(sizes.n_v),
            tangent: false,
            goal_u: of(sizes.n_u),
            step_y: of(sizes.n_vy),
            ydd: of(sizes.n_vy),
            cos_sin: vec![(T::ONE, T::ZERO); bodies],
            G: free_jacobians(model),
            g: of(sizes.n_v),
            scratch: Scratch::new(largest, rows),
            motion: vec![BodyState::at_rest(); bodies],
            composite: vec![massless; bodies],
            embedding: Embedding::new(model),
            world: vec![Pose::identity(); bodies],
            wrench: vec![(zero(), zero()); bodies],
            tau_q: of(sizes.n_v),
            tau_y: of(sizes.n_vy),
            tau_u: of(sizes.n_u),
            tau_rest: of(sizes.n_vy),
            tau_terms: of(sizes.n_vy),
            M_y: of(packed),
            C_y: of(sizes.n_vy),
            C_net: of(sizes.n_vy),
            motors: needs.motors.then(|| Box::new(MotorScratch::new(model))),
            factor: of(packed),
            columns: vec![(none, none); widest],
            inside: vec![(none, none); clusters().map(|c| c.n * c.n_vy).max().unwrap_or(0)],
            block: of(widest * widest),
            uncoupled_diagonal: of(sizes.n_vy),
            kkt: of(kkt * kkt),
            kkt_rhs: of(kkt),
            kkt_scale: of(kkt),
            task: of(task_numbers(needs.frames, sizes.n_vy)),
            search: needs.search.then(|| Box::new(Search::new(&sizes, widest, uneven))),
            closed: Vec::new(),
            probe: None,
            derivatives: needs.derivatives.then(|| Box::new(Derivatives::new(model, massless))),
            in_turns: false,
            needs,
            fingerprint: model.fingerprint(),
            dense: of(side * side),
            dense_rhs: of(side * side),
            dense_spare: of(side * side),
            actuation: of(sizes.n_v * widest_u),
            jacobian: of(6 * sizes.n_vy),
            loop_q: of(sizes.n_v),
        }
    }
}

/// Numbers of the matrices of so many frames together, over n independents.
pub(crate) fn task_numbers(frames: usize, n: usize) -> usize {
    let rows = 6 * frames;
    2 * rows * n + 2 * rows * rows + 2 * rows
}

/// More numbers than any plan needs of closures by Newton's method; none where there are none.
pub(crate) fn most_closed<T: Real>(model: &Model<T>) -> usize {
    let sizes = model.sizes();
    if model.closures.iter().all(Closure::is_closed_form) {
        return 0;
    }
    1 + 2 * sizes.n_q + 2 * model.bodies.len() + model.n_g + 2 * sizes.n_v
}

/// G blocks with the identity at every free joint, which no request changes.
fn free_jacobians<T: Real>(model: &Model<T>) -> Vec<T> {
    let mut G = vec![T::ZERO; model.n_g];
    for cluster in model.clusters.iter().filter(|c| c.is_serial()) {
        for k in 0..cluster.n_v {
            G[cluster.g_offset + k * cluster.n_vy + k] = T::ONE;
        }
    }
    G
}
