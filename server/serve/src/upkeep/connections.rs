//! The clients of a run: each is a connection of the control socket with its plans and at most one
//! end (a lane or a service), and an area for batches beside it.
//!
//! A client's resources live as long as its connection. The kernel closes the connection when the
//! client dies; then the answering thread gives the end back, and the link is removed.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::ops::Range;
use std::os::fd::OwnedFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer};
use rustix::event::{PollFd, PollFlags, poll};
use sarrus_proto::batch::ServedBatch;
use sarrus_proto::board::ServedLane;
use sarrus_proto::control::{Holder, Refusal};
use sarrus_proto::message::{ClientStatistics, MAX_SERVICE_CLIENTS};
use sarrus_proto::run::{Link, Run};
use sarrus_proto::service::{ServedService, serve_compute};
use sarrus_proto::socket::{ControlListener, ControlSocket, timespec};
use tracing::info;

use crate::answering::batches::Batches;
use crate::answering::thread::{End, LastRequest, Order, Retired};
use crate::record::Client;
use crate::system::sigbus::replaced_pages;
use crate::upkeep::listener::Listener;
use crate::upkeep::quota::{RESERVED_CONNECTIONS, greatest, most_lanes};
use crate::upkeep::refusals::{failed, no_space, take_down};
use crate::upkeep::segment::Segment;

/// Additional connections without a lane or a service.
const MAX_OBSERVERS: usize = 64;
/// Time after which a silent client beyond the limit is disconnected if others wait.
const SILENCE: Duration = Duration::from_millis(100);
/// Longest wait of a client for an end that is being returned.
const HAND_BACK_TIME: Duration = Duration::from_millis(100);
/// Usual time in which the memory of a client is mapped; then its files are searched for an empty
/// one.
const CONNECT_TIME: Duration = Duration::from_millis(100);
/// Longest time in which it is mapped.
const LONGEST_CONNECT: Duration = Duration::from_secs(2);
/// Shared memory of a lane besides its numbers, and reserve for others `[byte]`.
const LANE_MARGIN: u64 = 256 << 10;
/// Shared memory that a service takes, and that stays free for others `[byte]`.
pub(crate) const SERVICE_NEEDS: u64 = 2 << 20;

/// Shared memory that a lane of these classes takes, and that stays free for others `[byte]`.
pub(crate) fn lane_needs(classes: [usize; 2]) -> u64 {
    2 * 8 * (classes[0] + classes[1]) as u64 + LANE_MARGIN
}

/// A client, from its connection on.
pub(crate) struct Connection {
    pub(crate) socket: ControlSocket,
    /// Its process, as the kernel knows it; 0 for one of another namespace.
    pub(crate) process: u32,
    /// The place of its end.
    place: Option<usize>,
    /// The time of its connection, if the server was full then: it gets only that refusal.
    pub(crate) surplus_since: Option<Instant>,
    /// To be disconnected at the next poll: the client has overwritten the transport's records, or
    /// is silent beyond the limit.
    pub(crate) is_over: bool,
    /// The server's port of a service whose client has not opened its own.
    unserved: Option<Box<dyn ServedService>>,
    /// Its area for batches, with the lifetime of its end.
    pub(crate) batches: Option<OwnedFd>,
}

/// All clients of a run.
pub(crate) struct Connections {
    pub(crate) listener: Listener,
    /// By their numbers in the table of plans.
    clients: BTreeMap<u64, Connection>,
    /// Connections so far.
    numbers: u64,
    /// Places of lanes, then of services; `None` where one is free.
    places: Vec<Option<Segment>>,
    /// Most clients with a lane.
    pub(crate) n_lanes: usize,
    orders: Producer<Order>,
    retired: Consumer<Retired>,
    pub(crate) lanes_made: u64,
}

impl Connections {
    pub(crate) fn new(
        listener: ControlListener,
        n_lanes: usize,
        orders: Producer<Order>,
        retired: Consumer<Retired>,
    ) -> Connections {
        let places = (0..Connections::places(n_lanes)).map(|_| None).collect();
        Connections {
            listener: Listener::new(listener),
            clients: BTreeMap::new(),
            numbers: 0,
            places,
            n_lanes,
            orders,
            retired,
            lanes_made: 0,
        }
    }

    /// Places of a server with this many lanes: two per possible end, so that no client waits for
    /// one that the answering thread is still returning.
    pub(crate) fn places(n_lanes: usize) -> usize {
        2 * (n_lanes + MAX_SERVICE_CLIENTS)
    }

    /// Number of connections that one process may hold.
    pub(crate) fn limit(&self) -> usize {
        self.n_lanes + MAX_SERVICE_CLIENTS + MAX_OBSERVERS
    }

    /// Number of lanes that clients hold or that are being returned, up to the limit.
    pub(crate) fn lanes_taken(&self) -> usize {
        self.places[self.lanes()].iter().flatten().count().min(self.n_lanes)
    }

    /// The places of lanes.
    fn lanes(&self) -> Range<usize> {
        0..2 * self.n_lanes
    }

    /// Number of these places that clients hold.
    fn taken(&self, among: Range<usize>) -> usize {
        self.places[among].iter().flatten().filter(|place| !place.is_leaving).count()
    }

    /// Statistics of each client; `plans` and `late` give its counts.
    pub(crate) fn clients(
        &self,
        plans: impl Fn(u64) -> usize,
        late: impl Fn(usize) -> u64,
    ) -> Vec<ClientStatistics> {
        let of = |(number, client): (&u64, &Connection)| ClientStatistics {
            process: client.process.into(),
            end: match client.place {
                None => "none",
                Some(place) if self.lanes().contains(&place) => "lane",
                Some(_) => "service",
            }
            .to_owned(),
            plans: plans(*number) as u64,
            late: client.place.map_or(0, &late),
        };
        self.clients.iter().map(of).collect()
    }

    /// Clients that are not refused.
    fn served(&self) -> impl Iterator<Item = &Connection> {
        self.clients.values().filter(|client| client.surplus_since.is_none())
    }

    /// Clients with an end in these places.
    fn holders(&self, among: Range<usize>) -> impl Iterator<Item = &Connection> {
        let holds = move |place: usize| among.contains(&place);
        self.clients.values().filter(move |client| client.place.is_some_and(&holds))
    }

    /// The process that holds most lanes, services or connections, where these are refused.
    pub(crate) fn greatest_holder(&self, refusal: &Refusal) -> Option<Holder> {
        let lanes = self.lanes();
        let process = |client: &Connection| client.process;
        match refusal {
            Refusal::NoLane { .. } => greatest(self.holders(lanes).map(process)),
            Refusal::NoService { .. } => {
                greatest(self.holders(lanes.end..self.places.len()).map(process))
            }
            Refusal::TooManyClients { .. } => greatest(self.served().map(process)),
            _ => None,
        }
    }

    pub(crate) fn get(&self, number: u64) -> Option<&Connection> {
        self.clients.get(&number)
    }

    /// Waits until a client connects, sends or closes, at most for `span`; the numbers of the
    /// clients that sent or closed.
    pub(crate) fn wait(&mut self, span: Duration) -> Vec<u64> {
        let leaving = self.places.iter().flatten().any(|place| place.is_leaving);
        let span = if leaving { span.min(Duration::from_millis(1)) } else { span };
        let room = self.room();
        let mut descriptors: Vec<PollFd<'_>> = Vec::with_capacity(self.clients.len() + 1);
        descriptors.push(self.listener.awaited(room));
        descriptors
            .extend(self.clients.values().map(|client| PollFd::new(&client.socket, PollFlags::IN)));
        // an interrupted wait is a short one
        let _ = poll(&mut descriptors, Some(&timespec(span)));
        let news = |descriptor: &PollFd<'_>| !descriptor.revents().is_empty();
        let new_clients = news(&descriptors[0]);
        let clients = descriptors[1..].iter().zip(&self.clients);
        let ready = clients.filter(|(one, (_, client))| news(one) || client.is_over);
        let ready = ready.map(|(_, (number, _))| *number).collect();
        if new_clients {
            for socket in self.listener.take(room) {
                self.numbers += 1;
                let process = socket.peer().map_or(0, |peer| peer.process);
                let served = self.served().count();
                let own = self.served().filter(|client| client.process == process).count();
                let limit = self.limit();
                let is_surplus = own >= limit || served >= limit + RESERVED_CONNECTIONS;
                info!(client = self.numbers, process, "attached");
                let client = Connection {
                    socket,
                    process,
                    place: None,
                    surplus_since: is_surplus.then(Instant::now),
                    is_over: false,
                    unserved: None,
                    batches: None,
                };
                self.clients.insert(self.numbers, client);
            }
        }
        ready
    }

    /// Number of further clients to accept: beyond the limit each is refused at its first call, and
    /// far beyond it they wait until an earlier one is refused.
    fn room(&mut self) -> usize {
        let most = 2 * (self.limit() + RESERVED_CONNECTIONS);
        let room = most.saturating_sub(self.clients.len());
        if room == 0 {
            let is_silent = |since: Instant| since.elapsed() > SILENCE;
            for client in self.clients.values_mut() {
                client.is_over |= client.surplus_since.is_some_and(is_silent);
            }
        }
        room
    }

    /// Ends a connection and gives its end back.
    pub(crate) fn close(&mut self, number: u64) {
        self.give_back(number);
        if self.clients.remove(&number).is_some() {
            info!(client = number, "detached");
        }
    }

    /// Frees the ends that the answering thread has returned; call it often.
    pub(crate) fn collect(&mut self) {
        while let Ok((index, end)) = self.retired.pop() {
            if let End::Batches(batches) = end {
                batches.release();
                continue; // its place is that of another end
            }
            if matches!(end, End::Broken) {
                let mut clients = self.clients.values_mut();
                if let Some(client) = clients.find(|client| client.place == Some(index)) {
                    (client.place, client.is_over) = (None, true);
                }
                // also an area for batches granted since then
                let _ = self.orders.push(Order::Retire { place: index });
            }
            // not on the answering thread: unmapping is a system call
            take_down(end);
            self.free(index);
        }
    }

    fn free(&mut self, index: usize) {
        self.places[index].take().into_iter().for_each(Segment::free);
    }

    fn give_back(&mut self, number: u64) {
        let Some(client) = self.clients.get_mut(&number) else { return };
        let Some(index) = client.place.take() else { return };
        client.batches = None;
        match client.unserved.take() {
            Some(port) => {
                take_down(port);
                self.free(index);
            }
            None => {
                // room for all orders of a place: full means that the answering thread is gone
                let _ = self.orders.push(Order::Retire { place: index });
                if let Some(place) = &mut self.places[index] {
                    place.is_leaving = true;
                }
            }
        }
    }

    /// Revokes a client's end and waits until the answering thread no longer polls it.
    pub(crate) fn leave(&mut self, number: u64) {
        let place = self.clients.get(&number).and_then(|client| client.place);
        self.give_back(number);
        let start = Instant::now();
        let is_leaving = |places: &[Option<Segment>], index: usize| {
            places[index].as_ref().is_some_and(|place| place.is_leaving)
        };
        while place.is_some_and(|index| is_leaving(&self.places, index))
            && start.elapsed() < HAND_BACK_TIME
        {
            std::thread::sleep(Duration::from_micros(100));
            self.collect();
        }
    }

    /// Makes a lane for a client, in place of its present end; the number of the link.
    pub(crate) fn make_lane(
        &mut self,
        run: &Run,
        number: u64,
        classes: [usize; 2],
    ) -> Result<u64, Refusal> {
        self.give_back(number);
        let process = self.clients.get(&number).map(|client| client.process);
        let own = self.holders(self.lanes()).filter(|client| Some(client.process) == process);
        let limit = most_lanes(self.n_lanes);
        if own.count() >= limit {
            return Err(Refusal::NoLane { limit });
        }
        let limit = self.n_lanes;
        let index = self.free_place(self.lanes()).ok_or(Refusal::NoLane { limit })?;
        let (name, place, lane) = Segment::make(run, lane_needs(classes), |node, link| {
            let mut lane = ServedLane::create(node, classes).map_err(|error| failed(&error))?;
            link.reserve(true).map_err(|error| no_space(&error))?;
            lane.map();
            Ok(lane)
        })?;
        self.places[index] = Some(place);
        self.lanes_made += 1;
        self.serve(number, index, End::Lane(lane, LastRequest::default()))?;
        Ok(name)
    }

    /// Makes the server's side of a service for a client, in place of its present end.
    pub(crate) fn make_service(&mut self, run: &Run, number: u64) -> Result<u64, Refusal> {
        self.give_back(number);
        let services = self.lanes().end..self.places.len();
        let index =
            self.free_place(services).ok_or(Refusal::NoService { limit: MAX_SERVICE_CLIENTS })?;
        let (name, place, port) = Segment::make(run, SERVICE_NEEDS, |node, link| {
            let port = serve_compute(node).map_err(|error| failed(&error))?;
            link.reserve(false).map_err(|error| no_space(&error))?;
            Ok(port)
        })?;
        self.places[index] = Some(place);
        if let Some(client) = self.clients.get_mut(&number) {
            (client.place, client.unserved) = (Some(index), Some(port));
        }
        Ok(name)
    }

    /// The client has opened its side of the service: maps its memory on this thread, and has the
    /// answering thread poll it.
    pub(crate) fn serve_service(&mut self, number: u64) -> Result<(), Refusal> {
        let client = self.clients.get_mut(&number).ok_or(Refusal::NoEnd)?;
        let (Some(index), Some(port)) = (client.place, client.unserved.take()) else {
            return Err(Refusal::NoEnd);
        };
        let pages = replaced_pages();
        let Some(place) = &mut self.places[index] else { return Err(Refusal::NoEnd) };
        let outcome = connected(port, &place.link).and_then(|port| {
            match place.link.reserve(true) {
                Ok(()) if replaced_pages() == pages => Ok(port),
                // without an error a page was missing meanwhile: the port is damaged
                reserved => {
                    take_down(port);
                    Err(no_space(&reserved.err().unwrap_or(ErrorKind::StorageFull.into())))
                }
            }
        });
        match outcome {
            Ok(port) => self.serve(number, index, End::Service(port, None)),
            Err(refusal) => {
                client.place = None;
                self.free(index);
                Err(refusal)
            }
        }
    }

    /// Makes an area for batches beside a client's end, if there is none yet.
    pub(crate) fn make_batches(&mut self, number: u64) -> Result<(), Refusal> {
        let lanes = self.lanes();
        let client = self.clients.get_mut(&number).ok_or(Refusal::NoEnd)?;
        let (Some(place), None) = (client.place, &client.unserved) else {
            return Err(Refusal::NoEnd);
        };
        if client.batches.is_none() {
            let (area, memory) = ServedBatch::create().map_err(|error| no_space(&error))?;
            let is_lane = lanes.contains(&place);
            let who = if is_lane { Client::Lane(place as u32) } else { Client::Service };
            let end = End::Batches(Batches::new(area, who));
            self.orders.push(Order::Serve { place, end }).map_err(|_| Refusal::Stopping)?;
            client.batches = Some(memory);
        }
        Ok(())
    }

    fn serve(&mut self, number: u64, index: usize, end: End) -> Result<(), Refusal> {
        if self.orders.push(Order::Serve { place: index, end }).is_err() {
            self.free(index);
            return Err(Refusal::Stopping);
        }
        if let Some(client) = self.clients.get_mut(&number) {
            client.place = Some(index);
        }
        Ok(())
    }

    /// A free place among these; clients hold at most half of them.
    fn free_place(&mut self, among: Range<usize>) -> Option<usize> {
        self.collect();
        if 2 * self.taken(among.clone()) >= among.len() {
            return None;
        }
        let start = Instant::now();
        loop {
            let free = self.places[among.clone()].iter().position(Option::is_none);
            // clients came and went faster than the answering thread returns ends
            if free.is_some() || start.elapsed() > HAND_BACK_TIME {
                return free.map(|index| among.start + index);
            }
            std::thread::sleep(Duration::from_micros(200));
            self.collect();
        }
    }
}

/// Maps the memory of a client that has opened its side of a service; a request cannot have come
/// yet, and is dropped. The transport waits for ever for the first byte of a file that the client
/// emptied: a thread of its own waits, and ends when the link is removed.
fn connected(
    mut port: Box<dyn ServedService>,
    link: &Link,
) -> Result<Box<dyn ServedService>, Refusal> {
    let (done, outcome) = mpsc::channel();
    let connect = move || {
        // dropping it could panic again
        if catch_unwind(AssertUnwindSafe(|| port.connect())).is_err() {
            return std::mem::forget(port);
        }
        // too late: dropped here
        if let Err(late) = done.send(port) {
            take_down(late);
        }
    };
    let thread = thread::Builder::new().name("sarrus-connect".to_owned()).spawn(connect);
    thread.map_err(|error| failed(&error))?;
    let start = Instant::now();
    loop {
        match outcome.recv_timeout(CONNECT_TIME) {
            Ok(port) => return Ok(port),
            // it may only lack a processor
            Err(RecvTimeoutError::Timeout)
                if start.elapsed() < LONGEST_CONNECT && !link.has_empty_file() => {}
            Err(_) => return Err(Refusal::NoEnd),
        }
    }
}

#[cfg(test)]
mod tests;
