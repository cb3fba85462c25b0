//! The thread that answers.
//!
//! A sweep looks at each client once, and again at those of cheap states after each turn that did
//! not suffice: no client can starve another, and no request is overwritten, because a client has
//! one pending request. A state that needs more than a turn is computed on a thread beside this one
//! ([`crate::answering::aside`]). After start-up the
//! loop never blocks, writes no log, reads no clock but the processor's counter (and the system's
//! for a heartbeat and for a request with a stamp), and in busy mode makes no system call. The
//! upkeep thread maps and unmaps the segments of clients.
//!
//! Batches are answered tile by tile: after each sweep one tile of one of them, in turns. So a
//! client with a lane or a service waits for one tile at most, however many batches are in
//! progress.
//!
//! Overload: work is bounded by the number of clients, so requests wait, at most for one turn of
//! each other client. A client that cancels a request and sends another before the server took it
//! gets `overloaded` from its own side of the service; through a lane the newer request replaces
//! the older one. A new batch cancels the pending one and is answered `overloaded`. No other
//! request is dropped.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use quanta::Clock;
use rtrb::{Consumer, Producer, PushError};
use sarrus_proto::Status;
use sarrus_proto::board::ServedLane;
use sarrus_proto::heartbeat::HeartbeatWriter;
use sarrus_proto::message::{RequestHead, ResponseHead};
use sarrus_proto::service::ServedService;

use crate::answering::batches::Batches;
use crate::answering::counters::{Counters, Transport};
use crate::answering::engine::{Engine, Input, refuse};
use crate::answering::timing::{RequestTiming, is_late};
use crate::answering::wait::{LONG_NAP, NAP, QUIET, Wait};
use crate::record::Client;

/// Sweeps without an answer between two checks for orders of the maintenance thread; after an
/// answer one is due when the heartbeat is.
const SWEEPS_BETWEEN_ORDERS: u32 = 32;
/// Greatest age of a heartbeat; it is checked after each answer.
const BEAT: Duration = Duration::from_millis(1);
/// In sleeping mode: the thread polls for this long after the last request, then sleeps.
const IDLE: Duration = Duration::from_micros(200);
/// Time during which requests are refused after the order to stop, so that clients get an answer.
const DRAIN_TIME: Duration = Duration::from_millis(100);

/// The answering thread's end of a client's transport.
pub(crate) enum End {
    Lane(ServedLane, LastRequest),
    /// With the time when its request was found, while another thread computes its state.
    Service(Box<dyn ServedService>, Option<u64>),
    /// In addition to one of the others.
    Batches(Batches),
    /// The end of a client that has overwritten the transport's records.
    Broken,
}

/// The last request of a lane.
#[derive(Default)]
pub(crate) struct LastRequest {
    /// Its sequence: the reader may see an entry twice while it is written.
    sequence: u64,
    /// When it was found, while another thread computes its state.
    pending: Option<u64>,
}

/// Orders of the maintenance thread to the answering thread.
pub(crate) enum Order {
    /// Poll this end from now on.
    Serve { place: usize, end: End },
    /// Return all ends of this place.
    Retire { place: usize },
}

/// Most pending orders of one place: the area for batches of a former client and two orders to
/// return, one of them for a broken end; the end and the area of the next client, and the order to
/// return both.
pub(crate) const MAX_ORDERS: usize = 6;

/// A returned end, with its place.
pub(crate) type Retired = (usize, End);

/// Most ends of one place in the return channel: an area of the previous client, an end and an area
/// of the present one.
pub(crate) const MAX_RETIRED: usize = 3;

/// State shared by both threads.
pub(crate) struct Shared {
    pub(crate) counters: Counters,
    pub(crate) stopping: AtomicBool,
}

/// The outcome of a look at a client.
#[derive(PartialEq, Eq)]
enum Polled {
    Nothing,
    Answered,
    /// A state that needs more than a turn.
    CutShort,
}

/// The answering thread's state.
pub(crate) struct AnsweringThread {
    pub(crate) engine: Engine,
    /// The polled ends with their places; the capacity suffices for all.
    pub(crate) ends: Vec<Retired>,
    /// The end with the next turn for a tile of a batch.
    pub(crate) next: usize,
    /// Of each place: the client's last state needed more than a turn.
    pub(crate) costly: Box<[bool]>,
    /// When the last heartbeat was, and their interval `[tick]`.
    pub(crate) last_beat: u64,
    pub(crate) beat: u64,
    /// A thread beside this one waits for a client.
    pub(crate) awaits: bool,
    pub(crate) orders: Consumer<Order>,
    pub(crate) retired: Producer<Retired>,
    pub(crate) heartbeat: HeartbeatWriter,
    pub(crate) shared: Arc<Shared>,
    pub(crate) clock: Clock,
    pub(crate) wait: Wait,
}

impl AnsweringThread {
    /// Answers until the order to stop, then refuses requests for [`DRAIN_TIME`].
    pub(crate) fn answer_until_stopped(&mut self) {
        // the first reading, before any request, locates the kernel's clock page
        self.heartbeat.beat(false);
        let spans = [BEAT, IDLE, QUIET, DRAIN_TIME];
        let [beat, idle, quiet, drain_time] = spans.map(|span| ticks(&self.clock, span));
        self.beat = beat;
        self.last_beat = self.clock.raw();
        let mut sweeps = 0_u32;
        let mut last_request = self.last_beat;
        let mut stop_since = None;

        loop {
            let stopping = self.shared.stopping.load(Relaxed);
            let answered = self.sweep(stopping);
            sweeps = sweeps.wrapping_add(1);

            // in sleeping mode, poll while there is work, else sleep
            let mut napped = false;
            if self.wait == Wait::Sleep {
                let now = self.clock.raw();
                let pause = now.wrapping_sub(last_request);
                if answered > 0 {
                    last_request = now;
                } else if pause > idle && !self.awaits {
                    std::thread::sleep(if pause > quiet { LONG_NAP } else { NAP });
                    napped = true;
                }
            }
            if answered == 0 {
                std::hint::spin_loop();
            }

            // periodically: heartbeat, orders, stop
            if napped || sweeps.is_multiple_of(SWEEPS_BETWEEN_ORDERS) {
                self.handle_orders();
                let now = self.clock.raw();
                self.beat_at(now);
                if stopping && now.wrapping_sub(*stop_since.get_or_insert(now)) > drain_time {
                    self.heartbeat.beat(true);
                    return;
                }
            }
        }
    }

    /// Gives each client a turn, then answers one tile of a batch; the number of answers.
    fn sweep(&mut self, stopping: bool) -> usize {
        let mut answered = 0;
        let mut index = 0;
        while index < self.ends.len() {
            answered += self.turn(index, stopping);
            index += 1;
        }
        let has_tile = self.answer_tile(stopping);
        answered += usize::from(has_tile);
        if std::mem::take(&mut self.engine.cut_short) || has_tile {
            self.serve_between(self.clock.raw());
        }
        self.awaits = self.engine.end_sweep();
        answered
    }

    /// Gives a client a turn; where that did not suffice, polls the clients of cheaper states: they
    /// wait for one such turn, not for one of each other client. The number of answers.
    #[inline]
    fn turn(&mut self, index: usize, stopping: bool) -> usize {
        let look = self.poll(index, stopping);
        if look != Polled::CutShort {
            return usize::from(look == Polled::Answered);
        }
        let mut answered = 0;
        for other in 0..self.ends.len() {
            let place = self.ends.get(other).map(|(place, _)| *place);
            if place.is_some_and(|place| self.costly.get(place) == Some(&false)) {
                answered += usize::from(self.poll(other, stopping) == Polled::Answered);
            }
        }
        answered
    }

    /// Polls a client and answers its pending request.
    #[inline]
    fn poll(&mut self, index: usize, stopping: bool) -> Polled {
        let AnsweringThread { engine, ends, shared, clock, costly, .. } = self;
        let Some((place, end)) = ends.get_mut(index) else { return Polled::Nothing };
        // the transport panics if a client has overwritten its records
        let look = catch_unwind(AssertUnwindSafe(|| match end {
            End::Lane(lane, last) => poll_lane(lane, last, *place, engine, clock, stopping),
            End::Service(port, pending) => {
                poll_service((port.as_mut(), pending), *place, engine, clock, stopping)
            }
            End::Batches(_) | End::Broken => None,
        }));
        let Ok(turn) = look else {
            self.give_up(index);
            return Polled::Nothing;
        };
        let is_cut_short = std::mem::take(&mut engine.cut_short);
        let Some(turn) = turn else {
            if !is_cut_short {
                return Polled::Nothing;
            }
            if let Some(costly) = costly.get_mut(*place) {
                *costly = true;
            }
            self.serve_between(self.clock.raw());
            return Polled::CutShort;
        };
        if turn.late {
            shared.counters.record_late(*place);
        }
        if let Some(costly) = costly.get_mut(*place) {
            *costly &= turn.has_waited;
        }
        let now = clock.raw();
        shared.counters.record(turn.transport, turn.status, now.wrapping_sub(turn.start));
        shared.counters.set_by_kernel(engine.by_kernel);
        engine.sent();
        self.serve_between(now);
        Polled::Answered
    }

    /// Heartbeat and orders between two answers, when they are due.
    #[inline]
    fn serve_between(&mut self, now: u64) {
        if now.wrapping_sub(self.last_beat) > self.beat {
            self.beat_at(now);
            self.handle_orders();
        }
    }

    /// The heartbeat, when it is due.
    fn beat_at(&mut self, now: u64) {
        if now.wrapping_sub(self.last_beat) > self.beat {
            self.last_beat = now;
            self.heartbeat.beat(false);
        }
    }

    /// Answers one tile of one batch, if any is in progress; the others have the next turns.
    fn answer_tile(&mut self, stopping: bool) -> bool {
        let AnsweringThread { engine, ends, shared, clock, next, .. } = self;
        for index in (*next..ends.len()).chain(0..(*next).min(ends.len())) {
            let Some((place, End::Batches(batches))) = ends.get_mut(index) else { continue };
            // as for a single request: a panic ends its client alone
            let turn = catch_unwind(AssertUnwindSafe(|| {
                batches.turn(*place, engine, &shared.counters, clock, stopping)
            }));
            if let Ok(false) = turn {
                continue;
            }
            *next = index + 1;
            if turn.is_err() {
                // by the end beside it, which has the same lifetime
                let place = *place;
                let end = ends
                    .iter()
                    .position(|(other, end)| *other == place && !matches!(end, End::Batches(_)));
                self.give_up(end.unwrap_or(index));
            }
            return true;
        }
        false
    }

    /// Ends the client of a broken end. The end itself is not touched again, not even to drop it.
    #[cold]
    fn give_up(&mut self, index: usize) {
        if let Some((place, end)) = self.ends.get_mut(index) {
            std::mem::forget(std::mem::replace(end, End::Broken));
            let place = *place;
            self.retire_all(place);
        }
    }

    /// Returns all ends of a place.
    fn retire_all(&mut self, place: usize) {
        for index in (0..self.ends.len()).rev() {
            if self.ends[index].0 == place {
                self.retire(index);
            }
        }
    }

    fn retire(&mut self, index: usize) {
        // there is room for every end, so this cannot fail; otherwise the end would stay
        if let Err(PushError::Full(retired)) = self.retired.push(self.ends.swap_remove(index)) {
            self.ends.push(retired);
        }
    }

    /// Takes new plans and ends and returns old ones. Never blocks; a check costs two loads.
    fn handle_orders(&mut self) {
        self.engine.handle_orders();
        while let Ok(order) = self.orders.pop() {
            match order {
                // never exceeds the capacity: a place has one end, and one for batches
                Order::Serve { place, end } => {
                    if !matches!(end, End::Batches(_)) {
                        self.shared.counters.forget_late(place);
                    }
                    self.ends.push((place, end));
                }
                Order::Retire { place } => self.retire_all(place),
            }
        }
    }
}

/// Polls a lane.
#[inline]
fn poll_lane(
    lane: &mut ServedLane,
    last: &mut LastRequest,
    place: usize,
    engine: &mut Engine,
    clock: &Clock,
    stopping: bool,
) -> Option<Turn> {
    let is_new = lane.inbox.poll().is_some();
    let pending = last.pending.take().filter(|_| !is_new);
    if !is_new && pending.is_none() {
        return None;
    }
    let (head, numbers) = lane.inbox.last();
    // no new request: answered before, or, with sequence 0, the client has just claimed its lane
    if head.sequence == last.sequence {
        return None;
    }
    let has_waited = pending.is_some();
    let start = pending.unwrap_or_else(|| clock.raw());
    engine.found(start, Client::Lane(place as u32));
    let timing = RequestTiming::new(clock, &head, start);
    let output = lane.outbox.numbers();
    let answer = match stopping {
        false => engine.answer_request(&head, place, Input::Copied(numbers), output, &timing),
        true => Some(refuse(&head, Status::ShuttingDown, output, &timing)),
    };
    last.pending = answer.is_none().then_some(start);
    let answer = answer?;
    last.sequence = head.sequence;
    lane.outbox.publish(answer);
    Some(Turn::of(Transport::Lane, &head, &answer, (start, has_waited)))
}

/// Polls a service.
#[inline]
fn poll_service(
    (port, pending): (&mut dyn ServedService, &mut Option<u64>),
    place: usize,
    engine: &mut Engine,
    clock: &Clock,
    stopping: bool,
) -> Option<Turn> {
    let transport = Transport::Service;
    let mut turn = None;
    // a request that is gone takes its time with it
    let before = pending.take();
    let is_found = port.answer(&mut |request, output| {
        let start = before.unwrap_or_else(|| clock.raw());
        *pending = Some(start);
        let head = request.head();
        engine.found(start, Client::Service);
        let timing = RequestTiming::new(clock, &head, start);
        let answer = match stopping {
            false => {
                engine.answer_request(&head, place, Input::Shared(request), output, &timing)?
            }
            true => refuse(&head, Status::ShuttingDown, output, &timing),
        };
        *pending = None;
        turn = Some(Turn::of(transport, &head, &answer, (start, before.is_some())));
        Some(answer)
    });
    // a request for whose answer there was no memory is counted too
    let status = Status::Overloaded as u32;
    is_found.then(|| {
        let start = clock.raw();
        turn.unwrap_or(Turn { transport, status, late: false, start, has_waited: false })
    })
}

/// The counted part of an answer.
struct Turn {
    transport: Transport,
    status: u32,
    late: bool,
    /// When its request was found.
    start: u64,
    /// Another thread computed its state.
    has_waited: bool,
}

impl Turn {
    #[inline]
    fn of(
        transport: Transport,
        request: &RequestHead,
        answer: &ResponseHead,
        (start, has_waited): (u64, bool),
    ) -> Turn {
        let late = answer.status == Status::Late as u32 || is_late(request, answer);
        Turn { transport, status: answer.status, late, start, has_waited }
    }
}

/// A span in ticks of the processor's counter.
fn ticks(clock: &Clock, span: Duration) -> u64 {
    // nanoseconds of a million ticks give the rate
    let ns_per_million = clock.delta_as_nanos(0, 1_000_000).max(1);
    (span.as_nanos() as u64).saturating_mul(1_000_000) / ns_per_million
}

#[cfg(test)]
mod tests;
