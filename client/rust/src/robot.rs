//! A robot, in another process or in this one.

use std::sync::Arc;
use std::time::Duration;

use sarrus_dynamics::{Compiled, Model};
use sarrus_models::{LoadError, Options, Source, load};
use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT, Statistics};
use sarrus_proto::{Answer, Domain, ModelInfo, Query, Request, Status, Warnings};

use crate::batch::Batches;
use crate::describe::describe;
use crate::direct::Direct;
use crate::head::{Seen, Times};
use crate::local::Local;
use crate::plan::Plans;
use crate::query::QueryBuilder;
use crate::remote::Remote;
use crate::{ConnectError, ConnectOptions, Error, PlanId, Prepared};

/// A robot that answers requests, in another process or in this one, with the same methods and the
/// same bits.
///
/// ```no_run
/// use sarrus_client::{Request, Robot};
///
/// let mut robot = Robot::connect("upper-body")?;
/// let [n_y, n_u] = [robot.model().independent.len(), robot.model().active.len()];
/// let (y, yd, ydd, mut tau_u) = (vec![0.1; n_y], vec![0.0; n_y], vec![0.0; n_y], vec![0.0; n_u]);
/// robot.inverse_dynamics(&y, &yd, &ydd, &mut tau_u)?;
///
/// // anything else: a query, prepared once, asked as often as needed
/// let query = robot.query(Request::InverseDynamics).given(["y", "yd"]).want(["M_y", "C_y"]);
/// let plan = query.prepare()?;
/// let mut terms = vec![0.0; n_y * n_y + n_y];
/// robot.ask(plan, &[y, yd].concat(), &mut terms)?.ok()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Robot {
    side: Side,
    info: ModelInfo,
    pub(crate) plans: Plans,
    /// The common requests.
    pub(crate) direct: Direct,
    /// The input of the methods that pack fields.
    pub(crate) packed: Vec<f64>,
    /// The output of the methods that unpack fields.
    pub(crate) unpacked: Vec<f64>,
    seen: Seen,
}

/// The location of the robot.
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
        let loaded = load(source, options)?;
        let info = describe(&loaded);
        Ok(Robot::new(Side::Local(Box::new(Local::new(loaded.compiled.model))), info))
    }

    /// A robot in this process from a model compiled in code, without files. Such a model comes
    /// from a [`crate::DescriptionBuilder`], or by [`crate::Model::compile`] from a
    /// [`crate::description::Description`].
    pub fn from_model(compiled: Compiled) -> Robot {
        let warnings = compiled.warnings.iter().map(ToString::to_string).collect();
        let info = ModelInfo { warnings, ..compiled.model.info().clone() };
        Robot::new(Side::Local(Box::new(Local::new(compiled.model))), info)
    }

    /// Connects to a server on this machine, through a lane.
    ///
    /// # Errors
    /// [`ConnectError`], each with a remedy; when all lanes are taken,
    /// [`crate::Transport::Service`] may still be open.
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

    /// Connects to a server of a domain other than the user's own.
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
        Robot {
            side,
            info,
            plans: Plans::new(),
            direct: Direct::default(),
            packed: Vec::new(),
            unpacked: Vec::new(),
            seen: Seen::default(),
        }
    }

    /// Names, order, sizes and limits.
    pub fn model(&self) -> &ModelInfo {
        &self.info
    }

    /// The compiled model of a robot in this process, for plans and workspaces of other threads;
    /// `None` for a connected one.
    pub fn shared_model(&self) -> Option<Arc<Model<f64>>> {
        match &self.side {
            Side::Local(local) => Some(Arc::clone(&local.model)),
            Side::Remote(_) => None,
        }
    }

    /// Selects the generated kernels for plans prepared from now on; the default is none. Numbers,
    /// errors and warnings keep their bits. With [`crate::Kernels::File`] the file is loaded and
    /// compared now; otherwise kernels are looked up, or compiled, as plans are prepared. Without
    /// one the generic kernels answer, and [`Robot::answered_by`] has the reason.
    ///
    /// Loading a shared object runs it with the rights of this process: it must belong to this user
    /// or to root, and no other user may have write access.
    ///
    /// # Errors
    /// [`crate::KernelError`]: a connected robot, or a file that is refused. The earlier setting
    /// stays.
    #[cfg(feature = "kernels")]
    pub fn use_kernels(&mut self, kernels: crate::Kernels) -> Result<(), crate::KernelError> {
        match &mut self.side {
            Side::Local(local) => local.use_kernels(kernels),
            Side::Remote(_) if kernels == crate::Kernels::None => Ok(()),
            Side::Remote(_) => Err(crate::KernelError::Connected),
        }
    }

    /// The code that answers a plan.
    ///
    /// # Errors
    /// [`Error::UnknownPlan`], [`Error::ReleasedPlan`].
    #[cfg(feature = "kernels")]
    pub fn answered_by(&self, plan: PlanId) -> Result<crate::AnsweredBy<'_>, Error> {
        let (place, _) = self.plans.find(plan)?;
        Ok(match &self.side {
            Side::Local(local) => local.answered_by(place),
            Side::Remote(_) => crate::AnsweredBy::Generic,
        })
    }

    /// The server's counters; `None` in process and while the server is gone.
    pub fn statistics(&self) -> Option<Statistics> {
        match &self.side {
            Side::Remote(remote) => remote.statistics(),
            Side::Local(_) => None,
        }
    }

    /// The times of the last answer, if enabled by [`QueryBuilder::times`] or
    /// [`Robot::set_options`]; `None` otherwise, and if no answer came or a checksum failed. In
    /// process the age is 0. Costs nothing.
    pub fn times(&self) -> Option<Times> {
        self.seen.times
    }

    /// Requests to a server from now on have this deadline in place of
    /// [`ConnectOptions::deadline`]; `None`: none. No effect in process.
    pub fn set_deadline(&mut self, deadline: Option<Duration>) {
        if let Side::Remote(remote) = &mut self.side {
            remote.set_deadline(deadline);
        }
    }

    /// Answers that came after the deadline of their requests, as measured on this side; 0 in
    /// process.
    pub fn late(&self) -> u64 {
        self.seen.late
    }

    /// A query by names, to be prepared.
    pub fn query(&mut self, request: Request) -> QueryBuilder<'_> {
        QueryBuilder::new(self, request)
    }

    /// Prepares a plan for a query; equal queries share one. Replaces a lane that is too small for
    /// it. Allocates.
    ///
    /// # Errors
    /// [`Error`]: the query cannot be planned, moves too many numbers, or the server cannot take
    /// it.
    pub fn prepare(&mut self, query: &Query) -> Result<PlanId, Error> {
        if let Some(plan) = self.plans.share(query) {
            return Ok(plan);
        }
        query.check(&self.info).map_err(Error::Query)?;
        let (plan, n_in, n_out) = self.plans.add(query, &self.info);
        if let Err(error) = self.register(plan, query, [n_in, n_out]) {
            self.plans.release(plan)?;
            return Err(error);
        }
        self.packed.resize(self.packed.len().max(n_in), 0.0);
        self.unpacked.resize(self.unpacked.len().max(n_out), 0.0);
        Ok(plan)
    }

    fn register(
        &mut self,
        plan: PlanId,
        query: &Query,
        [n_in, n_out]: [usize; 2],
    ) -> Result<(), Error> {
        let max_in = MAX_NUMBERS_IN;
        let max_out = MAX_NUMBERS_OUT;
        if n_in > max_in || n_out > max_out {
            return Err(Error::TooLarge { n_in, n_out, max_in, max_out });
        }
        let (place, _) = self.plans.find(plan)?;
        match &mut self.side {
            Side::Local(local) => local.register(place, query),
            Side::Remote(remote) => remote.register(&self.plans, place),
        }
    }

    /// Releases a plan: its memory is freed, here and in the server, once it is released as often
    /// as it was prepared. Dropping the robot releases the others.
    ///
    /// # Errors
    /// [`Error::UnknownPlan`], [`Error::ReleasedPlan`]. A server that is gone causes no error: the
    /// plan is gone with it.
    pub fn release(&mut self, plan: PlanId) -> Result<(), Error> {
        if let Some(place) = self.plans.release(plan)? {
            match &mut self.side {
                Side::Local(local) => local.release(place),
                Side::Remote(remote) => remote.release(place),
            }
        }
        Ok(())
    }

    /// A plan of this robot; `None` if it belongs to another robot or was released.
    pub fn plan(&self, plan: PlanId) -> Option<&Prepared> {
        self.plans.find(plan).ok().map(|(_, prepared)| prepared)
    }

    /// Asks: `input` holds the given fields, `output` gets the wanted ones, both packed in the
    /// plan's layout. Through a lane and in process this never allocates; through the service the
    /// transport makes one small block.
    ///
    /// # Errors
    /// [`Error::UnknownPlan`] for a plan of another robot, [`Error::ReleasedPlan`];
    /// [`Error::ServerGone`] or [`Error::NoAnswer`] after the time of [`ConnectOptions::timeout`];
    /// [`Error::Connect`] when a restarted server holds another model. A request that fails is no
    /// error until [`Answer::ok`] makes it one.
    pub fn ask(
        &mut self,
        plan: PlanId,
        input: &[f64],
        output: &mut [f64],
    ) -> Result<Answer, Error> {
        self.seen.times = None;
        let outcome = match self.plans.find(plan) {
            Err(error) => Err(error),
            Ok((_, prepared))
                if input.len() != prepared.given().len()
                    || output.len() != prepared.want().len() =>
            {
                output.fill(f64::NAN);
                Ok(Answer { status: Status::WrongSize, warnings: Warnings::NONE })
            }
            Ok((place, prepared)) => match &mut self.side {
                Side::Remote(remote) => {
                    remote.ask(&self.plans, place, input, output, &mut self.seen)
                }
                Side::Local(local) => {
                    let stamp = Times::stamp(prepared.query());
                    let answer = local.ask(place, input, output);
                    self.seen.times = stamp.filter(|_| answer.is_ok()).map(Times::in_process);
                    answer
                }
            },
        };
        if outcome.is_err() {
            output.fill(f64::NAN);
        }
        outcome
    }

    /// The engine that answers batches of a plan, in process with this number of threads.
    pub(crate) fn batches(&mut self, plan: PlanId, threads: usize) -> Result<Batches<'_>, Error> {
        let (place, _) = self.plans.find(plan)?;
        match &mut self.side {
            Side::Local(local) => local.batches(place, threads).map(Batches::Here),
            Side::Remote(remote) => Ok(Batches::There { remote, plans: &self.plans, place }),
        }
    }

    /// The last answer was not that of a single state.
    pub(crate) fn forget_times(&mut self) {
        self.seen.times = None;
    }
}

// the robot can move to a controller's thread
const _: () = {
    const fn moves<T: Send>() {}
    moves::<Robot>()
};
