//! A run of the server: start, upkeep beside the answering thread, end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use quanta::Clock;
use rtrb::RingBuffer;
use rustix::process::{Resource, getrlimit, setrlimit};
use sarrus_dynamics::Model;
use sarrus_proto::heartbeat::HeartbeatWriter;
use sarrus_proto::message::{MAX_PLANS, Statistics};
use sarrus_proto::run::{Run, RunError};
use sarrus_proto::{Domain, ModelInfo, ServerName};

use crate::bus_guard;
use crate::connections::Connections;
use crate::control::{Control, pages};
use crate::counters::{Counters, Latency};
use crate::engine::Engine;
use crate::error::{MAX_LANES, ServeError};
use crate::events;
use crate::hot::{self, Hot, Shared};
use crate::kernels::{Kernels, Maker};
use crate::placement::{Flags, Placement};
use crate::plans::{MAX_ORDERS, Plans};
use crate::pool;
use crate::pulse::Pulse;
use crate::record::{self, RecordOptions};
use crate::wait::Wait;

/// How to serve.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Name under which clients find the server.
    pub name: String,
    /// How to wait for requests.
    pub wait: Wait,
    /// How many clients can have a lane at one time.
    pub lanes: usize,
    /// Generated kernels for the plans of clients.
    pub kernels: Kernels,
    /// Where the last seconds are recorded, if anywhere.
    pub record: Option<RecordOptions>,
    /// The processor of the answering thread; all other threads leave it.
    pub cpu: Option<usize>,
    /// Priority of the answering thread under SCHED_FIFO, 1 to 99.
    pub priority: Option<u8>,
    /// Whether memory is locked, so that the answering thread meets no page fault.
    pub lock_memory: bool,
}

impl Default for ServeOptions {
    fn default() -> ServeOptions {
        ServeOptions {
            name: "default".to_owned(),
            wait: Wait::auto(),
            lanes: 16,
            kernels: Kernels::default(),
            record: None,
            cpu: None,
            priority: None,
            lock_memory: false,
        }
    }
}

impl ServeOptions {
    /// Refuses, before anything is loaded, what cannot work in this process.
    ///
    /// # Errors
    /// [`ServeError`]; nothing is changed.
    pub fn check(&self) -> Result<(), ServeError> {
        self.placement().map(drop)
    }

    /// Where the threads belong, once all options were found to work.
    fn placement(&self) -> Result<Placement, ServeError> {
        if self.lanes > MAX_LANES {
            return Err(ServeError::TooManyLanes { found: self.lanes });
        }
        let &ServeOptions { cpu, priority, lock_memory, wait, .. } = self;
        Ok(Placement::new(Flags { cpu, priority, lock_memory, busy: wait == Wait::Busy })?)
    }
}

/// Serves a model until `stop` is set; calls `ready` once clients can attach.
///
/// This thread answers the control socket and makes and retires lanes and services; a thread of its
/// own answers requests.
///
/// # Errors
/// [`ServeError`]; whatever it is, nothing is left in shared memory.
pub fn serve(
    model: Arc<Model<f64>>,
    info: &ModelInfo,
    options: &ServeOptions,
    stop: &AtomicBool,
    ready: impl FnOnce(),
) -> Result<(), ServeError> {
    let placement = options.placement()?;
    let _locked = placement.lock_memory()?;
    let name = ServerName::new(&options.name)?;
    let domain = Domain::of_user()?;
    let outcome = run(&domain, &name, model, info, options, &placement, stop, ready);
    domain.tidy();
    outcome
}

fn run(
    domain: &Domain,
    name: &ServerName,
    model: Arc<Model<f64>>,
    info: &ModelInfo,
    options: &ServeOptions,
    placement: &Placement,
    stop: &AtomicBool,
    ready: impl FnOnce(),
) -> Result<(), ServeError> {
    bus_guard::install().map_err(ServeError::Guard)?;
    allow_descriptors();
    // the lock of the name is what makes this server the only one of it
    let run = take_name(domain, name)?;

    // the answering thread
    let places = Connections::places(options.lanes);
    let counters = Counters::new(places);
    let shared = Arc::new(Shared { counters, stopping: AtomicBool::new(false) });
    let (plan_orders_in, plan_orders) = RingBuffer::new(MAX_ORDERS);
    let (retired_plans, retired_plans_out) = RingBuffer::new(MAX_PLANS);
    let (orders_in, orders) = RingBuffer::new(hot::MAX_ORDERS * places);
    let (retired, retired_out) = RingBuffer::new(hot::MAX_RETIRED * places);
    let heartbeat = HeartbeatWriter::new().map_err(ServeError::Heartbeat)?;
    let heartbeat_reader = heartbeat.reader_descriptor().map_err(ServeError::Heartbeat)?;
    let clock = Clock::new();
    let mut engine = Engine::new(model.clone(), plan_orders, retired_plans);
    let recording = options.record.as_ref();
    let recording = recording.map(|to| {
        let placement = placement.clone();
        // where it cannot leave the answering thread's processor it shares it
        let place = move || drop(placement.place_other());
        record::start(to, &model, options.lanes, clock.clone(), place)
    });
    let recording = recording.transpose()?.map(|(recorder, thread)| {
        engine.recorder = Some(recorder);
        thread
    });
    let hot = Hot {
        engine,
        ends: Vec::with_capacity(2 * places),
        next: 0,
        orders,
        retired,
        heartbeat,
        shared: shared.clone(),
        clock: clock.clone(),
        wait: options.wait,
    };
    let kernels = {
        let placement = placement.clone();
        let place = move || drop(placement.place_other());
        Maker::start(&options.kernels, &model, place)?
    };
    // whoever connects before the end of this function waits
    let socket = |source| ServeError::Socket { path: run.name_folder().to_owned(), source };
    let listener = run.listen().map_err(socket)?;
    let latency = Latency::new(clock).ok_or(ServeError::Died)?;
    let thread = spawn(hot, placement.clone())?;
    if let Err(error) = placement.place_other() {
        shared.stopping.store(true, Relaxed);
        let _ = thread.join();
        return Err(error.into());
    }

    // upkeep
    let connections = Connections::new(listener, options.lanes, orders_in, retired_out);
    let control = Control {
        root: domain.root().to_string_lossy().into_owned(),
        connections,
        model,
        plans: Plans::new(plan_orders_in, retired_plans_out, kernels),
        pages: pages(&String::from_utf8_lossy(&info.to_json())),
        fingerprint: info.fingerprint,
        heartbeat: heartbeat_reader,
        buffer: Vec::new(),
        run,
    };
    let now = Instant::now();
    let pulse = Pulse::new(&control.heartbeat).map_err(ServeError::Heartbeat)?;
    let mut upkeep = Upkeep {
        control,
        latency,
        shared: shared.clone(),
        pulse,
        since: now,
        folded: now,
        checked: now,
        late: 0,
    };
    ready();
    events::serving(name.as_str(), &info.robot, info.fingerprint, options.lanes);
    while !stop.load(Relaxed) && !thread.is_finished() {
        upkeep.step(stop, false);
        if upkeep.pulse.is_lost() {
            // a thread that hangs cannot be ended: the process is, and its clients know at once
            events::hung(name.as_str());
            return Err(ServeError::Hung);
        }
    }

    // the end: refuse what still comes, then take everything down in order
    events::stopping(name.as_str());
    shared.stopping.store(true, Relaxed);
    while !thread.is_finished() {
        upkeep.step(stop, true);
        if upkeep.pulse.is_lost() {
            return Err(ServeError::Hung);
        }
    }
    let ended = thread.join();
    upkeep.control.plans.stop();
    // what was answered is written
    recording.map(JoinHandle::join);
    if ended.is_ok() && stop.load(Relaxed) { Ok(()) } else { Err(ServeError::Died) }
}

/// How long a name is asked for.
const TAKE: Duration = Duration::from_millis(300);

/// Takes the name. A server that ended just now may still be going, and somebody may be clearing
/// up: the name is asked for again and again.
fn take_name(domain: &Domain, name: &ServerName) -> Result<Run, ServeError> {
    let start = Instant::now();
    loop {
        match Run::start(domain, name) {
            Ok(run) => return Ok(run),
            Err(RunError::Taken) if start.elapsed() < TAKE => {}
            Err(RunError::Taken) => {
                return Err(ServeError::NameTaken { name: name.as_str().to_owned() });
            }
            Err(RunError::Folder { path, source }) => {
                return Err(ServeError::Folder { path, source });
            }
            Err(RunError::Domain(error)) => return Err(error.into()),
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// As many descriptors as this process may have: each client takes about a dozen.
fn allow_descriptors() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // where that is refused fewer clients can come, and the next one hears why
    let _ = setrlimit(Resource::Nofile, limit);
}

/// Starts the answering thread where it belongs.
fn spawn(mut hot: Hot, placement: Placement) -> Result<JoinHandle<()>, ServeError> {
    let (started, outcome) = mpsc::channel();
    let body = move || {
        let placed = placement.place_answering();
        let is_placed = placed.is_ok();
        let _ = started.send(placed);
        if is_placed {
            let adopted = pool::adopt_thread();
            hot.run();
            // taking ports down is the system allocator's again
            drop(adopted);
        }
    };
    // entries of large lanes pass over the stack
    let builder = std::thread::Builder::new().name("sarrus-hot".to_owned()).stack_size(16 << 20);
    let thread = builder.spawn(body).map_err(|source| ServeError::Thread { source })?;
    outcome.recv().map_err(|_| ServeError::Died)??;
    Ok(thread)
}

/// What happens beside the answering thread.
struct Upkeep {
    control: Control,
    latency: Latency,
    shared: Arc<Shared>,
    pulse: Pulse,
    since: Instant,
    folded: Instant,
    checked: Instant,
    /// Late answers that were logged.
    late: u64,
}

/// The longest wait for clients.
const WAIT: Duration = Duration::from_millis(20);
/// Between two looks at the counters of latency.
const FOLD: Duration = Duration::from_millis(50);
/// Between two looks whether clients can find the server.
const CHECK: Duration = Duration::from_secs(1);

impl Upkeep {
    /// Waits for clients, answers one call of each that speaks, and does what else is due.
    fn step(&mut self, stop: &AtomicBool, stopping: bool) {
        let wait = if stopping { Duration::from_millis(1) } else { WAIT };
        self.pulse.feel();
        for client in self.control.connections.wait(wait) {
            // a stop does not wait for a crowd
            if stop.load(Relaxed) && !stopping {
                return;
            }
            let (latency, shared, since) = (&mut self.latency, &self.shared, self.since);
            self.control.answer(client, stopping, |control| {
                latency.fold(&shared.counters);
                statistics(control, latency, shared, since)
            });
        }
        self.control.connections.collect();
        self.control.plans.upkeep();
        let now = Instant::now();
        if now - self.folded > FOLD {
            self.folded = now;
            self.latency.fold(&self.shared.counters);
        }
        if now - self.checked > CHECK {
            self.checked = now;
            self.restore();
            self.log_late();
        }
    }

    /// Logs how many answers were late since the last look.
    fn log_late(&mut self) {
        let late = self.shared.counters.counts().late;
        if late > self.late {
            events::late(late - self.late);
            self.late = late;
        }
    }

    /// Makes folders and socket again where somebody cleared them away.
    fn restore(&mut self) {
        let Control { run, connections, .. } = &mut self.control;
        run.restore();
        let listener = connections.listener_mut();
        if !listener.is_reachable(run.name_folder())
            && let Ok(fresh) = run.listen()
        {
            *listener = fresh;
        }
    }
}

fn statistics(control: &Control, latency: &Latency, shared: &Shared, since: Instant) -> Statistics {
    let pool = pool::counts();
    let connections = &control.connections;
    Statistics {
        uptime: since.elapsed().as_secs_f64(),
        counts: shared.counters.counts(),
        latency_ns: latency.percentiles(),
        lanes_taken: connections.lanes_taken() as u64,
        lanes: connections.n_lanes() as u64,
        lanes_made: connections.lanes_made(),
        plans: control.plans.len() as u64,
        system_allocations: pool.system,
        pool_allocations: pool.pool,
        process: std::process::id().into(),
        clients: connections
            .clients(|client| control.plans.held(client), |place| shared.counters.late_of(place)),
    }
}
