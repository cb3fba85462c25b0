//! A plan: the steps that a query needs on a model, and no others.

mod actuation;
mod batch;
mod closed;
mod diagnostics;
mod forces;
mod kkt;
mod limits;
mod needed;
mod outline;
mod output;
mod run;
mod scratch;
mod state;

pub use batch::{Batch, BatchWorkspace, MOST_ROWS, PackedRows, STRAIGHT_FIELDS};
pub use closed::ClosedNumbers;
pub(crate) use forces::wrenches_on_bodies;
pub(crate) use kkt::{Drift, drift_of, tree_under_constraints};
pub use outline::Outline;
pub use run::PlanScalar;

pub(crate) use sarrus_proto::Answer;
#[cfg(doc)]
use sarrus_proto::Warnings;
use sarrus_proto::{Field, FieldSet, Layout, Query, QueryError, Request, Rows};

use crate::closure::Level;
use crate::model::{Method, Model};
use crate::plan::closed::Closed;
use crate::plan::needed::Needed;
use crate::workspace::Needs;

/// Steps for one kind of request on one model; made off the hot path, then run any number of times.
///
/// A plan computes what its outputs depend on and nothing else; [`Plan::outline`] says what that
/// is. Status and warnings concern that part of the robot alone: a closure that was left out cannot
/// fail, and limits of joints that were not read are not compared. Where the answer to all outputs
/// is `ok`, the answer to some of them is too, with the same bits; digits are counted against the
/// largest number of a field as it is asked ([`Warnings::ILL_CONDITIONED`]).
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
/// let (given, want) = (FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::TauU]));
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
    /// How forward dynamics is done.
    method: Method,
    /// Links whose frames are asked, bodies on the paths to them and to the links with wrenches;
    /// parents first.
    frames: Vec<usize>,
    frame_bodies: Vec<usize>,
    wrench_bodies: Vec<usize>,
    /// The links with wrenches that are felt, as (place in the request, link).
    wrench_links: Vec<(usize, usize)>,
    needed: Needed,
    closed: Closed,
    /// How many states go abreast.
    abreast: usize,
}

/// Which space the motion comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Space {
    Independent,
    Tree,
    Actuation,
}

/// What has to be done, decided once.
#[derive(Clone, Copy, Debug)]
struct Steps {
    position: Space,
    velocity: Option<Space>,
    acceleration: Option<Space>,
    /// How far down the closures go.
    level: Level,
    /// Some velocity, acceleration or bias is read, be it zero.
    rates: bool,
    /// q̈ of dependents is read: that of the given motion, or that of the ÿ that was found.
    given_acceleration: bool,
    found_acceleration: bool,
    /// Sines and cosines of free joints and the poses of all bodies in their parents.
    poses: bool,
    frames: bool,
    frame_velocities: bool,
    newton_euler: bool,
    /// The robot is at rest, and so are its bias forces: gravity and springs alone.
    rest: bool,
    bias_at_rest: bool,
    mass_matrix: bool,
    /// K or what follows from it.
    conditions: bool,
}

impl Plan {
    /// The plan for `query` on `model`. Forward dynamics goes by the model's choice
    /// ([`Model::forward_method`]), whatever else is wanted: a number has the same bits in every
    /// answer. Allocates; errors name the field that does not fit.
    pub fn new<C>(model: &Model<C>, query: &Query) -> Result<Plan, QueryError> {
        Plan::with_method(model, query, model.forward_method())
    }

    /// The plan for `query` on `model` with forward dynamics by this method; [`Method::Kkt`] needs
    /// [`crate::Workspace::for_plans`].
    pub fn with_method<C>(
        model: &Model<C>,
        query: &Query,
        method: Method,
    ) -> Result<Plan, QueryError> {
        use Field::*;
        let request = query.check(&model.meta)?;
        let sizes = model.meta.sizes;
        let (given, want) = (query.given, query.want);
        let space = |y, q, u| {
            [(y, Space::Independent), (q, Space::Tree), (u, Space::Actuation)]
                .into_iter()
                .find(|(field, _)| given.has(*field))
                .map(|x| x.1)
        };
        let position = space(Y, Q, U).unwrap_or(Space::Independent);
        let velocity = space(Yd, Qd, Ud);
        let acceleration = space(Ydd, Qdd, Udd);

        let dynamics = matches!(request, Request::InverseDynamics | Request::ForwardDynamics);
        let frames = query.n_frames > 0
            && want.has_any(&[
                FramePose,
                FrameTwist,
                FrameAcc,
                JacobianTree,
                JacobianIndependent,
                JacobianActuator,
            ]);
        let conditions = want.has_any(&needed::OF_THE_ROBOT);
        let wants_velocity = want.has_any(&[Qd, Yd, Ud, FrameTwist, FrameAcc, KBias]);
        let wants_acceleration = want.has_any(&[Qdd, Ydd, Udd, FrameAcc]);
        let wants_bias = want.has_any(&[GBias, GUBias]) && velocity.is_some();
        let reads_acceleration = want.has_any(&[Qdd, Udd, FrameAcc]);
        let moving = velocity.is_some();
        let rest = !moving && acceleration.is_none();
        // with ẏ = 0 the bias g is zero and need not be computed
        let level = if moving && (dynamics || wants_acceleration || wants_bias) {
            Level::Acceleration
        } else if dynamics
            || request == Request::Map
            || (moving && wants_velocity)
            || acceleration.is_some()
            || want.has_any(&[G, GU, CondGu, Uncontrolled, JacobianIndependent, JacobianActuator])
            || given.has_any(&[U, Ud, Udd])
        {
            if moving { Level::Velocity } else { Level::Jacobian }
        } else {
            Level::Position
        };
        let mass_matrix = want.has_any(&[MY, CondMy])
            || request == Request::ForwardDynamics && method == Method::Projection;
        let newton_euler = dynamics
            && (request == Request::ForwardDynamics
                || want.has_any(&[TauY, TauU, TauQ, TauUnactuated, Lambda]));
        let steps = Steps {
            position,
            velocity,
            acceleration,
            level,
            rates: request == Request::ForwardDynamics
                || !rest
                || conditions
                || wants_velocity
                || wants_acceleration
                || want.has_any(&[GBias, GUBias]),
            given_acceleration: !rest
                && request != Request::ForwardDynamics
                && (newton_euler || reads_acceleration),
            found_acceleration: reads_acceleration || want.has(Lambda),
            poses: frames || dynamics && (newton_euler || mass_matrix || want.has(CY)),
            frames,
            frame_velocities: want.has(FrameTwist),
            newton_euler,
            rest,
            bias_at_rest: !moving,
            mass_matrix,
            conditions,
        };
        let of = |links: &[u16]| links.iter().map(|link| *link as usize).collect::<Vec<_>>();
        let (frame_links, wrench_links) = (of(query.frames()), of(query.wrench_links()));
        let rows = Rows::of(query, &model.meta);
        let want = Layout::of_rows(query, &model.meta, &rows);
        let needed = Needed::new(model, query, rows, (request, method), &steps);
        // a wrench that nothing asked feels is not read
        let is_felt = |(_, link): &(usize, usize)| {
            let body = model.frames[*link].body;
            needed.scope.driven.contains(body)
        };
        let links = wrench_links.into_iter().enumerate();
        let felt: Vec<(usize, usize)> = links.filter(is_felt).collect();
        let felt_links: Vec<usize> = felt.iter().map(|(_, link)| *link).collect();
        let closed = Closed::new(model, query, &needed.scope, &steps);
        let mut plan = Plan {
            query: *query,
            request,
            given: Layout::of_given(query, &sizes),
            want,
            fingerprint: model.meta.fingerprint,
            steps,
            method,
            frame_bodies: supports(model, &frame_links),
            wrench_bodies: supports(model, &felt_links),
            frames: frame_links,
            wrench_links: felt,
            needed,
            closed,
            abreast: 1,
        };
        plan.abreast = plan.find_abreast(model);
        Ok(plan)
    }

    /// How the input numbers are packed.
    pub fn given(&self) -> &Layout {
        &self.given
    }

    /// How the output numbers are packed.
    pub fn want(&self) -> &Layout {
        &self.want
    }

    /// What the plan was made for.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// How forward dynamics is done.
    pub fn method(&self) -> Method {
        self.method
    }

    /// The square matrices that a workspace has to have.
    pub(crate) fn needs(&self) -> Needs {
        let kkt = self.method == Method::Kkt && self.request == Request::ForwardDynamics;
        Needs { mass_matrix: self.steps.mass_matrix, dense: self.steps.conditions, kkt }
    }

    fn wants(&self, field: Field) -> bool {
        self.query.want.has(field)
    }

    fn wants_any(&self, fields: &[Field]) -> bool {
        self.query.want.0 & FieldSet::of(fields).0 != 0
    }
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
