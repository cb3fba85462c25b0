//! The thread that answers.
//!
//! One sweep takes what waits, at most one request of each client, and answers all of it: no client
//! can starve another, and none is overwritten, because a client has one request under way. After
//! start-up the loop takes no lock, writes no log, reads no clock but the processor's counter, and
//! in busy mode makes no system call. Two things the transport does on it are no part of a request:
//! when a client of the service comes or goes its memory is mapped or unmapped.
//!
//! Overload: work is bounded by the number of clients, so requests wait, at most for one request of
//! each other client. A client that gives up a request and asks again before the server took it is
//! answered `overloaded` by its own side of the service; through a lane its newer request
//! replaces the one that it gave up. Nothing else is ever dropped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::Duration;

use iceoryx2::prelude::ipc;
use quanta::Clock;
use sarrus_proto::board::HeartbeatEntry;
use sarrus_proto::lane::{ComputeActive, Inbox, Outbox, send_response};
use sarrus_proto::message::{Heartbeat, MAX_REQUEST_CLIENTS, RequestHead, ResponseHead};
use sarrus_proto::service::ComputeServer;
use sarrus_proto::{Status, Warnings};

use crate::Wait;
use crate::counters::{Counters, Transport};
use crate::engine::{Engine, Input};
use crate::record::Client;

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

/// The answering thread's ends of a lane.
pub(crate) struct HotLane {
    pub(crate) inbox: Box<dyn Inbox<RequestHead>>,
    pub(crate) outbox: Box<dyn Outbox<ResponseHead>>,
}

/// Orders of the maintenance thread to the answering thread.
pub(crate) enum Order {
    /// Poll this lane from now on.
    Serve { slot: usize, lane: HotLane },
    /// Give the lane back.
    Retire { slot: usize },
}

/// A lane given back, with its slot.
pub(crate) type Retired = (usize, HotLane);

/// What both threads see.
pub(crate) struct Shared {
    pub(crate) counters: Counters,
    pub(crate) stopping: AtomicBool,
}

/// The answering thread's state.
pub(crate) struct Hot {
    pub(crate) engine: Engine,
    pub(crate) transport: ComputeServer<ipc::Service>,
    pub(crate) lanes: Box<[Option<HotLane>]>,
    pub(crate) waiting: [Option<ComputeActive<ipc::Service>>; MAX_REQUEST_CLIENTS],
    pub(crate) orders: Receiver<Order>,
    pub(crate) retired: SyncSender<Retired>,
    pub(crate) heartbeat: HeartbeatEntry,
    pub(crate) shared: Arc<Shared>,
    pub(crate) clock: Clock,
    pub(crate) wait: Wait,
}

impl Hot {
    /// Answers until the order to stop, then refuses for a moment what still comes.
    pub(crate) fn run(&mut self) {
        let ticks = |span: Duration| Ticks::of(&self.clock, span);
        let (beat, idle, quiet, farewell) =
            (ticks(BEAT), ticks(IDLE), ticks(QUIET), ticks(FAREWELL));
        let (mut beats, mut sweeps) = (0, 0_u32);
        let (mut last_beat, mut last_request, mut stop_since) =
            (self.clock.raw(), self.clock.raw(), None);

        loop {
            let stopping = self.shared.stopping.load(Relaxed);
            let answered = self.sweep(stopping);
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
                    (beats, last_beat) = (beats + 1, now);
                    self.heartbeat.update_with_copy(Heartbeat { beats, stopped: 0 });
                }
                if stopping && now.wrapping_sub(*stop_since.get_or_insert(now)) > farewell.0 {
                    self.heartbeat.update_with_copy(Heartbeat { beats: beats + 1, stopped: 1 });
                    return;
                }
            }
        }
    }

    /// Takes what waits at both transports and answers it; how many requests there were.
    fn sweep(&mut self, stopping: bool) -> usize {
        let mut answered = 0;

        // take from the service: a client's next request can only come after this one's
        // answer
        let found = self.clock.raw();
        let mut n_waiting = 0;
        while let Some(slot) = self.waiting.get_mut(n_waiting) {
            // an error concerns a client that is about to go: the others are served
            let Ok(Some(request)) = self.transport.receive() else { break };
            *slot = Some(request);
            n_waiting += 1;
        }

        // each lane once
        for (slot, lane) in self.lanes.iter_mut().enumerate() {
            let Some(lane) = lane else { continue };
            let Some((head, numbers)) = lane.inbox.poll() else { continue };
            // not a request: the client has just claimed its lane
            if head.sequence == 0 {
                continue;
            }
            let start = self.clock.raw();
            self.engine.found(start, Client::Lane(slot as u32));
            let output = lane.outbox.numbers();
            let answer = match stopping {
                false => self.engine.answer(&head, Input::Copied(numbers), output),
                true => refuse(&head, Status::ShuttingDown, output),
            };
            lane.outbox.publish(answer);
            self.shared.counters.record(
                Transport::Lane,
                answer.status,
                self.clock.raw().wrapping_sub(start),
            );
            self.engine.sent();
            answered += 1;
        }

        // what was taken from the service
        for request in self.waiting[..n_waiting].iter_mut().filter_map(Option::take) {
            let payload = request.payload();
            let head = payload.head();
            let mut status = Status::Overloaded as u32;
            let engine = &mut self.engine;
            engine.found(found, Client::Service);
            let sent = send_response(&request, |output| {
                let answer = match stopping {
                    false => engine.answer(&head, Input::Shared(payload), output),
                    true => refuse(&head, Status::ShuttingDown, output),
                };
                status = answer.status;
                answer
            });
            // a client that went away meanwhile hears nothing; it is counted as what it would have
            // heard
            let _ = sent;
            self.shared.counters.record(
                Transport::Service,
                status,
                self.clock.raw().wrapping_sub(found),
            );
            self.engine.sent();
            answered += 1;
        }
        answered
    }

    /// Takes new plans and lanes and gives back old ones. Nobody ever blocks on these channels:
    /// looking costs two loads.
    fn obey(&mut self) {
        self.engine.obey();
        while let Ok(order) = self.orders.try_recv() {
            match order {
                Order::Serve { slot, lane } => self.lanes[slot] = Some(lane),
                Order::Retire { slot } => {
                    if let Some(lane) = self.lanes[slot].take() {
                        // there is room for every lane, so this cannot fail; were it to, the lane
                        // would stay
                        if let Err(error) = self.retired.try_send((slot, lane)) {
                            let (std::sync::mpsc::TrySendError::Full((slot, lane))
                            | std::sync::mpsc::TrySendError::Disconnected((slot, lane))) = error;
                            self.lanes[slot] = Some(lane);
                        }
                    }
                }
            }
        }
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

fn refuse(head: &RequestHead, status: Status, output: &mut [f64]) -> ResponseHead {
    output.fill(f64::NAN);
    ResponseHead::new(status, Warnings::NONE, head.sequence)
}
