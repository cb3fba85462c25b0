//! A run of the server: start, upkeep, end.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use quanta::Clock;
use rtrb::{Consumer, Producer, RingBuffer};
use rustix::process::{Resource, getrlimit, setrlimit};
use sarrus_dynamics::Model;
use sarrus_proto::heartbeat::{HeartbeatReader, HeartbeatWriter};
use sarrus_proto::message::{MAX_PLANS, Statistics};
use sarrus_proto::run::{Run, RunError};
use sarrus_proto::{Domain, ModelInfo, ServerName};
use tracing::{error, info, warn};

use crate::answering::aside::Aside;
use crate::answering::counters::Counters;
use crate::answering::engine::{Engine, MAX_PLAN_ORDERS, PlanOrder, ServedPlan};
use crate::answering::thread::{self, AnsweringThread, Order, Retired, Shared};
use crate::answering::wait::Wait;
use crate::error::{MAX_LANES, ServeError};
use crate::kernels::{Kernels, Maker};
use crate::pool;
use crate::record::{self, RecordOptions};
use crate::system::memory::MemoryLimits;
use crate::system::placement::{Flags, Placement};
use crate::system::sigbus;
use crate::upkeep::calls::{Calls, pages};
use crate::upkeep::connections::Connections;
use crate::upkeep::plans::Plans;
use crate::upkeep::quota::Orders;
use crate::upkeep::watchdog::{HEARTBEAT_TIMEOUT, Watchdog, watch_upkeep};

/// Options of a run.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Name under which clients find the server.
    pub name: String,
    /// The wait strategy.
    pub wait: Wait,
    /// Most clients with a lane at once.
    pub lanes: usize,
    /// Generated kernels for the plans of clients.
    pub kernels: Kernels,
    /// The recording of the last seconds, if any.
    pub record: Option<RecordOptions>,
    /// The processor of the answering thread; all other threads leave it.
    pub cpu: Option<usize>,
    /// Priority of the answering thread under SCHED_FIFO, 1 to 99.
    pub priority: Option<u8>,
    /// Whether memory is locked, so that the answering thread meets no page fault.
    pub lock_memory: bool,
    /// The process that starts another server when this one ends.
    pub supervisor: Option<i32>,
    /// The folder that stands for `/sys/fs/cgroup`, with `self` for `/proc/self/cgroup`, in tests.
    pub cgroups: Option<PathBuf>,
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
            supervisor: None,
            cgroups: None,
        }
    }
}

impl ServeOptions {
    /// Checks the options against the rights of this process, before anything is loaded.
    ///
    /// # Errors
    /// [`ServeError`]; nothing is changed.
    pub fn check(&self) -> Result<(), ServeError> {
        self.placement().map(drop)
    }

    /// The placement of the threads, once all options are checked.
    fn placement(&self) -> Result<Placement, ServeError> {
        if self.lanes > MAX_LANES {
            return Err(ServeError::TooManyLanes(self.lanes));
        }
        let &ServeOptions { cpu, priority, lock_memory, wait, .. } = self;
        Ok(Placement::new(Flags { cpu, priority, lock_memory, busy: wait == Wait::Busy })?)
    }
}

/// Serves a model until `stop` is set; calls `ready` once clients can attach.
///
/// This thread answers the calls socket and makes and retires lanes and services; a thread of its
/// own answers requests.
///
/// # Errors
/// [`ServeError`]; nothing is left in shared memory.
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
    let outcome = serve_in(&domain, &name, model, info, options, &placement, stop, ready);
    domain.tidy();
    outcome
}

fn serve_in(
    domain: &Domain,
    name: &ServerName,
    model: Arc<Model<f64>>,
    info: &ModelInfo,
    options: &ServeOptions,
    placement: &Placement,
    stop: &AtomicBool,
    ready: impl FnOnce(),
) -> Result<(), ServeError> {
    sigbus::install().map_err(ServeError::Guard)?;
    raise_descriptor_limit();
    // the lock on the name excludes every other server of this name
    let run = take_name(domain, name)?;
    let n_places = Connections::places(options.lanes);
    let counters = Counters::new(n_places);
    let shared = Arc::new(Shared { counters, stopping: AtomicBool::new(false) });
    let clock = Clock::new();
    let (mut hot, channels) = answering_thread(&model, options.wait, n_places, &shared, &clock)?;
    let heartbeat = hot.heartbeat.reader_descriptor().map_err(ServeError::Heartbeat)?;
    let mut recording = None;
    if let Some(to) = &options.record {
        let place = place_other(placement);
        let started = record::start_or_warn(to, &model, options.lanes, clock.clone(), place)?;
        (hot.engine.recorder, recording) = started.unzip();
    }
    let aside = |name| Aside::start(&model, name, n_places, place_other(placement));
    hot.engine.set_aside([aside("sarrus-long")?, aside("sarrus-search")?]);
    let kernels = Maker::start(&options.kernels, &model, place_other(placement))?;
    // clients that connect before the first step of upkeep wait
    let socket = |source| ServeError::Socket(run.name_folder().to_owned(), source);
    let listener = run.listen().map_err(socket)?;
    let thread = spawn(hot, placement.clone())?;
    if let Err(error) = placement.place_other() {
        shared.stopping.store(true, Relaxed);
        let _ = thread.join();
        return Err(error.into());
    }

    let Channels { plan_orders, retired_plans, orders, retired } = channels;
    let calls = Calls {
        root: domain.root().to_string_lossy().into_owned(),
        connections: Connections::new(listener, options.lanes, orders, retired),
        model,
        plans: Plans::new(plan_orders, retired_plans, kernels),
        orders: Orders::default(),
        memory: MemoryLimits::of_process(options.cgroups.as_deref()),
        pages: pages(&String::from_utf8_lossy(&info.to_json())),
        fingerprint: info.fingerprint,
        heartbeat,
        buffer: Vec::new(),
        run,
    };
    let mut upkeep = Upkeep {
        heartbeat: HeartbeatReader::new(&calls.heartbeat).map_err(ServeError::Heartbeat)?,
        watchdog: Watchdog::new(2 * WAIT),
        steps: watch_upkeep(options.supervisor, place_other(placement))?,
        calls,
        clock,
        shared,
        since: Instant::now(),
        checked: Instant::now(),
        late: 0,
    };
    ready();
    let fingerprint = format_args!("{:016x}", info.fingerprint);
    let robot = info.robot.as_str();
    info!(name = name.as_str(), robot, %fingerprint, lanes = options.lanes, "serving");
    let ended = upkeep.run(&thread, stop, name.as_str()).and_then(|()| {
        let is_clean = thread.join().is_ok() && stop.load(Relaxed);
        if is_clean { Ok(()) } else { Err(ServeError::Died) }
    });
    upkeep.steps = Arc::default();
    if !matches!(ended, Err(ServeError::Hung(_))) {
        upkeep.calls.plans.stop();
        // the recorder ends when it has written all answers
        recording.map(JoinHandle::join);
    }
    ended
}

/// Upkeep's ends of the channels to the answering thread.
struct Channels {
    plan_orders: Producer<PlanOrder>,
    retired_plans: Consumer<Box<ServedPlan>>,
    orders: Producer<Order>,
    retired: Consumer<Retired>,
}

/// The answering thread's state before its start, and the channels to it.
fn answering_thread(
    model: &Arc<Model<f64>>,
    wait: Wait,
    n_places: usize,
    shared: &Arc<Shared>,
    clock: &Clock,
) -> Result<(AnsweringThread, Channels), ServeError> {
    let (plan_orders, plan_orders_out) = RingBuffer::new(MAX_PLAN_ORDERS);
    let (retired_plans_in, retired_plans) = RingBuffer::new(MAX_PLANS);
    let (orders, orders_out) = RingBuffer::new(thread::MAX_ORDERS * n_places);
    let (retired_in, retired) = RingBuffer::new(thread::MAX_RETIRED * n_places);
    let hot = AnsweringThread {
        engine: Engine::new(model.clone(), plan_orders_out, retired_plans_in),
        ends: Vec::with_capacity(2 * n_places),
        next: 0,
        costly: vec![false; n_places].into(),
        last_beat: 0,
        beat: 0,
        awaits: false,
        orders: orders_out,
        retired: retired_in,
        heartbeat: HeartbeatWriter::new().map_err(ServeError::Heartbeat)?,
        shared: shared.clone(),
        clock: clock.clone(),
        wait,
    };
    Ok((hot, Channels { plan_orders, retired_plans, orders, retired }))
}

/// Moves another thread off the answering thread's processor, if there is a second one.
fn place_other(placement: &Placement) -> impl FnOnce() + Send + 'static {
    let placement = placement.clone();
    move || drop(placement.place_other())
}

/// Time during which a taken name is retried.
const TAKE: Duration = Duration::from_secs(1);

/// Takes the name. The previous server may still be shutting down, or another process may be
/// removing its files: a taken name is tried again for a moment.
fn take_name(domain: &Domain, name: &ServerName) -> Result<Run, ServeError> {
    let start = Instant::now();
    loop {
        match Run::start(domain, name) {
            Ok(run) => return Ok(run),
            Err(RunError::Taken) if start.elapsed() < TAKE => {}
            Err(RunError::Taken) => {
                return Err(ServeError::NameTaken(name.as_str().to_owned()));
            }
            Err(RunError::Folder { path, source }) => {
                return Err(ServeError::Folder(path, source));
            }
            Err(RunError::Domain(error)) => return Err(error.into()),
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Raises the limit of descriptors to its maximum: each client takes about a dozen.
fn raise_descriptor_limit() {
    let mut limit = getrlimit(Resource::Nofile);
    limit.current = limit.maximum;
    // if this fails fewer clients can attach, and the next one gets the reason
    let _ = setrlimit(Resource::Nofile, limit);
}

/// Starts the answering thread on its processor, with its priority.
fn spawn(mut hot: AnsweringThread, placement: Placement) -> Result<JoinHandle<()>, ServeError> {
    let (started, outcome) = mpsc::channel();
    let body = move || {
        let placed = placement.place_answering();
        let is_placed = placed.is_ok();
        let _ = started.send(placed);
        if is_placed {
            let adopted = pool::adopt_thread();
            hot.answer_until_stopped();
            // ports are dropped through the system's allocator
            drop(adopted);
        }
    };
    // entries of large lanes are copied on the stack
    let builder = std::thread::Builder::new().name("sarrus-hot".to_owned()).stack_size(16 << 20);
    let thread = builder.spawn(body).map_err(ServeError::Thread)?;
    outcome.recv().map_err(|_| ServeError::Died)??;
    Ok(thread)
}

/// The work of the upkeep thread.
struct Upkeep {
    calls: Calls,
    clock: Clock,
    shared: Arc<Shared>,
    /// Of the answering thread.
    heartbeat: HeartbeatReader,
    watchdog: Watchdog,
    /// Steps of this thread, which another one watches.
    steps: Arc<AtomicU64>,
    since: Instant,
    checked: Instant,
    /// Late answers logged so far.
    late: u64,
}

/// Longest wait for clients.
const WAIT: Duration = Duration::from_millis(20);
/// Interval between two checks that clients can find the server.
const CHECK: Duration = Duration::from_secs(1);

impl Upkeep {
    /// Serves until the stop, then has the answering thread refuse requests until it ends.
    fn run(
        &mut self,
        thread: &JoinHandle<()>,
        stop: &AtomicBool,
        name: &str,
    ) -> Result<(), ServeError> {
        let hung = || ServeError::Hung(HEARTBEAT_TIMEOUT.as_secs());
        while !stop.load(Relaxed) && !thread.is_finished() {
            self.step(stop, false);
            if self.watchdog.is_lost() {
                // a thread that hangs cannot be ended: the process ends, and its clients see it
                error!(name, "the answering thread hangs");
                return Err(hung());
            }
        }
        info!(name, "stopping");
        self.shared.stopping.store(true, Relaxed);
        while !thread.is_finished() {
            self.step(stop, true);
            if self.watchdog.is_lost() {
                return Err(hung());
            }
        }
        Ok(())
    }

    /// Waits for clients, answers one call of each that sent one, and does the periodic work.
    fn step(&mut self, stop: &AtomicBool, stopping: bool) {
        let wait = if stopping { Duration::from_millis(1) } else { WAIT };
        self.note_step();
        for client in self.calls.connections.wait(wait) {
            // the calls of many clients may take longer than a thread that hangs
            self.note_step();
            // a stop does not wait for them
            if stop.load(Relaxed) && !stopping {
                return;
            }
            let counters = &self.shared.counters;
            let clock = &self.clock;
            let since = self.since;
            let statistics = |calls: &Calls| statistics(calls, counters, clock, since);
            self.calls.answer_call(client, stopping, statistics);
        }
        self.calls.connections.collect();
        self.calls.plans.upkeep();
        let now = Instant::now();
        if now - self.checked > CHECK {
            self.checked = now;
            self.restore();
            self.log_late();
        }
    }

    /// For both watchdogs: of the answering thread, and of this one.
    fn note_step(&mut self) {
        self.watchdog.poll(self.heartbeat.read().beats);
        self.steps.fetch_add(1, Relaxed);
    }

    /// Logs the number of late answers since the last call.
    fn log_late(&mut self) {
        let late = self.shared.counters.counts().late;
        if late > self.late {
            warn!(answers = late - self.late, "late");
            self.late = late;
        }
    }

    /// Restores folders and socket if they were removed.
    fn restore(&mut self) {
        let Calls { run, connections, .. } = &mut self.calls;
        run.restore();
        let listener = &mut connections.listener.listener;
        if !listener.is_reachable(run.name_folder())
            && let Ok(fresh) = run.listen()
        {
            *listener = fresh;
        }
    }
}

fn statistics(calls: &Calls, counters: &Counters, clock: &Clock, since: Instant) -> Statistics {
    let pool = pool::counts();
    let connections = &calls.connections;
    Statistics {
        uptime: since.elapsed().as_secs_f64(),
        counts: counters.counts(),
        latency_ns: counters.percentiles(clock),
        lanes_taken: connections.lanes_taken() as u64,
        lanes: connections.n_lanes as u64,
        lanes_made: connections.lanes_made,
        plans: calls.plans.len() as u64,
        system_allocations: pool.system,
        pool_allocations: pool.pool,
        process: std::process::id().into(),
        clients: connections
            .clients(|client| calls.plans.held(client), |place| counters.late_of(place)),
    }
}
