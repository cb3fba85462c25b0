//! A plan: the steps that a query needs on a model, and no others.

mod actuation;
mod base;
mod batch;
mod closed;
mod derivatives;
mod diagnostics;
mod forces;
mod geometry;
mod kkt;
mod limits;
mod links;
mod motors;
mod needed;
mod newton;
mod observer;
mod outline;
mod output;
mod planned;
mod regressor;
mod run;
mod scratch;
mod second;
mod state;
mod steps;
mod task;
mod view;

pub use base::{Base, base_parameters};
pub use batch::{
    Batch, BatchWorkspace, CUT_SHORT, MOST_ROWS, PackedRows, STRAIGHT_FIELDS, STRAIGHT_GIVEN,
};
pub use closed::ClosedNumbers;
pub(crate) use forces::wrenches_on_bodies;
pub(crate) use kkt::{Drift, drift_of, tree_under_constraints};
pub use newton::{NewtonBlock, NewtonCluster};
pub use outline::Outline;
pub use planned::Planned;
pub use run::PlanScalar;

pub(crate) use sarrus_proto::Answer;
#[cfg(doc)]
use sarrus_proto::Warnings;
use sarrus_proto::{Field, FieldSet, Layout, Query, QueryError, QueryOptions, Request, Rows};

use crate::model::{Method, Model};
use crate::plan::closed::Closed;
use crate::plan::motors::Motors;
use crate::plan::needed::Needed;
use crate::plan::steps::{Space, Steps};
use crate::plan::task::Tasks;
use crate::scalar::Real;
use crate::workspace::Needs;

/// Steps for one kind of request on one model; made off the hot path, then run any number of times.
///
/// A plan computes the dependencies of its outputs and nothing else; [`Plan::outline`] lists them.
/// Status and warnings concern that part of the robot alone: an omitted closure cannot fail, and
/// limits of unread joints are not compared. If the answer to all outputs is `ok`, the answer to
/// some of them is `ok` with the same bits; digits are counted relative to the largest number of a
/// field as requested ([`Warnings::ILL_CONDITIONED`]).
///
/// ```
/// use sarrus_dynamics::description::Inertial;
/// use sarrus_dynamics::{DescriptionBuilder, LinkId, Plan, Workspace};
/// use sarrus_proto::{Field, FieldSet, Request, Query};
///
/// // a pendulum: 1 kg, 1 m below a horizontal axis
/// let mut robot = DescriptionBuilder::new("pendulum");
/// let bob = Inertial::point(1.0, [0.0, 0.0, -1.0]);
/// robot.revolute("pivot", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(bob);
/// let model = robot.compile()?.model;
/// let given = FieldSet::of(&[Field::Y]);
/// let want = FieldSet::of(&[Field::TauU]);
/// let query = Query::new(Request::InverseDynamics, given, want);
/// let plan = Plan::new(&model, &query)?;
/// let mut workspace = Workspace::new(&model);
/// let mut tau = [0.0];
/// plan.run(&model, &mut workspace, &[std::f64::consts::FRAC_PI_2], &mut tau).ok()?;
/// assert!((tau[0] - 9.81).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Plan {
    query: Query,
    request: Request,
    given: Layout,
    want: Layout,
    fingerprint: u64,
    steps: Steps,
    /// Method of forward dynamics.
    method: Method,
    /// Links of the wanted frames, bodies on the paths to them and to the links with wrenches;
    /// parents first.
    frames: Vec<usize>,
    frame_bodies: Vec<usize>,
    wrench_bodies: Vec<usize>,
    /// Links whose wrenches affect the outputs, as (place in the request, link).
    wrench_links: Vec<(usize, usize)>,
    needed: Needed,
    motors: Option<Motors>,
    closed: Closed,
    /// Of a request with tasks.
    task: Option<Box<Tasks>>,
    /// The plan of the first derivatives whose differences are wanted.
    first: Option<Box<Plan>>,
    /// Where they are wanted.
    base: Vec<f64>,
    /// States of a packet.
    batch_width: usize,
}

impl Plan {
    /// The plan for `query` on `model`. Forward dynamics goes by the model's choice
    /// ([`Model::forward_method`]) independently of the other outputs: a number has the same bits
    /// in every answer. Allocates; errors name the field that does not fit.
    pub fn new<C: Real>(model: &Model<C>, query: &Query) -> Result<Plan, QueryError> {
        Plan::with_method(model, query, model.forward_method())
    }

    /// The plan for `query` on `model` with forward dynamics by this method; [`Method::Kkt`] needs
    /// [`crate::Workspace::for_plans`].
    pub fn with_method<C: Real>(
        model: &Model<C>,
        query: &Query,
        method: Method,
    ) -> Result<Plan, QueryError> {
        let request = query.check(&model.meta)?;
        let steps = Steps::new(query, request, method);
        let frames: Vec<usize> = query.frames().iter().map(|link| usize::from(*link)).collect();
        let rows = Rows::of(query, &model.meta);
        let want = Layout::of_rows(query, &model.meta, &rows);
        let needed = Needed::new(model, query, rows, (request, method), &steps);
        // a wrench without effect on the outputs is not read
        let has_effect =
            |(_, link): &(usize, usize)| needed.scope.affected.contains(model.frames[*link].body);
        let links = query.wrench_links().iter().map(|link| usize::from(*link)).enumerate();
        let wrench_links: Vec<(usize, usize)> = links.filter(has_effect).collect();
        let loaded: Vec<usize> = wrench_links.iter().map(|(_, link)| *link).collect();
        let task = Tasks::of(model, query, method)?.map(Box::new);
        let first = second::first(model, query, method)?.map(Box::new);
        let closed = match task.is_none() && first.is_none() {
            true => Closed::new(model, query, &needed.scope, &steps),
            false => Closed::default(),
        };
        let mut plan = Plan {
            query: *query,
            request,
            given: Layout::of_given(query, &model.meta.sizes),
            want,
            fingerprint: model.meta.fingerprint,
            steps,
            method,
            frame_bodies: match steps.links || steps.derivatives {
                true => (1..model.bodies.len()).collect(),
                false => supports(model, &posed_links(query)),
            },
            wrench_bodies: supports(model, &loaded),
            frames,
            wrench_links,
            motors: if task.is_none() { Motors::new(model, &query.want, &needed)? } else { None },
            needed,
            closed,
            task,
            first,
            base: base::wanted(model, query)?,
            batch_width: 1,
        };
        plan.batch_width = plan.batch_width_on(model);
        Ok(plan)
    }

    /// Layout of the input.
    pub fn given(&self) -> &Layout {
        &self.given
    }

    /// Layout of the output.
    pub fn want(&self) -> &Layout {
        &self.want
    }

    /// The query of the plan.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// Method of forward dynamics.
    pub fn method(&self) -> Method {
        self.method
    }

    /// The square matrices that a workspace has to have.
    pub(crate) fn needs(&self) -> Needs {
        let kkt = self.method == Method::Kkt && self.request == Request::ForwardDynamics;
        let Steps { mass_matrix, conditions: dense, derivatives, geometry, task_space, .. } =
            self.steps;
        let frames = if task_space { self.frames.len() } else { 0 };
        let own = Needs {
            mass_matrix,
            dense,
            kkt,
            derivatives: derivatives || geometry,
            motors: self.motors.is_some(),
            frames,
            // in doubles alone
            search: self.task.is_some() || self.first.is_some(),
        };
        self.inner().map_or(own, |inner| own.and(inner.needs()))
    }

    /// The ordinary request that one for a step of a motion reads.
    pub(crate) fn inner(&self) -> Option<&Plan> {
        self.task.as_ref().and_then(|task| task.inner())
    }

    /// True if a request may search as long as it takes.
    pub fn searches(&self) -> bool {
        self.query.options.contains(QueryOptions::SEARCH)
    }

    /// True if a request may take longer than the bound of the others.
    pub fn is_long(&self) -> bool {
        self.searches() || self.task.is_some() && self.inner().is_none()
    }

    fn wants(&self, field: Field) -> bool {
        self.query.want.has(field)
    }

    fn wants_any(&self, fields: &[Field]) -> bool {
        self.query.want.0 & FieldSet::of(fields).0 != 0
    }
}

/// The links whose poses in the root frames need.
fn posed_links(query: &Query) -> Vec<usize> {
    let frames = query.frames().iter().map(|link| usize::from(*link));
    frames.chain(query.reference()).collect()
}

/// The bodies that carry the given links, parents first.
pub(crate) fn supports<C>(model: &Model<C>, links: &[usize]) -> Vec<usize> {
    let mut supports = vec![false; model.bodies.len()];
    for link in links {
        let mut i = model.frames[*link].body;
        while i != 0 {
            supports[i] = true;
            i = model.bodies[i].parent;
        }
    }
    (1..model.bodies.len()).filter(|i| supports[*i]).collect()
}
