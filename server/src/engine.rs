//! From a request that nobody has checked to an answer: the gate, the plans, the mathematics.

use std::sync::{Arc, Mutex, OnceLock};

use sarrus_dynamics::{Model, Plan, Workspace};
use sarrus_proto::message::{
    ComputeRequest, MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, RequestHead, ResponseHead,
};
use sarrus_proto::{PROTOCOL_VERSION, Query, QueryError, Status, Warnings};

/// The plans of all clients: filled beside the answering thread, read by it. A plan stays as long
/// as the server.
pub(crate) struct Plans {
    table: Box<[OnceLock<Plan>]>,
    // only the side that registers takes it
    registered: Mutex<usize>,
}

/// A registered plan, as its client learns it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Registered {
    pub(crate) plan: u32,
    pub(crate) n_in: usize,
    pub(crate) n_out: usize,
}

/// Why a query gets no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unplanned {
    Query(QueryError),
    TooLarge { n_in: usize, n_out: usize },
    TooMany,
}

impl Plans {
    pub(crate) fn new() -> Plans {
        Plans {
            table: (0..MAX_PLANS).map(|_| OnceLock::new()).collect(),
            registered: Mutex::new(0),
        }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.table.iter().take_while(|plan| plan.get().is_some()).count()
    }

    /// The plan of a query; equal sets share one.
    pub(crate) fn register(
        &self,
        model: &Model<f64>,
        query: &Query,
    ) -> Result<Registered, Unplanned> {
        let mut registered =
            self.registered.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let known =
            self.table.iter().map_while(OnceLock::get).position(|plan| plan.query() == query);
        let index = match known {
            Some(index) => index,
            None => {
                let plan = Plan::new(model, query).map_err(Unplanned::Query)?;
                let (n_in, n_out) = (plan.given().len(), plan.want().len());
                if n_in > MAX_NUMBERS_IN || n_out > MAX_NUMBERS_OUT {
                    return Err(Unplanned::TooLarge { n_in, n_out });
                }
                let index = *registered;
                let slot = self.table.get(index).ok_or(Unplanned::TooMany)?;
                slot.get_or_init(|| plan);
                *registered += 1;
                index
            }
        };
        let plan = self.table.get(index).and_then(OnceLock::get).ok_or(Unplanned::TooMany)?;
        Ok(Registered { plan: index as u32, n_in: plan.given().len(), n_out: plan.want().len() })
    }

    fn find(&self, index: u32) -> Option<&Plan> {
        self.table.get(index as usize)?.get()
    }
}

/// Where a request's numbers are; a client may still be writing those of the service.
pub(crate) enum Input<'a> {
    /// The copy that the lane made.
    Copied(&'a [f64]),
    /// Shared memory, read once.
    Shared(&'a ComputeRequest),
}

/// Everything that answering needs; belongs to the answering thread.
pub(crate) struct Engine {
    model: Arc<Model<f64>>,
    plans: Arc<Plans>,
    workspace: Workspace<f64>,
    scratch: Vec<f64>,
}

impl Engine {
    pub(crate) fn new(model: Arc<Model<f64>>, plans: Arc<Plans>) -> Engine {
        let workspace = Workspace::new(&model);
        Engine { model, plans, workspace, scratch: vec![0.0; MAX_NUMBERS_IN] }
    }

    /// Checks a request, runs its plan from `input` into `output` and says how it ended. Never
    /// allocates, never panics; whatever the request says, nothing outside `input` and `output` is
    /// touched. What passes no gate leaves NaN.
    #[inline]
    pub(crate) fn answer(
        &mut self,
        head: &RequestHead,
        input: Input<'_>,
        output: &mut [f64],
    ) -> ResponseHead {
        let (status, warnings) = match self.run(head, input, output) {
            Ok(outcome) => outcome,
            Err(status) => {
                output.fill(f64::NAN);
                (status, Warnings::NONE)
            }
        };
        ResponseHead::new(status, warnings, head.sequence)
    }

    #[inline]
    fn run(
        &mut self,
        head: &RequestHead,
        input: Input<'_>,
        output: &mut [f64],
    ) -> Result<(Status, Warnings), Status> {
        // the gate
        if head.version != PROTOCOL_VERSION {
            return Err(Status::BadRequest);
        }
        if head.fingerprint != self.model.fingerprint() {
            return Err(Status::WrongModel);
        }
        let plan = self.plans.find(head.plan).ok_or(Status::UnknownRequest)?;

        // the counts are the plan's; a lane may be too small for another client's plan
        let (n_in, n_out) = (plan.given().len(), plan.want().len());
        let output = output.get_mut(..n_out).ok_or(Status::WrongSize)?;
        let input = match input {
            Input::Copied(numbers) => numbers.get(..n_in).ok_or(Status::WrongSize)?,
            Input::Shared(request) => {
                let scratch = self.scratch.get_mut(..n_in).ok_or(Status::WrongSize)?;
                request.read(scratch);
                scratch
            }
        };

        let answer = plan.run(&self.model, &mut self.workspace, input, output);
        Ok((answer.status, answer.warnings))
    }
}
