//! The floor: the same bytes there and back through shared memory, with nothing but atomic words
//! between two processes that poll.
//!
//! Each process writes into a request of its own that the other one holds: mapped once, then
//! neither the transport nor the system takes part. A sequence number marks the numbers before it
//! as complete.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicBool, Ordering::*, fence};
use std::time::{Duration, Instant};

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::node::Node;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::ipc::Service;
use iceoryx2::prelude::{NodeBuilder, ServiceName};
use sarrus_benches::cores::Cores;
use sarrus_proto::Domain;
use sarrus_proto::message::{ComputeRequest, RequestHead};
use sarrus_proto::run::Link;
use sarrus_report::Outcome;

use crate::child::{Child, Role};

/// How long the two processes wait for each other.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// How often the near end looks before it gives the other one up: some seconds.
const SPINS: u64 = 1 << 27;
/// Numbers that one message can carry.
const MOST: usize = 64;
/// The links of the two processes.
const NEAR: u64 = 1;
const FAR: u64 = 2;

type Receiver = Server<Service, ComputeRequest, (), u64, ()>;
type Sender = Client<Service, ComputeRequest, (), u64, ()>;

/// The node of one process in the other's or its own link.
fn node(domain: &Domain, link: u64) -> Outcome<Node<Service>> {
    let link = Link::new(domain, 0, link)?;
    let builder = NodeBuilder::new().config(link.config());
    Ok(builder.create().map_err(|error| format!("{error:?}"))?)
}

fn name() -> Outcome<ServiceName> {
    Ok(ServiceName::new("floor").map_err(|error| format!("{error:?}"))?)
}

fn serve(node: &Node<Service>) -> Outcome<Receiver> {
    let builder = node.service_builder(&name()?).request_response::<ComputeRequest, u64>();
    let factory = builder.create().map_err(|error| format!("{error:?}"))?;
    Ok(factory.server_builder().create().map_err(|error| format!("{error:?}"))?)
}

fn open(node: &Node<Service>) -> Outcome<Sender> {
    let builder = node.service_builder(&name()?).request_response::<ComputeRequest, u64>();
    let factory = builder.open().map_err(|error| format!("{error:?}"))?;
    Ok(factory.client_builder().create().map_err(|error| format!("{error:?}"))?)
}

/// Sends a request with this process's words, if the other end takes it.
fn send(client: &Sender) -> Option<PendingResponse<Service, ComputeRequest, (), u64, ()>> {
    let request = client.loan_uninit().ok()?.write_payload(ComputeRequest::default());
    request.send().ok().filter(|pending| pending.number_of_server_connections() > 0)
}

/// One end: the memory that this process writes, the memory it reads, and the owners of both
/// mappings.
struct End {
    mine: PendingResponse<Service, ComputeRequest, (), u64, ()>,
    theirs: ActiveRequest<Service, ComputeRequest, (), u64, ()>,
    _ports: (Receiver, Sender, [Node<Service>; 2]),
}

impl End {
    /// Meets the other end; `opened` is called once it can come.
    fn meet(
        domain: &Domain,
        [mine, theirs]: [u64; 2],
        opened: impl FnOnce() -> Outcome,
    ) -> Outcome<End> {
        let node = node(domain, mine)?;
        let server = serve(&node)?;
        opened()?;
        let other = self::node(domain, theirs)?;
        let start = Instant::now();
        let late = || start.elapsed() > LONGEST_WAIT;
        let client = loop {
            match open(&other) {
                Ok(client) => break client,
                Err(error) if late() => return Err(error),
                Err(_) => std::thread::sleep(Duration::from_millis(1)),
            }
        };
        let mut sent = None;
        let mut received = None;
        loop {
            if sent.is_none() {
                sent = send(&client);
            }
            if received.is_none() {
                received = server.receive().map_err(|error| format!("{error:?}"))?;
            }
            match (sent, received) {
                (Some(mine), Some(theirs)) => {
                    return Ok(End { mine, theirs, _ports: (server, client, [node, other]) });
                }
                _ if late() => return Err("the other end of the floor does not come".into()),
                (s, r) => (sent, received) = (s, r),
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Gives numbers to the other end, with their count and the count of the reply.
    #[inline]
    fn post(&self, sequence: u64, numbers: &[f64], n_back: usize) {
        let words: &ComputeRequest = self.mine.payload();
        let head = RequestHead {
            version: numbers.len() as u32,
            plan: n_back as u32,
            sequence: sequence - 1,
            ..RequestHead::default()
        };
        words.write(&head, numbers);
        // SYNC POINT: floor (the other end is `take`)
        fence(Release);
        words.write(&RequestHead { sequence, ..head }, &[]);
    }

    /// The other end's numbers once they are there: how many, and how many are to go back.
    #[inline]
    fn take(&self, sequence: u64, numbers: &mut [f64; MOST]) -> Option<(usize, usize)> {
        let words: &ComputeRequest = self.theirs.payload();
        let head = words.head();
        if head.sequence != sequence {
            return None;
        }
        // SYNC POINT: floor (the other end is `post`)
        fence(Acquire);
        let count = (head.version as usize).min(MOST);
        words.read(&mut numbers[..count]);
        Some((count, (head.plan as usize).min(MOST)))
    }
}

/// The end that measures.
pub(crate) struct Near {
    end: End,
    child: Child,
    sequence: u64,
    back: [f64; MOST],
}

impl Near {
    /// Starts the other process.
    pub(crate) fn start(domain: &Domain, cores: &Cores) -> Outcome<Near> {
        let mut child = None;
        let end = End::meet(domain, [NEAR, FAR], || {
            child = Some(Child::start(Role::Floor, domain, cores, None)?);
            Ok(())
        })?;
        let child = child.ok_or("the floor's other process is not there")?;
        Ok(Near { end, child, sequence: 0, back: [0.0; MOST] })
    }

    /// One round trip: `input` there, the first `n_out` of its numbers back.
    #[inline]
    pub(crate) fn trip(&mut self, input: &[f64], n_out: usize) -> Outcome {
        self.sequence += 1;
        self.end.post(self.sequence, input, n_out);
        let mut spins = 0_u64;
        loop {
            match self.end.take(self.sequence, &mut self.back) {
                Some((count, _)) if self.back[..count] == input[..n_out] => return Ok(()),
                Some(_) => return Err("the floor sends back other numbers".into()),
                None if spins > SPINS => return Err("the other end of the floor is gone".into()),
                None => spins += 1,
            }
            spin_loop();
        }
    }

    pub(crate) fn stop(self) -> Outcome {
        self.child.stop()
    }
}

/// The other end, until it is stopped.
pub(crate) fn far(stop: &AtomicBool) -> Outcome {
    let domain = Domain::of_user()?;
    let end = End::meet(&domain, [FAR, NEAR], || {
        println!("ready");
        Ok(())
    })?;
    let mut numbers = [0.0; MOST];
    let mut sequence = 1;
    while !stop.load(Relaxed) {
        if let Some((_, n_back)) = end.take(sequence, &mut numbers) {
            end.post(sequence, &numbers[..n_back], 0);
            sequence += 1;
        }
        spin_loop();
    }
    Ok(())
}
