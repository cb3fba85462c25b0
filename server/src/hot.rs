//! The thread that answers.
//!
//! One sweep takes what waits, at most one request of each client, and answers all of it: no client
//! can starve another, and none is overwritten, because a client has one request under way. After
//! start-up the loop waits for nobody, writes no log, reads no clock but the processor's counter
//! (and the system's for a heartbeat and for a request with a stamp), and in busy mode makes no
//! system call. What comes and goes is mapped and unmapped beside it.
//!
//! Overload: work is bounded by the number of clients, so requests wait, at most for one request of
//! each other client. A client that gives up a request and asks again before the server took it is
//! answered `overloaded` by its own side of the service; through a lane its newer request
//! replaces the one that it gave up. Nothing else is ever dropped.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError};
use std::time::Duration;

use quanta::Clock;
use sarrus_proto::Status;
use sarrus_proto::board::ServedLane;
use sarrus_proto::heartbeat::HeartbeatWriter;
use sarrus_proto::lane::{Threadsafe, send_response};
use sarrus_proto::message::{RequestHead, ResponseHead};
use sarrus_proto::service::ComputeServer;

use crate::Wait;
use crate::counters::{Counters, Transport};
use crate::engine::{Engine, Input, refuse};
use crate::record::Client;
use crate::taken::{Taken, is_late};

/// Sweeps between two looks at the orders of the maintenance thread.
const SWEEPS_BETWEEN_MAIL: u32 = 32;
/// How long a heartbeat may be old.
const BEAT: Duration = Duration::from_millis(1);
/// In sleeping mode: polled for this long after the last request, then slept.
const IDLE: Duration = Duration::from_micros(200);
/// In sleeping mode: the length of one sleep while requests keep coming now and then.
const NAP: Duration = Duration::from_micros(50);
/// In sleeping mode: without a request for this long, sleeps are long.
const QUIET: Duration = Duration::from_millis(200);
/// In sleeping mode: the length of one long sleep.
const LONG_NAP: Duration = Duration::from_millis(1);
/// After the order to stop, requests are refused for this long, so that nobody waits for an answer
/// in vain.
const FAREWELL: Duration = Duration::from_millis(100);

/// The answering thread's end of what a client has.
pub(crate) enum End {
    Lane(ServedLane),
    Service(ComputeServer<Threadsafe>),
    /// A lane whose records in shared memory make no sense: nobody polls it any more. It is kept to
    /// be taken down beside this thread.
    DamagedLane(#[expect(dead_code, reason = "kept until it is dropped")] ServedLane),
    /// The same of a service.
    DamagedService(
        #[expect(dead_code, reason = "kept until it is dropped")] ComputeServer<Threadsafe>,
    ),
    /// Nothing, between two of the others.
    None,
}

/// Orders of the maintenance thread to the answering thread.
pub(crate) enum Order {
    /// Poll this end from now on.
    Serve { place: usize, end: End },
    /// Give the end back.
    Retire { place: usize },
}

/// An end given back, with its place.
pub(crate) type Retired = (usize, End);

/// What both threads see.
pub(crate) struct Shared {
    pub(crate) counters: Counters,
    pub(crate) stopping: AtomicBool,
}

/// The answering thread's state.
pub(crate) struct Hot {
    pub(crate) engine: Engine,
    /// What is polled, with its place; there is room for all.
    pub(crate) ends: Vec<Retired>,
    pub(crate) orders: Receiver<Order>,
    pub(crate) retired: SyncSender<Retired>,
    pub(crate) heartbeat: HeartbeatWriter,
    pub(crate) shared: Arc<Shared>,
    pub(crate) clock: Clock,
    pub(crate) wait: Wait,
}

impl Hot {
    /// Answers until the order to stop, then refuses for a moment what still comes.
    pub(crate) fn run(&mut self) {
        // finds where the kernel's page has the clock: none of a request's time
        self.heartbeat.beat(false);
        let ticks = |span: Duration| Ticks::of(&self.clock, span);
        let (beat, idle, quiet, farewell) =
            (ticks(BEAT), ticks(IDLE), ticks(QUIET), ticks(FAREWELL));
        let mut sweeps = 0_u32;
        let (mut last_beat, mut last_request, mut stop_since) =
            (self.clock.raw(), self.clock.raw(), None);

        loop {
            let stopping = self.shared.stopping.load(Relaxed);
            let answered = self.guarded_sweep(stopping);
            sweeps = sweeps.wrapping_add(1);

            // in sleeping mode, poll while there is something to do, else nap
            let mut napped = false;
            if self.wait == Wait::Sleep {
                let now = self.clock.raw();
                let pause = now.wrapping_sub(last_request);
                if answered > 0 {
                    last_request = now;
                } else if pause > idle.0 {
                    std::thread::sleep(if pause > quiet.0 { LONG_NAP } else { NAP });
                    napped = true;
                }
            }
            if answered == 0 {
                std::hint::spin_loop();
            }

            // now and then: heartbeat, orders, stop
            if napped || sweeps.is_multiple_of(SWEEPS_BETWEEN_MAIL) {
                self.obey();
                let now = self.clock.raw();
                if now.wrapping_sub(last_beat) > beat.0 {
                    last_beat = now;
                    self.heartbeat.beat(false);
                }
                if stopping && now.wrapping_sub(*stop_since.get_or_insert(now)) > farewell.0 {
                    self.heartbeat.beat(true);
                    return;
                }
            }
        }
    }

    /// A sweep that outlives a client's damaged memory: the transport ends its thread where its
    /// records make no sense; here only that client's end is polled no more.
    fn guarded_sweep(&mut self, stopping: bool) -> usize {
        let at = Cell::new(usize::MAX);
        let sweep = catch_unwind(AssertUnwindSafe(|| self.sweep(stopping, &at)));
        if sweep.is_err()
            && let Some((_, end)) = self.ends.get_mut(at.get())
        {
            *end = match std::mem::replace(end, End::None) {
                End::Lane(lane) => End::DamagedLane(lane),
                End::Service(port) => End::DamagedService(port),
                damaged => damaged,
            };
        }
        sweep.unwrap_or(0)
    }

    /// Looks at each client once, and answers what waits; how many requests there were. `at` is the
    /// end that it looks at.
    fn sweep(&mut self, stopping: bool, at: &Cell<usize>) -> usize {
        let Hot { engine, ends, shared, clock, .. } = self;
        let mut answered = 0;
        for (index, (place, end)) in ends.iter_mut().enumerate() {
            at.set(index);
            let (transport, outcome, start) = match end {
                End::Lane(lane) => {
                    let Some((head, numbers)) = lane.inbox.poll() else { continue };
                    // not a request: the client has just claimed its lane
                    if head.sequence == 0 {
                        continue;
                    }
                    let start = clock.raw();
                    engine.found(start, Client::Lane(*place as u32));
                    let taken = Taken::of(clock, &head, start);
                    let output = lane.outbox.numbers();
                    let answer = match stopping {
                        false => engine.answer(&head, Input::Copied(numbers), output, &taken),
                        true => refuse(&head, Status::ShuttingDown, output, &taken),
                    };
                    lane.outbox.publish(answer);
                    (Transport::Lane, Outcome::of(&head, &answer), start)
                }
                End::Service(port) => {
                    // an error concerns a client that is about to go
                    let Ok(Some(request)) = port.receive() else { continue };
                    let start = clock.raw();
                    // given up meanwhile, or its client is gone: dropping it releases it
                    if !request.is_connected() {
                        continue;
                    }
                    let payload = request.payload();
                    let head = payload.head();
                    engine.found(start, Client::Service);
                    let taken = Taken::of(clock, &head, start);
                    let mut outcome = Outcome { status: Status::Overloaded as u32, late: false };
                    // a client that went away meanwhile hears nothing; it is counted as what it
                    // would have heard
                    let _ = send_response(&request, |output| {
                        let answer = match stopping {
                            false => engine.answer(&head, Input::Shared(payload), output, &taken),
                            true => refuse(&head, Status::ShuttingDown, output, &taken),
                        };
                        outcome = Outcome::of(&head, &answer);
                        answer
                    });
                    (Transport::Service, outcome, start)
                }
                End::DamagedLane(_) | End::DamagedService(_) | End::None => continue,
            };
            if outcome.late {
                shared.counters.record_late(*place);
            }
            shared.counters.record(transport, outcome.status, clock.raw().wrapping_sub(start));
            engine.sent();
            answered += 1;
        }
        answered
    }

    /// Takes new plans and ends and gives back old ones. Nobody ever blocks on these channels:
    /// looking costs two loads.
    fn obey(&mut self) {
        self.engine.obey();
        while let Ok(order) = self.orders.try_recv() {
            match order {
                // never more than there is room for: a place is served once
                Order::Serve { place, end } => {
                    self.shared.counters.forget_late(place);
                    self.ends.push((place, end));
                }
                Order::Retire { place } => {
                    let Some(index) = self.ends.iter().position(|(one, _)| *one == place) else {
                        continue;
                    };
                    // there is room for every end, so this cannot fail; were it to, the end would
                    // stay
                    if let Err(TrySendError::Full(retired) | TrySendError::Disconnected(retired)) =
                        self.retired.try_send(self.ends.swap_remove(index))
                    {
                        self.ends.push(retired);
                    }
                }
            }
        }
    }
}

/// What is counted of an answer.
struct Outcome {
    status: u32,
    late: bool,
}

impl Outcome {
    fn of(request: &RequestHead, answer: &ResponseHead) -> Outcome {
        Outcome { status: answer.status, late: is_late(request, answer) }
    }
}

/// A span in ticks of the processor's counter.
struct Ticks(u64);

impl Ticks {
    fn of(clock: &Clock, span: Duration) -> Ticks {
        // nanoseconds of a million ticks give the rate
        let ns_per_million = clock.delta_as_nanos(0, 1_000_000).max(1);
        Ticks((span.as_nanos() as u64).saturating_mul(1_000_000) / ns_per_million)
    }
}
