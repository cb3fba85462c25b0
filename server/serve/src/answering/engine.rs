//! Turns an unchecked request into its answer: checks of the head, the plan, the kernel.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rtrb::{Consumer, Producer, PushError};
use sarrus_dynamics::{BatchWorkspace, CUT_SHORT, MOST_ROWS, Model, Plan};
use sarrus_proto::batch::{BatchHead, BatchShape, ServedBatch};
use sarrus_proto::checksum::of_request;
use sarrus_proto::message::{
    ComputeRequest, MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, PlanNumber, RequestHead,
    ResponseHead, store_numbers,
};
use sarrus_proto::{Answer, PROTOCOL_VERSION, Status, Warnings};

use crate::answering::aside::{Aside, Key, Look};
use crate::answering::timing::{RequestTiming, is_late};
use crate::kernels::NativeKernel;
use crate::record::{Client, Recorder};

/// A plan as the answering thread holds it.
pub(crate) struct ServedPlan {
    pub(crate) number: PlanNumber,
    pub(crate) plan: Arc<Plan>,
    /// Answers most states faster, with the same bits.
    pub(crate) kernel: Option<Arc<NativeKernel>>,
    /// Requests and answers have a checksum.
    pub(crate) checks: bool,
}

/// An order of the maintenance thread about a plan; at most three for each slot are pending.
pub(crate) enum PlanOrder {
    /// Answer requests for this plan from now on.
    Serve(Box<ServedPlan>),
    /// Answer with this kernel from now on. The maintenance thread keeps a reference too, so
    /// dropping this one unloads nothing.
    Kernel(PlanNumber, Arc<NativeKernel>),
    /// Return the plan.
    Retire(PlanNumber),
}

/// The capacity of the channel of plan orders.
pub(crate) const MAX_PLAN_ORDERS: usize = 3 * MAX_PLANS;

/// The place of a request's numbers; a client may still be writing those of the service.
pub(crate) enum Input<'a> {
    /// The copy that the lane made.
    Copied(&'a [f64]),
    /// Shared memory, read once.
    Shared(&'a ComputeRequest),
}

/// Plans, workspace and buffers of the answering thread.
pub(crate) struct Engine {
    /// Indexed by slot.
    plans: Box<[Option<Box<ServedPlan>>]>,
    orders: Consumer<PlanOrder>,
    retired: Producer<Box<ServedPlan>>,
    workspace: BatchWorkspace,
    scratch: Vec<f64>,
    /// Private buffer for answers with a checksum, recorded answers and those of batches: other
    /// processes can write to their destination.
    private: Vec<f64>,
    /// Threads for states that need more than a turn: up to the bound of a request, and of any
    /// length. Without them every state is computed here.
    aside: Option<[Aside; 2]>,
    /// A state of this sweep took its turn without an answer.
    pub(crate) cut_short: bool,
    /// Copies requests and answers, with `--record`.
    pub(crate) recorder: Option<Recorder>,
    /// Answers by generated kernels.
    pub(crate) by_kernel: u64,
}

/// The outcome of a plan.
struct Outcome {
    status: Status,
    warnings: Warnings,
    n_out: usize,
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
        Engine {
            plans,
            orders,
            retired,
            workspace,
            scratch,
            private,
            aside: None,
            cut_short: false,
            recorder: None,
            by_kernel: 0,
        }
    }

    /// Hands states that need more than a turn to these threads from now on: for states up to the
    /// bound of a request, and for searches.
    pub(crate) fn set_aside(&mut self, threads: [Aside; 2]) {
        self.aside = Some(threads);
        self.workspace.answer_in_turns();
    }

    /// Takes new plans and returns old ones; never blocks.
    pub(crate) fn handle_orders(&mut self) {
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
                    // there is room for every plan, so this cannot fail; otherwise the plan would
                    // stay
                    if let Err(PushError::Full(served)) = self.retired.push(served) {
                        self.plans[number.slot()] = Some(served);
                    }
                }
            }
        }
    }

    /// True if the plan exists; fetches one that was just registered.
    #[inline]
    fn has(&mut self, number: PlanNumber) -> bool {
        let is_there = |plans: &[Option<Box<ServedPlan>>]| {
            plans[number.slot()].as_ref().is_some_and(|served| served.number == number)
        };
        is_there(&self.plans) || {
            self.handle_orders();
            is_there(&self.plans)
        }
    }

    /// Notes the client of the next request and its time `[tick]`, for the recording.
    #[inline]
    pub(crate) fn found(&mut self, ticks: u64, client: Client) {
        if let Some(recorder) = &mut self.recorder {
            recorder.take(ticks, client);
        }
    }

    /// Passes on the record of an answer, once the answer is published.
    #[inline]
    pub(crate) fn sent(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.commit();
        }
    }

    /// Checks a request, runs its plan from `input` into `output`, and returns the head of the
    /// answer, with times and checksum where the request has them; `None` while another thread
    /// computes it, then call it again. Never allocates, never panics, and touches nothing outside
    /// `input` and `output`. A refused or late request leaves NaN.
    #[inline]
    pub(crate) fn answer_request(
        &mut self,
        head: &RequestHead,
        place: usize,
        input: Input<'_>,
        output: &[AtomicU64],
        timing: &RequestTiming<'_>,
    ) -> Option<ResponseHead> {
        let outcome = match timing.is_late() {
            true => Err(Status::Late),
            false => self.run_plan(head, place, input, output.len()),
        };
        match outcome {
            Ok(None) => None,
            Ok(Some(Outcome { status, warnings, n_out, checks })) => {
                let numbers = &self.private[..n_out];
                store_numbers(output, numbers);
                // without a checksum, even if the request has one: it was meant for another plan
                let answer = ResponseHead::new(status, warnings, head.sequence);
                let answer = timing.close(answer, checks.then_some(numbers));
                Some(match is_late(head, &answer) {
                    true => self.refused(head, Status::Late, output, timing),
                    false => answer,
                })
            }
            Err(status) => Some(self.refused(head, status, output, timing)),
        }
    }

    /// The head of a refusal, which is on record instead of an answer.
    #[cold]
    fn refused(
        &mut self,
        head: &RequestHead,
        status: Status,
        output: &[AtomicU64],
        timing: &RequestTiming<'_>,
    ) -> ResponseHead {
        if let Some(recorder) = &mut self.recorder {
            recorder.record_refusal(head, status);
        }
        refuse(head, status, output, timing)
    }

    /// Ends a sweep; true if the answer of a thread, or its next state, waits for a client.
    #[inline]
    pub(crate) fn end_sweep(&mut self) -> bool {
        let threads = self.aside.iter_mut().flatten();
        threads.fold(false, |awaits, thread| thread.end_sweep() | awaits)
    }

    /// Checks the head of a request; the slot of its plan.
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

    /// Runs the plan of a request into `private`; its numbers must not exceed `room`.
    #[inline]
    fn run_plan(
        &mut self,
        head: &RequestHead,
        place: usize,
        input: Input<'_>,
        room: usize,
    ) -> Result<Option<Outcome>, Status> {
        let slot = self.admit(head.version, head.fingerprint, head.plan)?;
        let Some(ServedPlan { plan, kernel, checks, .. }) = self.plans[slot].as_deref() else {
            return Err(Status::UnknownRequest);
        };

        // the counts are the plan's; a lane may be too small for another client's plan
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let checks = *checks;
        let output = self.private.get_mut(..n_out).filter(|_| n_out <= room);
        let output = output.ok_or(Status::WrongSize)?;
        let input = match input {
            Input::Copied(numbers) => numbers.get(..n_in).ok_or(Status::WrongSize)?,
            Input::Shared(request) => {
                let scratch = self.scratch.get_mut(..n_in).ok_or(Status::WrongSize)?;
                request.read(scratch);
                scratch
            }
        };

        // the numbers are the ones that the client sent
        if checks && of_request(head, input) != head.checksum {
            return Err(Status::CorruptAnswer);
        }

        let key = Key { place, plan: PlanNumber(head.plan), sequence: head.sequence, row: None };
        let look = match &mut self.aside {
            Some(threads) => thread_of(threads, plan).look(key, plan, input),
            None => Look::Nothing,
        };
        let answer = match look {
            Look::Answered(answer, numbers) => {
                output.copy_from_slice(numbers);
                answer
            }
            Look::Waits => return Ok(None),
            Look::Nothing => {
                let of = (&**plan, kernel.as_deref());
                let answer = compute(of, &mut self.workspace, input, output, &mut self.by_kernel);
                if let Some(threads) = &mut self.aside
                    && plan.is_cut_short(self.workspace.one().1, answer.status)
                {
                    thread_of(threads, plan).submit(key, plan, input);
                    self.cut_short = true;
                    return Ok(None);
                }
                answer
            }
        };
        if let Some(recorder) = &mut self.recorder {
            recorder.record(head, plan.query(), input, output, answer);
        }
        let Answer { status, warnings } = answer;
        Ok(Some(Outcome { status, warnings, n_out, checks }))
    }
}

/// The outcome of one tile of a batch.
pub(crate) struct Tile<'a> {
    pub(crate) answers: &'a [Answer],
    /// The whole batch is answered.
    pub(crate) is_last: bool,
}

impl Engine {
    /// Checks a batch and answers the tile of it that begins at row `first`: as many states as its
    /// plan computes together, or those before one that needs more than a turn; `None` while
    /// another thread computes the first one. The error is the status of a refused batch. Never
    /// allocates, never panics; the rows of a tile are read once, and written when all of them are
    /// answered.
    pub(crate) fn answer_tile<'a>(
        &mut self,
        head: &BatchHead,
        (place, first): (usize, usize),
        area: &ServedBatch,
        answers: &'a mut [Answer; MOST_ROWS],
    ) -> Result<Option<Tile<'a>>, Status> {
        let tile = self.run_tile(head, (place, first), area, answers);
        if let (Err(status), Some(recorder)) = (&tile, &mut self.recorder) {
            recorder.record_refusal(&single(head), *status);
            recorder.commit();
        }
        tile
    }

    fn run_tile<'a>(
        &mut self,
        head: &BatchHead,
        (place, first): (usize, usize),
        area: &ServedBatch,
        answers: &'a mut [Answer; MOST_ROWS],
    ) -> Result<Option<Tile<'a>>, Status> {
        // also for later tiles: the client may have released the plan meanwhile
        let slot = self.admit(head.version, head.fingerprint, head.plan)?;
        let Some(ServedPlan { plan, kernel, checks, .. }) = self.plans[slot].as_deref() else {
            return Err(Status::UnknownRequest);
        };
        if *checks {
            // there is none
            return Err(Status::CorruptAnswer);
        }
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let shape = BatchShape::new(head.rows, n_in, n_out).ok_or(Status::WrongSize)?;

        // from the area and back to it
        let abreast = kernel.as_deref().map_or(1, NativeKernel::rows).max(plan.abreast());
        let rows = abreast.min(shape.rows().saturating_sub(first));
        let input = self.scratch.get_mut(..rows * n_in).ok_or(Status::WrongSize)?;
        let output = self.private.get_mut(..rows * n_out).ok_or(Status::WrongSize)?;
        let answers = answers.get_mut(..rows).ok_or(Status::WrongSize)?;
        area.read(&shape, first, input);
        let row = Some(first);
        let key = Key { place, plan: PlanNumber(head.plan), sequence: head.sequence, row };
        let look = match &mut self.aside {
            Some(threads) if rows > 0 => thread_of(threads, plan).look(key, plan, &input[..n_in]),
            _ => Look::Nothing,
        };
        let rows = match look {
            Look::Waits => return Ok(None),
            Look::Answered(answer, numbers) => {
                output[..n_out].copy_from_slice(numbers);
                answers[0] = answer;
                1
            }
            Look::Nothing => {
                let (rows, by_kernel) = match kernel.as_deref() {
                    Some(kernel) => {
                        kernel.answer_rows(plan, &mut self.workspace, input, output, answers)
                    }
                    None => (self.workspace.run(plan, input, output, answers), 0),
                };
                self.by_kernel += by_kernel as u64;
                // the last one may need more
                let last = answers[..rows].last().map_or(Status::Ok, |answer| answer.status);
                let is_cut_short = plan.is_cut_short(self.workspace.one().1, last);
                match &mut self.aside {
                    Some(threads) if is_cut_short => {
                        let before = rows - 1;
                        let key = Key { row: Some(first + before), ..key };
                        let input = &input[before * n_in..][..n_in];
                        thread_of(threads, plan).submit(key, plan, input);
                        self.cut_short = true;
                        if before == 0 {
                            return Ok(None);
                        }
                        before
                    }
                    _ => rows,
                }
            }
        };
        let answers = &mut answers[..rows];
        let output = &mut output[..rows * n_out];
        area.write(&shape, first, answers, output);

        if let Some(recorder) = &mut self.recorder {
            record_rows(recorder, head, plan, input, output, answers);
        }
        Ok(Some(Tile { answers, is_last: first + rows >= shape.rows() }))
    }
}

/// The thread for the states of a plan that need more than a turn.
fn thread_of<'a>(threads: &'a mut [Aside; 2], plan: &Plan) -> &'a mut Aside {
    &mut threads[usize::from(plan.is_long())]
}

/// Computes one answer, by the generated kernel if it answers, else by the plan; the bits are
/// equal.
#[inline]
fn compute(
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
        // the plan would take another turn to end there
        None if kernel.is_some() && plan.spent_turn(workspace) => CUT_SHORT,
        None => plan.run(model, workspace, input, output),
    }
}

/// Copies answered rows of a batch, each as a separate request.
fn record_rows(
    recorder: &mut Recorder,
    head: &BatchHead,
    plan: &Plan,
    input: &[f64],
    output: &[f64],
    answers: &[Answer],
) {
    let n_in = plan.given().len();
    let n_out = plan.want().len();
    for (row, answer) in answers.iter().enumerate() {
        let input = &input[row * n_in..][..n_in];
        let output = &output[row * n_out..][..n_out];
        recorder.record(&single(head), plan.query(), input, output, *answer);
        recorder.commit_row();
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
    output: &[AtomicU64],
    timing: &RequestTiming<'_>,
) -> ResponseHead {
    output.iter().for_each(|word| word.store(f64::NAN.to_bits(), Relaxed));
    timing.close(ResponseHead::new(status, Warnings::NONE, head.sequence), Some(&[]))
}
