use sarrus_dynamics::Answer;
use sarrus_models::{LoadError, Options, Source};
use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT, Statistics};
use sarrus_proto::{Domain, Field, FieldSet, Layout, ModelInfo, Query, Request, Status, Warnings};

use crate::local::Local;
use crate::query::QueryBuilder;
use crate::remote::Remote;
use crate::{ConnectError, ConnectOptions, Error};

/// The number of a prepared plan of one [`Robot`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlanId(pub(crate) usize);

/// A prepared plan: what goes in, what comes out, and where.
#[derive(Clone, Debug)]
pub struct Prepared {
    query: Query,
    given: Layout,
    want: Layout,
}

impl Prepared {
    /// What it was made for.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// Where the fields lie in the input.
    pub fn given(&self) -> &Layout {
        &self.given
    }

    /// Where the fields lie in the output.
    pub fn want(&self) -> &Layout {
        &self.want
    }
}

/// A robot that answers: in another process or in this one, with the same methods and the same bits
/// in the answers.
///
/// ```no_run
/// use sarrus_client::{Request, Robot};
///
/// let mut robot = Robot::connect("upper-body")?;
/// let plan = robot.query(Request::InverseDynamics).given(&["y", "yd", "ydd"])?.want(&["tau_u"])?.prepare()?;
/// let input = vec![0.0; robot.plan(plan).map_or(0, |plan| plan.given().len())];
/// let mut tau_u = vec![0.0; robot.model().active.len()];
/// let answer = robot.ask(plan, &input, &mut tau_u)?;
/// println!("{}: {tau_u:?}", answer.status);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Robot {
    side: Side,
    info: ModelInfo,
    prepared: Vec<Prepared>,
    /// The input of the methods that pack fields.
    packed: Vec<f64>,
    /// The output of the methods that unpack fields.
    unpacked: Vec<f64>,
}

/// Where the robot is.
enum Side {
    /// In another process.
    Remote(Box<Remote>),
    /// In this one.
    Local(Box<Local>),
}

impl Robot {
    /// Loads a robot into this process: no server, the same answers.
    ///
    /// # Errors
    /// [`LoadError`], with every fault of the files.
    pub fn load(source: &Source, options: &Options) -> Result<Robot, LoadError> {
        let (local, info) = Local::load(source, options)?;
        Ok(Robot::new(Side::Local(Box::new(local)), info))
    }

    /// Connects to a server on this machine, with a lane of one's own.
    ///
    /// # Errors
    /// [`ConnectError`], each with what to do; when all lanes are taken, [`crate::Transport::Service`]
    /// may still be open.
    pub fn connect(name: &str) -> Result<Robot, ConnectError> {
        Robot::connect_with(name, ConnectOptions::default())
    }

    /// Connects to a server on this machine.
    ///
    /// # Errors
    /// As [`Robot::connect`].
    pub fn connect_with(name: &str, options: ConnectOptions) -> Result<Robot, ConnectError> {
        Robot::connect_in(Domain::of_user()?, name, options)
    }

    /// Connects to a server of another domain than the user's own.
    ///
    /// # Errors
    /// As [`Robot::connect`].
    pub fn connect_in(
        domain: Domain,
        name: &str,
        options: ConnectOptions,
    ) -> Result<Robot, ConnectError> {
        let (remote, info) = Remote::connect(domain, name, options)?;
        Ok(Robot::new(Side::Remote(Box::new(remote)), info))
    }

    fn new(side: Side, info: ModelInfo) -> Robot {
        Robot { side, info, prepared: Vec::new(), packed: Vec::new(), unpacked: Vec::new() }
    }

    /// Names, order, sizes and limits.
    pub fn model(&self) -> &ModelInfo {
        &self.info
    }

    /// What the server counts; `None` in process and while the server is gone.
    pub fn statistics(&self) -> Option<Statistics> {
        match &self.side {
            Side::Remote(remote) => remote.statistics(),
            Side::Local(_) => None,
        }
    }

    /// A query by names, to be prepared.
    pub fn query(&mut self, request: Request) -> QueryBuilder<'_> {
        QueryBuilder::new(self, request)
    }

    /// Prepares a plan for a query; equal sets share one. A lane that is too small for it is
    /// exchanged.
    ///
    /// # Errors
    /// [`Error`]: the set cannot be planned, moves too many numbers, or the server cannot take it.
    pub fn prepare(&mut self, query: &Query) -> Result<PlanId, Error> {
        if let Some(index) = self.prepared.iter().position(|prepared| prepared.query == *query) {
            return Ok(PlanId(index));
        }
        query.check(self.info.links.len()).map_err(Error::Query)?;
        let sizes = self.info.sizes;
        let (given, want) = (Layout::of_given(query, &sizes), Layout::of_want(query, &sizes));
        let (n_in, n_out) = (given.len(), want.len());
        if n_in > MAX_NUMBERS_IN || n_out > MAX_NUMBERS_OUT {
            return Err(Error::TooLarge {
                n_in,
                n_out,
                max_in: MAX_NUMBERS_IN,
                max_out: MAX_NUMBERS_OUT,
            });
        }
        self.packed.resize(self.packed.len().max(n_in), 0.0);
        self.unpacked.resize(self.unpacked.len().max(n_out), 0.0);
        self.prepared.push(Prepared { query: *query, given, want });
        let registered = match (&mut self.side, self.prepared.last()) {
            (Side::Local(local), Some(last)) => local.register(last),
            (Side::Remote(remote), _) => remote.register(&self.prepared),
            _ => Ok(()),
        };
        if let Err(error) = registered {
            self.prepared.pop();
            return Err(error);
        }
        Ok(PlanId(self.prepared.len() - 1))
    }

    /// A plan of this robot.
    pub fn plan(&self, plan: PlanId) -> Option<&Prepared> {
        self.prepared.get(plan.0)
    }

    /// Asks: `input` holds the given fields, `output` gets the wanted ones, both packed as the plan
    /// says. Through a lane and in process this never allocates; through the service the
    /// transport makes one small block.
    ///
    /// # Errors
    /// [`Error::ServerGone`] or [`Error::NoAnswer`] after the time of [`ConnectOptions::timeout`];
    /// [`Error::Connect`] when a restarted server holds another model. A request that fails is no
    /// error: see [`Answer::status`].
    pub fn ask(
        &mut self,
        plan: PlanId,
        input: &[f64],
        output: &mut [f64],
    ) -> Result<Answer, Error> {
        let prepared = self.prepared.get(plan.0).ok_or(Error::UnknownPlan { index: plan.0 })?;
        if input.len() != prepared.given.len() || output.len() != prepared.want.len() {
            output.fill(f64::NAN);
            return Ok(Answer { status: Status::WrongSize, warnings: Warnings::NONE });
        }
        let outcome = match &mut self.side {
            Side::Remote(remote) => remote.ask(&self.prepared, plan.0, input, output),
            Side::Local(local) => local.ask(plan.0, input, output),
        };
        if outcome.is_err() {
            output.fill(f64::NAN);
        }
        outcome
    }

    /// Actuator forces for a motion: τ_u from y, ẏ, ÿ.
    ///
    /// # Errors
    /// As [`Robot::ask`]; the first call also as [`Robot::prepare`].
    pub fn inverse_dynamics(
        &mut self,
        y: &[f64],
        yd: &[f64],
        ydd: &[f64],
        tau_u: &mut [f64],
    ) -> Result<Answer, Error> {
        const WANTED: Query = Query::new(
            Request::InverseDynamics,
            FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
            FieldSet::of(&[Field::TauU]),
        );
        self.pack_and_ask(&WANTED, &[y, yd, ydd], &mut [tau_u])
    }

    /// Motion under actuator forces: ÿ from y, ẏ, τ_u.
    ///
    /// # Errors
    /// As [`Robot::inverse_dynamics`].
    pub fn forward_dynamics(
        &mut self,
        y: &[f64],
        yd: &[f64],
        tau_u: &[f64],
        ydd: &mut [f64],
    ) -> Result<Answer, Error> {
        const WANTED: Query = Query::new(
            Request::ForwardDynamics,
            FieldSet::of(&[Field::Y, Field::Yd, Field::TauU]),
            FieldSet::of(&[Field::Ydd]),
        );
        self.pack_and_ask(&WANTED, &[y, yd, tau_u], &mut [ydd])
    }

    /// The whole tree's motion: q, q̇, q̈ from y, ẏ, ÿ.
    ///
    /// # Errors
    /// As [`Robot::inverse_dynamics`].
    pub fn state(
        &mut self,
        y: &[f64],
        yd: &[f64],
        ydd: &[f64],
        q: &mut [f64],
        qd: &mut [f64],
        qdd: &mut [f64],
    ) -> Result<Answer, Error> {
        const WANTED: Query = Query::new(
            Request::Kinematics,
            FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
            FieldSet::of(&[Field::Q, Field::Qd, Field::Qdd]),
        );
        self.pack_and_ask(&WANTED, &[y, yd, ydd], &mut [q, qd, qdd])
    }

    /// Asks with fields in arrays of their own, in packing order.
    fn pack_and_ask(
        &mut self,
        query: &Query,
        given: &[&[f64]],
        want: &mut [&mut [f64]],
    ) -> Result<Answer, Error> {
        let plan = self.prepare(query)?;
        let fits = {
            let prepared = &self.prepared[plan.0];
            let fits_in = prepared
                .given
                .slots()
                .iter()
                .map(|slot| slot.range().len())
                .eq(given.iter().map(|field| field.len()));
            let fits_out = prepared
                .want
                .slots()
                .iter()
                .map(|slot| slot.range().len())
                .eq(want.iter().map(|field| field.len()));
            fits_in && fits_out
        };
        if !fits {
            want.iter_mut().for_each(|field| field.fill(f64::NAN));
            return Ok(Answer { status: Status::WrongSize, warnings: Warnings::NONE });
        }

        let (mut packed, mut unpacked) =
            (std::mem::take(&mut self.packed), std::mem::take(&mut self.unpacked));
        let mut n_in = 0;
        for field in given {
            packed[n_in..n_in + field.len()].copy_from_slice(field);
            n_in += field.len();
        }
        let n_out = want.iter().map(|field| field.len()).sum();
        let outcome = self.ask(plan, &packed[..n_in], &mut unpacked[..n_out]);
        let mut rest = &unpacked[..n_out];
        for field in want {
            let (numbers, after) = rest.split_at(field.len());
            field.copy_from_slice(numbers);
            rest = after;
        }
        (self.packed, self.unpacked) = (packed, unpacked);
        outcome
    }
}

// a controller's thread may take the robot over
const _: () = {
    const fn moves<T: Send>() {}
    moves::<Robot>()
};
