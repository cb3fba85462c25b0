//! Dependencies of the outputs of a query.
//!
//! A row of a joint depends on its cluster and, if loops close it, on their closure. A frame
//! depends on the joints on its path, and on no closure if these are given. Forces of a joint
//! depend on all descendants of its cluster and on the motion of its ancestors; accelerations from
//! forces on every cluster with the same root cluster. Figures of the whole robot (residual,
//! conditions, λ, K) depend on all of it, and so does a query that asks for neither rows nor
//! frames.

use sarrus_proto::{Field, OF_ACTUATOR_FORCES, Query, Request, Rows};

use crate::model::{Limit, Method, Model, Roots, Scope};
use crate::plan::Steps;
use crate::plan::{Space, posed_links, supports};

/// Fields of all loops, or of all independents.
pub(super) const OF_THE_ROBOT: [Field; 13] = [
    Field::K,
    Field::KBias,
    Field::Lambda,
    Field::LambdaDeterminate,
    Field::Residual,
    Field::CondKd,
    Field::CondGu,
    Field::SigmaMin,
    Field::Branch,
    Field::GoodIndependents,
    Field::Uncontrolled,
    Field::NearestY,
    Field::CondMy,
];
/// Fields of all links.
pub(super) const OF_THE_LINKS: [Field; 6] = [
    Field::Com,
    Field::ComJacobian,
    Field::ComBias,
    Field::Momentum,
    Field::Centroidal,
    Field::Energy,
];
/// Fields of the observer, which reads Ġ.
pub(super) const OBSERVED: [Field; 2] = [Field::Observer, Field::TauExternal];
/// Forces by parameters.
pub(super) const REGRESSORS: [Field; 2] = [Field::RegressorY, Field::RegressorU];
/// Derivatives of the actuators' forces.
pub(super) const OF_ACTUATORS: [Field; 4] =
    [Field::DtauUDy, Field::DtauUDyd, Field::DtauUnactuatedDy, Field::DtauUnactuatedDyd];
/// Fields that read τ_u.
pub(super) const READ_TAU_U: [Field; 6] = [
    Field::TauU,
    Field::TauUnactuated,
    Field::Lambda,
    Field::RegressorU,
    Field::GainsY,
    Field::ClipNearest,
];
/// Fields of all frames together, and of the whole mass matrix.
pub(super) const OF_THE_TASKS: [Field; 4] =
    [Field::TaskInertia, Field::TaskBias, Field::TaskGravity, Field::TaskRank];
/// Forces, and the quantities in their rows.
const FORCES: [Field; 12] = [
    Field::TauQ,
    Field::TauY,
    Field::TauU,
    Field::TauUnactuated,
    Field::CY,
    Field::MY,
    Field::GainsY,
    Field::Margin,
    Field::Clip,
    Field::ClipNearest,
    Field::Binding,
    Field::TorqueVerticesNet,
];
/// Supports along directions of the whole robot.
const SUPPORTS: [Field; 2] = [Field::TorqueSupport, Field::TorqueSupportNet];

/// The part of a robot that a plan computes, and where its outputs lie in the internal order.
#[derive(Clone, Debug)]
pub(super) struct Needed {
    pub(super) scope: Scope,
    /// First coordinate of each quaternion, and of those that are independent.
    pub(super) quaternions: Vec<usize>,
    pub(super) independent_quaternions: Vec<usize>,
    /// Clusters whose coordinates are read.
    pub(super) coordinates: Vec<usize>,
    /// Limits of joints whose coordinates are known, with the row of the joint among those that
    /// are asked, and of actuators as (actuator, row, effort), or (actuator, velocity, row) where
    /// the limit depends on the speed.
    pub(super) limits: Vec<(Option<usize>, Limit)>,
    pub(super) efforts: Vec<(usize, Option<usize>, f64)>,
    pub(super) curves: Vec<(usize, usize, Option<usize>)>,
    /// Tree coordinates and velocities of the rows that are asked.
    pub(super) q: Vec<usize>,
    pub(super) v: Vec<usize>,
    /// Rows of the independents, and their internal numbers.
    pub(super) qy_q: Vec<usize>,
    pub(super) vy_v: Vec<usize>,
    pub(super) vy: Vec<usize>,
    /// Rows of the actuators, and their numbers.
    pub(super) u_q: Vec<usize>,
    pub(super) u_v: Vec<usize>,
    pub(super) u: Vec<usize>,
}

impl Needed {
    pub(super) fn new<C>(
        model: &Model<C>,
        query: &Query,
        rows: Rows,
        (request, method): (Request, Method),
        steps: &Steps,
    ) -> Needed {
        let order = &model.order;
        let internal = |rows: &[usize], order: &[usize]| {
            rows.iter().map(|row| order[*row]).collect::<Vec<usize>>()
        };
        let v = internal(&rows.v, &order.v);
        let roots = roots(model, query, (request, method), steps, &v);
        let scope = Scope::of(model, &roots);
        let has_rows = query.want.iter().any(|field| field.has_joint_rows());
        let asked = v.iter().map(|v| model.cluster_of_v[*v]).filter(|_| has_rows);
        let posed = scope.posed.indices().map(|i| model.cluster_of[i]);
        let marked = |which: &mut dyn Iterator<Item = usize>| {
            let mut marks = vec![false; model.clusters.len()];
            which.for_each(|c| marks[c] = true);
            marks
        };
        let read = marked(&mut roots.closed.iter().copied().chain(posed).chain(asked));
        let closed = marked(&mut scope.closed.iter().copied());
        let answered = marked(&mut roots.answered.iter().copied());
        // the row of each internal velocity, if it has one
        let mut row_of = vec![None; model.cluster_of_v.len()];
        v.iter().enumerate().for_each(|(row, v)| row_of[*v] = Some(row));
        let is_known = |limit: &&Limit| {
            let c = model.cluster_of_v[limit.v];
            let cluster = &model.clusters[c];
            let is_given =
                cluster.is_serial() || cluster.independent.contains(&(limit.v - cluster.v));
            read[c] && (is_given || closed[c])
        };
        let limits = model.limits.iter().filter(is_known);
        let limits = limits.map(|limit| (row_of[limit.v], *limit)).collect();
        // forces of actuators that are found, where they are wanted or read by a wanted field
        let finds = matches!(request, Request::InverseDynamics | Request::Map);
        let is_judged =
            finds && (query.want.has(Field::TauU) || query.want.has_any(&OF_ACTUATOR_FORCES));
        let judged = order.u_v.iter().copied().enumerate();
        let (curves, efforts): (Vec<_>, Vec<_>) = judged
            .filter(|(_, v)| is_judged && answered[model.cluster_of_v[*v]])
            .partition(|(u, _)| model.motors[*u].has_curve());
        let efforts = efforts.into_iter().map(|(u, v)| (u, row_of[v], model.effort[u])).collect();
        let curves = curves.into_iter().filter(|(u, _)| model.motors[*u].has_effort());
        let quaternion = |i: &usize| {
            let body = &model.bodies[*i];
            (body.motion.n_q() > 1).then(|| body.q + body.motion.n_q() - 4)
        };
        let bodies = || 1..model.bodies.len();
        Needed {
            quaternions: bodies().filter_map(|i| quaternion(&i)).collect(),
            independent_quaternions: bodies()
                .filter(|i| model.is_independent(*i))
                .filter_map(|i| quaternion(&i))
                .collect(),
            coordinates: (0..read.len()).filter(|c| read[*c]).collect(),
            limits,
            efforts,
            curves: curves.map(|(u, v)| (u, v, row_of[v])).collect(),
            q: internal(&rows.q, &order.q),
            qy_q: internal(&rows.qy, &order.qy_q),
            vy_v: internal(&rows.vy, &order.vy_v),
            vy: internal(&rows.vy, &order.vy),
            u_q: internal(&rows.u, &order.u_q),
            u_v: internal(&rows.u, &order.u_v),
            u: rows.u,
            v,
            scope,
        }
    }
}

/// Direct dependencies of the query, by cluster.
fn roots<C>(
    model: &Model<C>,
    query: &Query,
    (request, method): (Request, Method),
    steps: &Steps,
    picked: &[usize],
) -> Roots {
    let want = query.want;
    let all = || (0..model.clusters.len()).collect::<Vec<usize>>();
    let has_rows = want.iter().any(|field| field.has_joint_rows());
    let frames = match (steps.links || steps.derivatives, steps.frames) {
        (true, _) => (1..model.bodies.len()).collect(),
        (_, true) => supports(model, &posed_links(query)),
        _ => Vec::new(),
    };
    // figures of the robot, or nothing but the status
    let whole = want.has_any(&OF_THE_ROBOT)
        || steps.links
        || steps.derivatives
        || steps.regressor
        || want.has_any(&SUPPORTS)
        || steps.task_space
        || request == Request::InverseKinematics
        || !has_rows && !steps.frames
        || request == Request::ForwardDynamics && method == Method::Kkt;
    let mut rows: Vec<usize> = picked.iter().map(|v| model.cluster_of_v[*v]).collect();
    rows.dedup();
    rows.sort_unstable();
    rows.dedup();
    let rows = if has_rows { rows } else { Vec::new() };

    let forces = match request {
        Request::InverseDynamics
            if steps.force_derivatives
                || steps.task_space
                || steps.regressor
                || want.has_any(&[Field::Lambda, Field::CondMy, Field::TorqueSupportNet]) =>
        {
            all()
        }
        Request::InverseDynamics if want.has_any(&FORCES) => rows.clone(),
        Request::InverseDynamics => Vec::new(),
        Request::Observe if want.has_any(&OBSERVED) => all(),
        Request::ForwardDynamics if whole => all(),
        Request::ForwardDynamics => {
            let on_paths = frames.iter().map(|i| model.cluster_of[*i]);
            standing_together(model, rows.iter().copied().chain(on_paths))
        }
        _ => Vec::new(),
    };
    let answered = if request == Request::Map { rows.clone() } else { forces.clone() };
    let is_actuated = [Some(steps.position), steps.velocity, steps.acceleration]
        .contains(&Some(Space::Actuation));
    let needs_G = steps.derivatives
        || steps.geometry
        || want.has_any(&[Field::JacobianIndependent, Field::JacobianActuator, Field::MY])
        || want.iter().any(Field::is_of_motors);
    Roots {
        closed: if whole { all() } else { rows },
        forces,
        answered,
        frames,
        open_paths: !is_actuated && !needs_G,
    }
}

/// All clusters that stand on the world together with some of these.
fn standing_together<C>(model: &Model<C>, some: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut root = vec![0; model.clusters.len()];
    for (c, cluster) in model.clusters.iter().enumerate() {
        root[c] = if cluster.parent == 0 { c } else { root[model.cluster_of[cluster.parent]] };
    }
    let mut needed = vec![false; root.len()];
    some.for_each(|c| needed[root[c]] = true);
    (0..root.len()).filter(|c| needed[root[*c]]).collect()
}
