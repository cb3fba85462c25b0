//! Tasks of frames and of the centre of mass: their inertia and forces, and the positions that
//! reach targets.
//!
//! A search moves the independents and closes the loops exactly at each of its poses. Each step is
//! a quadratic program: the damped errors of the tasks, within the bounds of the independents, and
//! of the dependent joints and actuators, whose coordinates change by G (`step.rs`). A pose counts
//! only if its true coordinates break no bound.

mod errors;
mod motion;
mod pose;
mod search;
mod space;
mod step;

use sarrus_proto::{Field, Query, QueryError, Request, TaskParts};

use crate::closure::column_unit;
use crate::model::{Method, Model};
use crate::plan::task::motion::Motion;
use crate::plan::{Plan, supports};
use crate::scalar::Real;

/// The part of a model and a query that a search reads, by internal numbers.
#[derive(Clone, Debug)]
pub(super) struct Tasks {
    /// Link and parts of each task, in the order of the query.
    tasks: Vec<(usize, TaskParts)>,
    independents: Vec<Independent>,
    /// The independents that move the frames or the centre of mass.
    moves: Vec<usize>,
    /// Tree coordinate and velocity of the joints of one freedom that have bounds, be they given.
    bounded: Vec<(usize, usize)>,
    /// The model's bounds of each tree velocity's coordinate (n_v).
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Of each independent coordinate and each actuator in the query's order the tree velocity of
    /// its joint of one freedom.
    y: Vec<Option<usize>>,
    u: Vec<Option<usize>>,
    /// Some task is of the second level, or an independent has a preferred coordinate.
    has_second: bool,
    /// Of a request for one step, without a search.
    motion: Option<Motion>,
}

/// An independent velocity: its cluster, its place in it, and its unit in radians or lengths.
#[derive(Clone, Copy, Debug)]
struct Independent {
    cluster: usize,
    j: usize,
    unit: f64,
    /// Tree coordinate and velocity, of a joint of one freedom.
    single: Option<(usize, usize)>,
}

impl Tasks {
    /// `None` for a request without tasks.
    pub(super) fn of<C: Real>(
        model: &Model<C>,
        query: &Query,
        method: Method,
    ) -> Result<Option<Tasks>, QueryError> {
        if !Request::from_code(query.request).is_some_and(Request::has_tasks) {
            return Ok(None);
        }
        let sizes = model.sizes();
        let links = query.frames().iter().map(|link| usize::from(*link));
        let tasks: Vec<(usize, TaskParts)> = links.zip(query.tasks).collect();
        let mut single = vec![None; sizes.n_v];
        let mut independents = Vec::with_capacity(sizes.n_vy);
        for (c, cluster) in model.clusters.iter().enumerate() {
            for (j, dof) in cluster.dofs.iter().enumerate() {
                if dof.single {
                    single[cluster.v + j] = Some(cluster.q + dof.q);
                }
            }
            for &j in &cluster.independent {
                let v = cluster.v + j;
                let unit = column_unit(cluster, j);
                let single = single[v].map(|q| (q, v));
                independents.push(Independent { cluster: c, j, unit, single });
            }
        }
        let given = query.given;
        let moves = if given.has(Field::ComTarget) || given.has(Field::YPreferred) {
            (0..sizes.n_vy).collect()
        } else {
            let links = tasks.iter().map(|(link, _)| *link).chain(query.reference());
            let bodies = supports(model, &links.collect::<Vec<usize>>());
            let is_moved = |c: usize| bodies.iter().any(|i| model.cluster_of[*i] == c);
            (0..sizes.n_vy).filter(|k| is_moved(independents[*k].cluster)).collect()
        };
        let mut lower = vec![f64::NEG_INFINITY; sizes.n_v];
        let mut upper = vec![f64::INFINITY; sizes.n_v];
        for limit in &model.limits {
            (lower[limit.v], upper[limit.v]) = (limit.lower, limit.upper);
        }
        let v_of = |q: &usize| single.iter().position(|of| *of == Some(*q));
        let y: Vec<Option<usize>> = model.order.qy_q.iter().map(v_of).collect();
        let u: Vec<Option<usize>> = model.order.u_q.iter().map(v_of).collect();
        let is_bounded = |v: &usize| {
            lower[*v] > f64::NEG_INFINITY
                || upper[*v] < f64::INFINITY
                || given.has(Field::BoundsY) && y.contains(&Some(*v))
                || given.has(Field::BoundsU) && u.contains(&Some(*v))
        };
        let bounded =
            (0..sizes.n_v).filter(is_bounded).filter_map(|v| single[v].map(|q| (q, v))).collect();
        let has_second = given.has(Field::YPreferred)
            || tasks.iter().any(|(_, parts)| parts.contains(TaskParts::SECOND));
        let motion = Motion::of(model, query, method, &single)?;
        Ok(Some(Tasks {
            tasks,
            independents,
            moves,
            bounded,
            lower,
            upper,
            y,
            u,
            has_second,
            motion,
        }))
    }

    /// The ordinary request that one for a step of a motion reads.
    pub(super) fn inner(&self) -> Option<&Plan> {
        self.motion.as_ref().map(|motion| &motion.inner)
    }
}
