//! A run of the server: start, upkeep beside the answering thread, end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{self, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc;
use quanta::Clock;
use sarrus_dynamics::Model;
use sarrus_proto::board::{HeartbeatEntry, StatisticsEntry, StatusBoard};
use sarrus_proto::lane::Threadsafe;
use sarrus_proto::message::{MAX_PLANS, Statistics};
use sarrus_proto::service::{
    ControlCallers, ControlServer, ServiceError, serve_compute, serve_control,
};
use sarrus_proto::{Domain, DomainError, ModelInfo, ServerName};

use crate::control::Control;
use crate::counters::{Counters, Latency};
use crate::engine::Engine;
use crate::hot::{Hot, Order, Retired, Shared};
use crate::lanes::Lanes;
use crate::placement::{Flags, Placement, PlacementError};
use crate::plans::{MAX_ORDERS, Plans};
use crate::pool;
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
        if self.lanes > MAX_LANES {
            return Err(ServeError::TooManyLanes { found: self.lanes });
        }
        self.placement().map(drop)
    }

    fn placement(&self) -> Result<Placement, ServeError> {
        let &ServeOptions { cpu, priority, lock_memory, wait, .. } = self;
        Ok(Placement::new(Flags { cpu, priority, lock_memory, busy: wait == Wait::Busy })?)
    }
}

/// The most lanes that one server makes.
pub const MAX_LANES: usize = 256;

/// Why a server does not start or did not end well.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The shared memory cannot be entered.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Another server runs under this name.
    #[error(
        "a server named `{name}` is running already; stop it or choose another name with --name"
    )]
    NameTaken {
        /// The name.
        name: String,
    },
    /// A service cannot be made.
    #[error(transparent)]
    Service(ServiceError),
    /// More lanes than there can be.
    #[error("{found} lanes, expected 0 to {MAX_LANES}; choose fewer with --lanes")]
    TooManyLanes {
        /// What was asked.
        found: usize,
    },
    /// Threads or memory cannot be had as the options ask.
    #[error(transparent)]
    Placement(#[from] PlacementError),
    /// The answering thread cannot be started.
    #[error("the answering thread does not start: {source}; check the limits of this process")]
    Thread {
        /// What the system says.
        source: std::io::Error,
    },
    /// The answering thread ended without an order to stop.
    #[error(
        "the answering thread ended by itself; this is a defect of sarrus, please report it with \
         the model"
    )]
    Died,
}

/// Serves a model until `stop` is set; calls `ready` once clients can attach.
///
/// This thread makes and retires lanes and answers the control service; a thread of its own answers
/// requests.
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
    options.check()?;
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
    let service = |error| match error {
        ServiceError::Taken { .. } => ServeError::NameTaken { name: options.name.clone() },
        other => ServeError::Service(other),
    };

    // the control port is what makes this server the only one of its name; what a dead one left is
    // cleared on the way
    let node = domain.node::<Threadsafe>()?;
    let (port, callers) = take_name(&node, name).map_err(service)?;
    let instance = instance();
    let status = StatusBoard::create(&node, name, instance).map_err(service)?;

    // the answering thread
    let shared = Arc::new(Shared { counters: Counters::new(), stopping: AtomicBool::new(false) });
    let (plan_orders_in, plan_orders) = sync_channel(MAX_ORDERS);
    let (retired_plans, retired_plans_out) = sync_channel(MAX_PLANS);
    // a lane is ordered there and back before it is free again
    let (orders_in, orders) = sync_channel(2 * options.lanes + 1);
    let (retired, retired_out) = sync_channel(options.lanes + 1);
    let engine = Engine::new(model.clone(), plan_orders, retired_plans);
    let clock = Clock::new();
    let start = HotStart {
        engine,
        n_lanes: options.lanes,
        orders,
        retired,
        heartbeat: status.heartbeat,
        shared: shared.clone(),
        clock: clock.clone(),
        wait: options.wait,
        placement: placement.clone(),
    };
    let thread = start.spawn(domain.clone(), name.clone(), instance)?;
    placement.place_other()?;

    // upkeep
    let lanes = Lanes::new(name.clone(), instance, options.lanes, orders_in, retired_out);
    let fingerprint = info.fingerprint;
    let control = Control {
        port,
        callers,
        readers: status.readers,
        instance,
        model,
        plans: Plans::new(plan_orders_in, retired_plans_out),
        info: info.to_json(),
        fingerprint,
    };
    let latency = Latency::new(clock).ok_or(ServeError::Died)?;
    let mut upkeep = Upkeep {
        node,
        control,
        lanes,
        latency,
        statistics: status.statistics,
        shared: shared.clone(),
        since: Instant::now(),
        naps: 0,
    };
    upkeep.publish();
    ready();
    while !stop.load(Relaxed) && !thread.is_finished() {
        upkeep.step();
    }

    // the end: refuse what still comes, then take everything down in order
    shared.stopping.store(true, Relaxed);
    while !thread.is_finished() {
        upkeep.control.serve(&upkeep.node, &mut upkeep.lanes, true);
        std::thread::sleep(Duration::from_millis(1));
    }
    let ended = thread.join();
    upkeep.publish();
    if ended.is_ok() && stop.load(Relaxed) { Ok(()) } else { Err(ServeError::Died) }
}

/// The control port. A server that ended just now may still be going: the name is asked for a few
/// times.
fn take_name(
    node: &Node<Threadsafe>,
    name: &ServerName,
) -> Result<(ControlServer, ControlCallers), ServiceError> {
    let mut attempts = 0;
    loop {
        node.blocking_cleanup_dead_nodes(Duration::from_secs(1));
        match serve_control(node, name) {
            Err(
                ServiceError::Taken { .. }
                | ServiceError::Memory { .. }
                | ServiceError::Absent { .. },
            ) if attempts < 6 => attempts += 1,
            outcome => return outcome,
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Distinguishes runs: the time of the start and the process.
fn instance() -> u64 {
    let now =
        SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
    (now ^ u64::from(std::process::id()) << 40).max(1)
}

struct HotStart {
    engine: Engine,
    n_lanes: usize,
    orders: mpsc::Receiver<Order>,
    retired: mpsc::SyncSender<Retired>,
    heartbeat: HeartbeatEntry,
    shared: Arc<Shared>,
    clock: Clock,
    wait: Wait,
    placement: Placement,
}

impl HotStart {
    /// Starts the answering thread and waits until it answers.
    fn spawn(
        self,
        domain: Domain,
        name: ServerName,
        instance: u64,
    ) -> Result<JoinHandle<()>, ServeError> {
        let (started, outcome) = mpsc::channel();
        let body = move || match self.prepare(&domain, &name, instance) {
            Err(error) => {
                let _ = started.send(Err(error));
            }
            Ok((_node, mut hot)) => {
                let _ = started.send(Ok(()));
                drop(started);
                let adopted = pool::adopt_thread();
                hot.run();
                // taking ports down is the system allocator's again
                drop(adopted);
            }
        };
        // entries of large lanes pass over the stack
        let builder =
            std::thread::Builder::new().name("sarrus-hot".to_owned()).stack_size(16 << 20);
        let thread = builder.spawn(body).map_err(|source| ServeError::Thread { source })?;
        outcome.recv().unwrap_or(Err(ServeError::Died))?;
        Ok(thread)
    }

    fn prepare(
        self,
        domain: &Domain,
        name: &ServerName,
        instance: u64,
    ) -> Result<(Node<ipc::Service>, Hot), ServeError> {
        self.placement.place_answering()?;
        let node = domain.node::<ipc::Service>()?;
        let transport = serve_compute(&node, name, instance).map_err(ServeError::Service)?;
        let HotStart { engine, n_lanes, orders, retired, heartbeat, shared, clock, wait, .. } =
            self;
        let lanes = (0..n_lanes).map(|_| None).collect();
        Ok((
            node,
            Hot {
                engine,
                transport,
                lanes,
                waiting: [const { None }; _],
                orders,
                retired,
                heartbeat,
                shared,
                clock,
                wait,
            },
        ))
    }
}

/// What happens beside the answering thread.
struct Upkeep {
    node: Node<Threadsafe>,
    control: Control,
    lanes: Lanes,
    latency: Latency,
    statistics: StatisticsEntry,
    shared: Arc<Shared>,
    since: Instant,
    naps: u32,
}

/// Between two looks at the control service while nobody calls.
const NAP: Duration = Duration::from_millis(1);
/// Naps between two looks at lanes and plans.
const LANES: u32 = 20;
/// Naps between two statistics.
const PUBLISH: u32 = 50;
/// Naps between two searches for the dead; a search takes about a millisecond.
const DEAD: u32 = 200;

impl Upkeep {
    /// One look at the control service, and what else is due.
    fn step(&mut self) {
        if !self.control.serve(&self.node, &mut self.lanes, false) {
            std::thread::sleep(NAP);
        }
        self.naps = self.naps.wrapping_add(1);
        if self.naps.is_multiple_of(DEAD) {
            self.node.try_cleanup_dead_nodes();
        }
        if self.naps.is_multiple_of(LANES) {
            self.lanes.upkeep();
            self.control.upkeep();
        }
        if self.naps.is_multiple_of(PUBLISH) {
            self.publish();
        }
    }

    fn publish(&mut self) {
        self.latency.fold(&self.shared.counters);
        let counters = &self.shared.counters;
        let pool = pool::counts();
        self.statistics.update_with_copy(Statistics {
            uptime: self.since.elapsed().as_secs_f64(),
            counts: counters.counts(),
            latency_ns: self.latency.percentiles(),
            lanes_taken: self.lanes.taken() as u64,
            lanes: self.lanes.len() as u64,
            lanes_made: self.lanes.made(),
            plans: self.control.plans.len() as u64,
            system_allocations: pool.system,
            pool_allocations: pool.pool,
            process: std::process::id().into(),
        });
    }
}
