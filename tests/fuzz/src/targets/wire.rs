//! Arbitrary messages of a client: queries, which the server's planner takes, and calls, requests
//! and batches to a server in this process.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sarrus_client::describe;
use sarrus_dynamics::{Model, Plan, Workspace};
use sarrus_models::{Options, Source, load};
use sarrus_proto::batch::{BatchHead, BatchShape, ClaimedBatch};
use sarrus_proto::board::class_of;
use sarrus_proto::control::{
    Call, CallHead, ControlRequest, ControlResponse, Grant, Refusal, exchange,
};
use sarrus_proto::message::{
    MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS_OF_PROCESS, RequestHead, load_numbers,
};
use sarrus_proto::run::Link;
use sarrus_proto::service::{OpenedService, open_compute};
use sarrus_proto::socket::{ControlSocket, MAX_MESSAGE};
use sarrus_proto::{
    Answer, Domain, Field, FieldSet, MAX_FRAMES, MAX_WRENCHES, Node, PROTOCOL_VERSION, Query,
    Request, ServerName, Status, Warnings,
};
use sarrus_serve::{ServeOptions, Wait, serve};

use super::{Check, Target, law};

/// The robot of the server.
const ROBOT: &str = "r3_lambda_r";
/// Longest time to an answer.
const PATIENT: Duration = Duration::from_secs(20);

pub(super) const QUERY: Target = Target {
    name: "query",
    seeds,
    tokens: &[],
    start: || {
        let model = model()?;
        let mut workspace = Workspace::new(&model);
        let check: Check = Box::new(move |input| {
            let mut bytes = Bytes(input);
            let query = bytes.query();
            planned(&model, &mut workspace, &query, &mut bytes)
        });
        Ok(check)
    },
};

pub(super) const SERVER: Target = Target {
    name: "server",
    seeds,
    tokens: &[],
    start: || {
        let mut served = Served::start()?;
        let check: Check = Box::new(move |input| {
            let mut bytes = Bytes(input);
            match bytes.u8() % 4 {
                0 => served.call(&mut bytes),
                1 => served.garbage(&mut bytes),
                2 => served.request(&mut bytes),
                _ => served.batch(&mut bytes),
            }
        });
        Ok(check)
    },
};

/// Bytes of plausible messages: kinds of calls and requests with known fields.
fn seeds() -> Vec<Vec<u8>> {
    let numbers = [0.1_f64, -0.2, 0.0, f64::NAN, 1e308, 5e-324].map(f64::to_le_bytes).concat();
    let mut seeds = Vec::new();
    for kind in 0..8_u8 {
        for request in 1..=4_u8 {
            // the gate's five bytes, then request, counts and sets of fields
            let mut seed = vec![kind, kind >> 1, request, request, 2, 1];
            seed.extend(0x0040_0000_1009_u64.rotate_left(kind.into()).to_le_bytes());
            seed.extend(0x0000_0fff_8038_u64.rotate_left(request.into()).to_le_bytes());
            seed.extend([0, 1, 2, 3]);
            seed.extend(&numbers);
            seeds.push(seed);
        }
    }
    seeds
}

/// A reader of input bytes, with zeros after the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn u8(&mut self) -> u8 {
        match self.0.split_first() {
            Some((first, rest)) => {
                self.0 = rest;
                *first
            }
            None => 0,
        }
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes([(); 8].map(|()| self.u8()))
    }

    /// A value, which is usually `right`.
    fn or(&mut self, right: u64) -> u64 {
        if self.u8() < 224 { right } else { self.u64() }
    }

    /// A query with mostly valid parts.
    fn query(&mut self) -> Query {
        let request = self.u8();
        let request = if request < 250 { u32::from(request % 5) } else { self.u64() as u32 };
        let counts = [self.u8(), self.u8()];
        let [n_frames, n_wrenches] =
            counts.map(|n| if n < 240 { u16::from(n % 4) } else { u16::from(n) << 6 | 3 });
        let known = FieldSet::of(Field::ALL);
        let sets = [self.u64(), self.u64()].map(|set| FieldSet(u128::from(set)));
        let [given, want] = match self.u8() {
            0..240 => sets.map(|set| FieldSet(set.0 & known.0)),
            240..248 => sets,
            _ => sets.map(|set| FieldSet(set.0 << 64 | set.0)),
        };
        let mut query = Query { n_frames, n_wrenches, ..Query::new(Request::Map, given, want) };
        query.request = request;
        let mut link = || self.u8();
        let linked = |n: u8| if n < 250 { u16::from(n % 8) } else { u16::from(n) << 8 };
        (0..MAX_FRAMES.min(4)).for_each(|k| query.frames[k] = linked(link()));
        (0..MAX_WRENCHES.min(4)).for_each(|k| query.wrench_links[k] = linked(link()));
        if self.u8() >= 192 {
            query.n_joint_runs = u32::from(self.u8() % 40);
            (0..4).for_each(|k| query.joints[k] = [self.u8() % 8, self.u8() % 8].map(u16::from));
        }
        query
    }

    /// Numbers, most of them small.
    fn numbers(&mut self, n: usize) -> Vec<f64> {
        (0..n)
            .map(|_| match self.u8() {
                byte @ 0..224 => f64::from(byte) / 128.0 - 0.875,
                _ => f64::from_bits(self.u64()),
            })
            .collect()
    }
}

fn model() -> Result<Model<f64>, String> {
    load(&Source::Bundled(ROBOT.to_owned()), &Options::default())
        .map(|loaded| loaded.compiled.model)
        .map_err(|error| error.to_string())
}

/// A query is refused by its check or planned; a plan accepts any numbers.
fn planned(
    model: &Model<f64>,
    workspace: &mut Workspace<f64>,
    query: &Query,
    bytes: &mut Bytes<'_>,
) -> Result<u64, String> {
    let plan = match (query.check(model.info()), Plan::new(model, query)) {
        (Ok(_), Ok(plan)) => plan,
        (Err(why), Err(error)) if why == error => {
            return Ok(super::kind(&error.to_string()));
        }
        (checked, planned) => {
            let planned = planned.map(|_| ());
            return Err(format!("checked as {checked:?}, planned as {planned:?}: {query:?}"));
        }
    };
    let input = bytes.numbers(plan.given().len());
    let mut output = vec![0.0; plan.want().len()];
    let answer = plan.run(model, workspace, &input, &mut output);
    kept(plan.want(), answer.status, &output)?;

    // an answer does not depend on the request before it
    let mut again = vec![0.0; output.len()];
    let same = plan.run(model, workspace, &input, &mut again);
    let alike = output.iter().zip(&again).all(|(a, b)| a.to_bits() == b.to_bits());
    law(answer.status == same.status && alike, || {
        format!("{output:?} and then {again:?}: {input:?}, {query:?}")
    })?;
    Ok(answer.status as u64 ^ u64::from(query.request) << 8)
}

/// On failure every number is NaN, except in fields that survive one.
fn kept(layout: &sarrus_dynamics::Layout, status: Status, output: &[f64]) -> Result<(), String> {
    if status == Status::Ok {
        return Ok(());
    }
    for slot in layout.slots().iter().filter(|slot| !slot.field.survives_failure()) {
        let numbers = output.get(slot.range()).unwrap_or_default();
        law(numbers.iter().all(|number| number.is_nan()), || {
            format!("{} with {}: {numbers:?}", status.name(), slot.field.name())
        })?;
    }
    Ok(())
}

/// A server in this process and a client of its services.
struct Served {
    model: Model<f64>,
    workspace: Workspace<f64>,
    control: ControlSocket,
    compute: Box<dyn OpenedService>,
    area: ClaimedBatch,
    instance: u64,
    sequence: u64,
    plans: Vec<Query>,
    _node: Node,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl Served {
    fn start() -> Result<Served, String> {
        static COUNT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Relaxed);
        let name = format!("fuzz-{}-{count}", std::process::id());
        let loaded = load(&Source::Bundled(ROBOT.to_owned()), &Options::default())
            .map_err(|error| error.to_string())?;
        let info = describe(&loaded);
        let served = Arc::new(loaded.compiled.model);
        let options = ServeOptions {
            name: name.clone(),
            wait: Wait::Sleep,
            lanes: 2,
            ..ServeOptions::default()
        };
        let (stop, (ready, is_ready)) = (Arc::new(AtomicBool::new(false)), channel());
        let thread = {
            let stop = stop.clone();
            std::thread::spawn(move || {
                let started = ready.clone();
                let outcome = serve(served, &info, &options, &stop, move || {
                    let _ = started.send(Ok(()));
                });
                let _ = ready.send(outcome.map_err(|error| error.to_string()));
            })
        };
        is_ready.recv().map_err(|error| error.to_string())??;

        let words = |error: &dyn std::fmt::Display| error.to_string();
        let name = ServerName::new(&name).map_err(|error| words(&error))?;
        let domain = Domain::of_user().map_err(|error| words(&error))?;
        let folder = domain.server_folders(&name).next().ok_or("no folder")?;
        let control = ControlSocket::connect(&folder).map_err(|error| words(&error))?;
        let hello = ask(&control, &request_of(Call::Hello))?;
        let service = ask(&control, &request_of(Call::Service))?;
        let Ok(Grant::Service { link }) = service.outcome else {
            return Err(format!("no service: {service:?}"));
        };
        let link = Link::new(&domain, hello.instance, link).map_err(|error| words(&error))?;
        let node = link.node().map_err(|error| words(&error))?;
        let compute = open_compute(&node).map_err(|error| words(&error))?;
        ask(&control, &request_of(Call::Serve))?;
        let granted = exchange(&control, &request_of(Call::Batch), Instant::now() + PATIENT);
        let (_, memory) = granted.map_err(|error| format!("{error:?} to a call for an area"))?;
        let area = ClaimedBatch::open(&memory.ok_or("no area")?).map_err(|error| words(&error))?;
        let model = model()?;
        Ok(Served {
            workspace: Workspace::new(&model),
            model,
            control,
            compute,
            area,
            instance: hello.instance,
            sequence: 0,
            plans: Vec::new(),
            _node: node,
            stop,
            thread: Some(thread),
        })
    }

    /// A call is granted, or refused for the first reason that applies.
    fn call(&mut self, bytes: &mut Bytes<'_>) -> Result<u64, String> {
        let kind = bytes.u8() % 5;
        let [first, second] = [bytes.or(1), bytes.or(20)].map(|number| number as usize);
        let call = match kind {
            0 => Call::Hello,
            1 => Call::Model { page: first },
            2 => Call::Plan { query: Box::new(bytes.query()) },
            // the existing batch area
            3 => Call::Batch,
            // a granted lane or service would replace the one that requests go through
            _ if class_of(first).and(class_of(second)).is_some() => Call::Statistics,
            _ => Call::Lane { n_in: first, n_out: second },
        };
        let head = CallHead { version: bytes.or(PROTOCOL_VERSION.into()) as u32, nonce: 7 };
        let fingerprint = bytes.or(self.model.fingerprint());
        let request = ControlRequest { head, fingerprint, call };
        let response = ask(&self.control, &request)?;
        let about = |words: &str| format!("{words}: {:?} for {request:?}", response.outcome);

        // the head of a response is that of this server for every call
        let found = (response.version, response.fingerprint, response.instance);
        let right = (PROTOCOL_VERSION, self.model.fingerprint(), self.instance);
        law(found == right, || about("another head"))?;

        // version and fingerprint are checked first
        let gate = if head.version != PROTOCOL_VERSION {
            Some(Refusal::WrongVersion)
        } else if ![0, self.model.fingerprint()].contains(&fingerprint) {
            Some(Refusal::WrongModel)
        } else {
            None
        };
        match (gate, &request.call) {
            (Some(gate), _) => {
                law(response.outcome == Err(gate), || about("another reason"))?;
            }
            (None, Call::Plan { query }) => self.check_plan(query, &response.outcome)?,
            (None, Call::Lane { .. }) => {
                let large = matches!(response.outcome, Err(Refusal::TooLarge { .. }));
                law(large, || about("such a lane"))?;
            }
            (None, Call::Batch) => {
                law(response.outcome == Ok(Grant::Batch), || about("no area"))?;
            }
            (None, _) => {}
        }
        Ok(u64::from(kind) << 8 | u64::from(response.outcome.is_err()))
    }

    /// A garbled message is answered and has no effect.
    fn garbage(&mut self, bytes: &mut Bytes<'_>) -> Result<u64, String> {
        let call = if bytes.u8().is_multiple_of(2) { Call::Statistics } else { Call::Batch };
        let mut message = ControlRequest::to_bytes(&request_of(call));
        for _ in 0..=bytes.u8() % 4 {
            let place = bytes.u64() as usize % message.len();
            message[place] = bytes.u8();
        }
        let read = ControlRequest::from_bytes(&message);
        self.control.send(&message, None).map_err(|error| error.to_string())?;
        let mut buffer = vec![0; MAX_MESSAGE];
        let since = Instant::now();
        let answered = self.control.wait(since + PATIENT).map_err(|error| error.to_string())?;
        law(answered, || format!("no answer to {}", String::from_utf8_lossy(&message)))?;
        let received = self.control.receive(&mut buffer).map_err(|error| error.to_string())?;
        let length = received.map_or(0, |(length, _)| length);
        let response = ControlResponse::from_bytes(&buffer[..length]).ok_or("no answer of ours")?;
        let (_, refusal) = match read {
            Ok(_) => return Ok(1),
            Err(refused) => refused,
        };
        law(response.outcome == Err(refusal), || format!("another reason: {response:?}"))?;
        Ok(2)
    }

    /// A query is registered with the sizes of its plan, and an equal query gets the same number.
    fn check_plan(
        &mut self,
        query: &Query,
        outcome: &Result<Grant, Refusal>,
    ) -> Result<(), String> {
        let about = |words: &str| format!("{words}: {outcome:?} for {query:?}");
        let sizes =
            Plan::new(&self.model, query).map(|plan| (plan.given().len(), plan.want().len()));
        match (sizes, outcome) {
            (Err(_), Err(Refusal::BadQuery { reason })) => {
                law(!reason.is_empty(), || about("no reason"))
            }
            (Ok((given, want)), Err(Refusal::TooLarge { .. })) => {
                law(given > MAX_NUMBERS_IN || want > MAX_NUMBERS_OUT, || about("it is not"))
            }
            (Ok(_), Err(Refusal::TooManyPlans)) => {
                law(self.plans.len() == MAX_PLANS_OF_PROCESS, || about("there is room"))
            }
            (Ok((given, want)), Ok(Grant::Plan { number, n_in, n_out })) => {
                law([*n_in, *n_out] == [given, want], || about("other sizes"))?;
                let number = number.0 as usize;
                if number == self.plans.len() {
                    self.plans.push(*query);
                }
                law(self.plans.get(number) == Some(query), || about("another plan's number"))
            }
            _ => Err(about("planned here and not there")),
        }
    }

    /// A request through the service is answered with its own number and the right status.
    fn request(&mut self, bytes: &mut Bytes<'_>) -> Result<u64, String> {
        self.sequence += 1;
        let plan = bytes.u8() as usize % (self.plans.len() + 1);
        let head = RequestHead {
            version: bytes.or(PROTOCOL_VERSION.into()) as u32,
            plan: bytes.or(plan as u64) as u32,
            fingerprint: bytes.or(self.model.fingerprint()),
            sequence: self.sequence,
            ..RequestHead::default()
        };
        let numbers = bytes.numbers(64);
        self.compute.cancel();
        law(self.compute.send(&head, &numbers), || "the server takes no request".to_owned())?;
        let since = Instant::now();
        loop {
            let received = self.compute.poll().map_err(|error| format!("{error:?}"))?;
            if let Some((answer, words)) = received {
                let mut numbers = vec![0.0; words.len()];
                load_numbers(words, &mut numbers);
                let about = |words: &str| format!("{words}: {:?} to {head:?}", answer);
                law(answer.sequence == head.sequence, || about("another number"))?;
                let status = Status::from_code(answer.status);
                let status = status.ok_or_else(|| about("an unknown status"))?;
                let known = Warnings(answer.warnings).names().count() as u32;
                law(answer.warnings.count_ones() == known, || about("warnings"))?;
                let plan = self.plans.get(head.plan as usize);
                let gate = if head.version != PROTOCOL_VERSION {
                    Some(Status::BadRequest)
                } else if head.fingerprint != self.model.fingerprint() {
                    Some(Status::WrongModel)
                } else if plan.is_none() {
                    Some(Status::UnknownRequest)
                } else {
                    None
                };
                law(gate.is_none_or(|gate| gate == status), || about("another status"))?;
                if let (None, Some(query)) = (gate, plan) {
                    let plan = Plan::new(&self.model, query).map_err(|error| error.to_string())?;
                    kept(plan.want(), status, &numbers)?;
                }
                return Ok(1 << 40 | status as u64);
            }
            law(since.elapsed() < PATIENT, || format!("no answer to {head:?}"))?;
            std::thread::sleep(Duration::from_micros(50));
        }
    }

    /// A batch is answered with its own number: with the reason why it is refused, or with the rows
    /// that the kernels compute here.
    fn batch(&mut self, bytes: &mut Bytes<'_>) -> Result<u64, String> {
        self.sequence += 1;
        let plan = bytes.u8() as usize % (self.plans.len() + 1);
        let rows = bytes.u8();
        let head = BatchHead {
            version: bytes.or(PROTOCOL_VERSION.into()) as u32,
            plan: bytes.or(plan as u64) as u32,
            fingerprint: bytes.or(self.model.fingerprint()),
            sequence: self.sequence,
            rows: if rows < 240 { u64::from(rows % 40) } else { bytes.u64() >> ((rows - 240) * 4) },
        };
        let plan = self.plans.get(head.plan as usize).map(|query| Plan::new(&self.model, query));
        let plan = plan.transpose().map_err(|error| error.to_string())?;
        let (n_in, n_out) =
            plan.as_ref().map_or((1, 1), |plan| (plan.given().len(), plan.want().len()));
        let shape = BatchShape::new(head.rows, n_in, n_out);
        let place = shape.or(BatchShape::new(1, n_in, n_out)).ok_or("no room for a row")?;
        let input = bytes.numbers(place.rows() * n_in);
        self.area.send(&head, &place, &input);
        let since = Instant::now();
        let status = loop {
            if let Some(status) = self.area.answer(head.sequence) {
                break status;
            }
            law(since.elapsed() < PATIENT, || format!("no answer to {head:?}"))?;
            std::thread::sleep(Duration::from_micros(50));
        };

        let expected = match (&plan, shape) {
            _ if head.version != PROTOCOL_VERSION => Status::BadRequest,
            _ if head.fingerprint != self.model.fingerprint() => Status::WrongModel,
            (None, _) => Status::UnknownRequest,
            (_, None) => Status::WrongSize,
            _ => Status::Ok,
        };
        law(status == expected as u32, || format!("{status} to {head:?}"))?;
        if let (Some(plan), Some(shape), Status::Ok) = (&plan, shape, expected) {
            let failed = Answer { status: Status::UnknownStatus, warnings: Warnings::NONE };
            let mut answers = vec![failed; shape.rows()];
            let mut output = vec![0.0; shape.rows() * n_out];
            let mut here = vec![0.0; n_out];
            self.area.read(&shape, &mut answers, &mut output);
            for (row, answer) in answers.iter().enumerate() {
                let input = &input[row * n_in..][..n_in];
                let output = &output[row * n_out..][..n_out];
                let expected = plan.run(&self.model, &mut self.workspace, input, &mut here);
                let same =
                    |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                let alike = *answer == expected && output.iter().zip(&here).all(same);
                law(alike, || format!("{answer:?}, {output:?} to row {row} of {head:?}"))?;
            }
        }
        Ok(1 << 41 | u64::from(status))
    }
}

fn request_of(call: Call) -> ControlRequest {
    let head = CallHead { version: PROTOCOL_VERSION, nonce: 1 };
    ControlRequest { head, fingerprint: 0, call }
}

/// Sends a call and returns the answer.
fn ask(socket: &ControlSocket, request: &ControlRequest) -> Result<ControlResponse, String> {
    let response = exchange(socket, request, Instant::now() + PATIENT);
    response.map(|(response, _)| response).map_err(|error| format!("{error:?} to {request:?}"))
}
