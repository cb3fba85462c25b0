//! From a request that nobody has checked to an answer: the gate, the plan, the mathematics.

use std::sync::Arc;

use rtrb::{Consumer, Producer, PushError};
use sarrus_dynamics::{BatchWorkspace, MOST_ROWS, Model, Plan};
use sarrus_proto::batch::{BatchHead, BatchShape, ServedBatch};
use sarrus_proto::checksum::of_request;
use sarrus_proto::message::{
    ComputeRequest, MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, PlanNumber, RequestHead,
    ResponseHead,
};
use sarrus_proto::{Answer, PROTOCOL_VERSION, Status, Warnings};

use crate::kernels::NativeKernel;
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
    /// By their slots.
    plans: Box<[Option<Box<ServedPlan>>]>,
    orders: Consumer<PlanOrder>,
    retired: Producer<Box<ServedPlan>>,
    workspace: BatchWorkspace,
    scratch: Vec<f64>,
    /// Where answers with a checksum, recorded ones, and those of batches come to be: the memory
    /// they go to is not ours alone.
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
        let workspace = BatchWorkspace::new(&model, MAX_NUMBERS_IN, MAX_NUMBERS_OUT);
        let plans = (0..MAX_PLANS).map(|_| None).collect();
        let [scratch, private] =
            [MAX_NUMBERS_IN, MAX_NUMBERS_OUT].map(|n| vec![0.0; MOST_ROWS * n]);
        let recorder = None;
        Engine { plans, orders, retired, workspace, scratch, private, recorder, by_kernel: 0 }
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

    /// The gate: the slot of the plan that is asked.
    #[inline]
    fn admit(&mut self, version: u32, fingerprint: u64, plan: u32) -> Result<usize, Status> {
        if version != PROTOCOL_VERSION {
            return Err(Status::BadRequest);
        }
        if fingerprint != self.workspace.model().fingerprint() {
            return Err(Status::WrongModel);
        }
        let number = PlanNumber(plan);
        if !self.has(number) {
            return Err(Status::UnknownRequest);
        }
        Ok(number.slot())
    }

    #[inline]
    fn run(
        &mut self,
        head: &RequestHead,
        input: Input<'_>,
        output: &mut [f64],
    ) -> Result<Ran, Status> {
        let slot = self.admit(head.version, head.fingerprint, head.plan)?;
        let Some(ServedPlan { plan, kernel, checks, .. }) = self.plans[slot].as_deref() else {
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

        let of = (plan, kernel.as_deref());
        let answer = answer(of, &mut self.workspace, input, output, &mut self.by_kernel);
        if let Some(recorder) = &mut self.recorder {
            recorder.record(head, plan.query(), input, output, answer);
        }
        let Answer { status, warnings } = answer;
        Ok(Ran { status, warnings, n_out, is_private, checks })
    }
}

/// What was answered of a batch at once.
pub(crate) struct Tile<'a> {
    pub(crate) answers: &'a [Answer],
    /// The batch is answered whole.
    pub(crate) is_last: bool,
}

impl Engine {
    /// Checks a batch and answers the tile of it that begins at row `first`: as many states as its
    /// plan takes abreast. Why the batch has no answer where it has none. Never allocates, never
    /// panics; the rows of a tile are read once, and written when all of them are answered.
    pub(crate) fn answer_tile<'a>(
        &mut self,
        head: &BatchHead,
        first: usize,
        area: &ServedBatch,
        answers: &'a mut [Answer; MOST_ROWS],
    ) -> Result<Tile<'a>, Status> {
        let tile = self.run_tile(head, first, area, answers);
        if let (Err(status), Some(recorder)) = (&tile, &mut self.recorder) {
            recorder.record_refusal(&single(head), *status);
            recorder.commit();
        }
        tile
    }

    fn run_tile<'a>(
        &mut self,
        head: &BatchHead,
        first: usize,
        area: &ServedBatch,
        answers: &'a mut [Answer; MOST_ROWS],
    ) -> Result<Tile<'a>, Status> {
        // also of a tile that is not the first: its client may have released the plan meanwhile
        let slot = self.admit(head.version, head.fingerprint, head.plan)?;
        let Some(ServedPlan { plan, kernel, checks, .. }) = self.plans[slot].as_deref() else {
            return Err(Status::UnknownRequest);
        };
        if *checks {
            // there is none
            return Err(Status::CorruptAnswer);
        }
        let (n_in, n_out) = (plan.given().len(), plan.want().len());
        let shape = BatchShape::new(head.rows, n_in, n_out).ok_or(Status::WrongSize)?;

        // from the area and back to it
        let abreast = kernel.as_deref().map_or(1, NativeKernel::rows).max(plan.abreast());
        let rows = abreast.min(shape.rows().saturating_sub(first));
        let input = self.scratch.get_mut(..rows * n_in).ok_or(Status::WrongSize)?;
        let output = self.private.get_mut(..rows * n_out).ok_or(Status::WrongSize)?;
        let answers = answers.get_mut(..rows).ok_or(Status::WrongSize)?;
        area.read(&shape, first, input);
        match kernel.as_deref() {
            Some(kernel) => {
                let by_kernel =
                    kernel.answer_rows(plan, &mut self.workspace, input, output, answers);
                self.by_kernel += by_kernel as u64;
            }
            None => self.workspace.run(plan, input, output, answers),
        }
        area.write(&shape, first, answers, output);

        // each row as a request of its own
        if let Some(recorder) = &mut self.recorder {
            for (row, answer) in answers.iter().enumerate() {
                let (input, output) =
                    (&input[row * n_in..][..n_in], &output[row * n_out..][..n_out]);
                recorder.record(&single(head), plan.query(), input, output, *answer);
                recorder.commit_row();
            }
        }
        Ok(Tile { answers, is_last: first + rows >= shape.rows() })
    }
}

/// Answers one state, by its kernel where there is one and it does; the same bits by either.
#[inline]
fn answer(
    (plan, kernel): (&Plan, Option<&NativeKernel>),
    scratch: &mut BatchWorkspace,
    input: &[f64],
    output: &mut [f64],
    by_kernel: &mut u64,
) -> Answer {
    let (model, workspace) = scratch.one();
    let answer = kernel.and_then(|kernel| kernel.answer((model, plan), workspace, input, output));
    match answer {
        Some(answer) => {
            *by_kernel += 1;
            answer
        }
        None => plan.run(model, workspace, input, output),
    }
}

/// The head of a row of a batch.
fn single(head: &BatchHead) -> RequestHead {
    let BatchHead { version, plan, fingerprint, sequence, rows: _ } = *head;
    RequestHead { version, plan, fingerprint, sequence, ..RequestHead::default() }
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
