//! From a request that nobody has checked to an answer: the gate, the plan, the mathematics.

use std::sync::Arc;

use rtrb::{Consumer, Producer, PushError};
use sarrus_dynamics::{Model, Workspace};
use sarrus_proto::checksum::of_request;
use sarrus_proto::message::{
    ComputeRequest, MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, PlanNumber, RequestHead,
    ResponseHead,
};
use sarrus_proto::{Answer, PROTOCOL_VERSION, Status, Warnings};

use crate::plans::{PlanOrder, ServedPlan};
use crate::record::{Client, Recorder};
use crate::taken::Taken;

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
    /// By their slots.
    plans: Box<[Option<Box<ServedPlan>>]>,
    orders: Consumer<PlanOrder>,
    retired: Producer<Box<ServedPlan>>,
    workspace: Workspace<f64>,
    scratch: Vec<f64>,
    /// Where answers with a checksum, and recorded ones, come to be: the memory they go to is not
    /// ours alone.
    private: Vec<f64>,
    /// Copies what is asked and answered, where that is recorded.
    pub(crate) recorder: Option<Recorder>,
    /// Answers by generated kernels.
    pub(crate) by_kernel: u64,
}

/// How a plan ended.
struct Ran {
    status: Status,
    warnings: Warnings,
    n_out: usize,
    /// The numbers are in `private`.
    is_private: bool,
    checks: bool,
}

impl Engine {
    pub(crate) fn new(
        model: Arc<Model<f64>>,
        orders: Consumer<PlanOrder>,
        retired: Producer<Box<ServedPlan>>,
    ) -> Engine {
        let workspace = Workspace::new(&model);
        let plans = (0..MAX_PLANS).map(|_| None).collect();
        let (scratch, private) = (vec![0.0; MAX_NUMBERS_IN], vec![0.0; MAX_NUMBERS_OUT]);
        let recorder = None;
        Engine {
            model,
            plans,
            orders,
            retired,
            workspace,
            scratch,
            private,
            recorder,
            by_kernel: 0,
        }
    }

    /// Takes new plans and gives back old ones. Nobody ever blocks on these channels.
    pub(crate) fn obey(&mut self) {
        while let Ok(order) = self.orders.pop() {
            match order {
                PlanOrder::Serve(served) => {
                    let slot = served.number.slot();
                    self.plans[slot] = Some(served);
                }
                PlanOrder::Kernel(number, kernel) => {
                    let served = self.plans[number.slot()].as_mut();
                    if let Some(served) = served.filter(|served| served.number == number) {
                        served.kernel = Some(kernel);
                    }
                }
                PlanOrder::Retire(number) => {
                    let Some(served) = self.plans[number.slot()].take() else { continue };
                    // there is room for every plan, so this cannot fail; were it to, the plan would
                    // stay
                    if let Err(PushError::Full(served)) = self.retired.push(served) {
                        self.plans[number.slot()] = Some(served);
                    }
                }
            }
        }
    }

    /// True where the plan is there; one that was registered just now is fetched.
    #[inline]
    fn has(&mut self, number: PlanNumber) -> bool {
        let is_there = |plans: &[Option<Box<ServedPlan>>]| {
            plans[number.slot()].as_ref().is_some_and(|served| served.number == number)
        };
        is_there(&self.plans) || {
            self.obey();
            is_there(&self.plans)
        }
    }

    /// Whose request is answered next, and when it was found `[tick]`: what a recording says of it.
    #[inline]
    pub(crate) fn found(&mut self, ticks: u64, client: Client) {
        if let Some(recorder) = &mut self.recorder {
            recorder.take(ticks, client);
        }
    }

    /// The answer is on its way: what there is to be recorded of it can go on.
    #[inline]
    pub(crate) fn sent(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.commit();
        }
    }

    /// Checks a request, runs its plan from `input` into `output` and says how it ended, with times
    /// and checksum where they are asked. Never
    /// allocates, never panics; whatever the request says, nothing outside `input` and `output` is
    /// touched. What passes no gate leaves NaN.
    #[inline]
    pub(crate) fn answer(
        &mut self,
        head: &RequestHead,
        input: Input<'_>,
        output: &mut [f64],
        taken: &Taken<'_>,
    ) -> ResponseHead {
        match self.run(head, input, output) {
            Ok(Ran { status, warnings, n_out, is_private, checks }) => {
                let numbers = &self.private[..n_out];
                if is_private {
                    output[..n_out].copy_from_slice(numbers);
                }
                // without a checksum, also where the request has one: it was meant for another plan
                let answer = ResponseHead::new(status, warnings, head.sequence);
                taken.close(answer, checks.then_some(numbers))
            }
            Err(status) => {
                if let Some(recorder) = &mut self.recorder {
                    recorder.record_refusal(head, status);
                }
                refuse(head, status, output, taken)
            }
        }
    }

    #[inline]
    fn run(
        &mut self,
        head: &RequestHead,
        input: Input<'_>,
        output: &mut [f64],
    ) -> Result<Ran, Status> {
        // the gate
        if head.version != PROTOCOL_VERSION {
            return Err(Status::BadRequest);
        }
        if head.fingerprint != self.model.fingerprint() {
            return Err(Status::WrongModel);
        }
        let number = PlanNumber(head.plan);
        if !self.has(number) {
            return Err(Status::UnknownRequest);
        }
        let Some(ServedPlan { plan, kernel, checks, .. }) = self.plans[number.slot()].as_deref()
        else {
            return Err(Status::UnknownRequest);
        };

        // the counts are the plan's; a lane may be too small for another client's plan
        let (n_in, n_out, checks) = (plan.given().len(), plan.want().len(), *checks);
        let mut output = output.get_mut(..n_out).ok_or(Status::WrongSize)?;
        let input = match input {
            Input::Copied(numbers) => numbers.get(..n_in).ok_or(Status::WrongSize)?,
            Input::Shared(request) => {
                let scratch = self.scratch.get_mut(..n_in).ok_or(Status::WrongSize)?;
                request.read(scratch);
                scratch
            }
        };

        // what was sent
        if checks && of_request(head, input) != head.checksum {
            return Err(Status::CorruptAnswer);
        }
        // what is vouched for or recorded is what was computed, not what others may have written
        let is_private = checks || self.recorder.is_some();
        if is_private {
            output = self.private.get_mut(..n_out).ok_or(Status::WrongSize)?;
        }

        // the same bits by either
        let (of, workspace) = ((&*self.model, plan), &mut self.workspace);
        let answer = kernel.as_ref().and_then(|kernel| kernel.answer(of, workspace, input, output));
        let answer = match answer {
            Some(answer) => {
                self.by_kernel += 1;
                answer
            }
            None => plan.run(&self.model, &mut self.workspace, input, output),
        };
        if let Some(recorder) = &mut self.recorder {
            recorder.record(head, plan.query(), input, output, answer);
        }
        let Answer { status, warnings } = answer;
        Ok(Ran { status, warnings, n_out, is_private, checks })
    }
}

/// An answer without numbers.
#[inline]
pub(crate) fn refuse(
    head: &RequestHead,
    status: Status,
    output: &mut [f64],
    taken: &Taken<'_>,
) -> ResponseHead {
    output.fill(f64::NAN);
    taken.close(ResponseHead::new(status, Warnings::NONE, head.sequence), Some(&[]))
}
