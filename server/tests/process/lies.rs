//! Clients that lie: whatever they write, the server answers with a status and lives.

use std::os::fd::OwnedFd;
use std::time::Instant;

use sarrus_client::{Status, Transport};
use sarrus_proto::batch::ClaimedBatch;
use sarrus_proto::board::{ClaimedLane, class_of};
use sarrus_proto::control::{Call, CallHead, ControlRequest, Grant, Refusal, exchange};
use sarrus_proto::message::{MAX_NUMBERS_IN, PlanNumber, RequestHead, ResponseHead};
use sarrus_proto::run::Link;
use sarrus_proto::service::{OpenedService, open_compute};
use sarrus_proto::socket::{ControlSocket, MAX_MESSAGE};
use sarrus_proto::{FieldSet, Node, PROTOCOL_VERSION, Query, QueryOptions, ServerName};

use sarrus_torture::patience::{LIMIT, deadline};

use crate::support::{Asker, STATE, Sandbox};

/// A client that says whatever a test likes.
pub(crate) struct Liar<'a> {
    sandbox: &'a Sandbox,
    pub(crate) socket: ControlSocket,
    pub(crate) fingerprint: u64,
    instance: u64,
}

impl Liar<'_> {
    pub(crate) fn new<'a>(sandbox: &'a Sandbox, name: &str) -> Liar<'a> {
        let name = ServerName::new(name).unwrap();
        let folder = sandbox.domain.server_folders(&name).next().unwrap();
        let socket = ControlSocket::connect(&folder).unwrap();
        let mut liar = Liar { sandbox, socket, fingerprint: 0, instance: 0 };
        let request = ControlRequest { head: head(), fingerprint: 0, call: Call::Hello };
        let (hello, descriptor) = exchange(&liar.socket, &request, deadline()).unwrap();
        assert!(descriptor.is_some() && matches!(hello.outcome, Ok(Grant::Hello { .. })));
        (liar.fingerprint, liar.instance) = (hello.fingerprint, hello.instance);
        liar
    }

    /// The head of a request for the plan of this number.
    pub(crate) fn head(&self, plan: u32, sequence: u64) -> RequestHead {
        let (version, fingerprint) = (PROTOCOL_VERSION, self.fingerprint);
        RequestHead { version, plan, fingerprint, sequence, ..RequestHead::default() }
    }

    pub(crate) fn call(&self, call: Call) -> Result<Grant, Refusal> {
        self.send(&ControlRequest { head: head(), fingerprint: 0, call })
    }

    fn send(&self, request: &ControlRequest) -> Result<Grant, Refusal> {
        exchange(&self.socket, request, deadline()).unwrap().0.outcome
    }

    /// What the server says to a message that is no call.
    fn raw(&self, message: &[u8]) -> Refusal {
        self.socket.send(message, None).unwrap();
        let mut buffer = vec![0; MAX_MESSAGE];
        assert!(self.socket.wait(deadline()).unwrap());
        let (bytes, _) = self.socket.receive(&mut buffer).unwrap().unwrap();
        let response = sarrus_proto::control::ControlResponse::from_bytes(&buffer[..bytes]);
        response.unwrap().outcome.unwrap_err()
    }

    pub(crate) fn plan(&self, query: Query) -> Result<PlanNumber, Refusal> {
        match self.call(Call::Plan { query: Box::new(query) })? {
            Grant::Plan { number, .. } => Ok(number),
            other => panic!("{other:?}"),
        }
    }

    /// A lane, claimed.
    pub(crate) fn lane(&self, [n_in, n_out]: [usize; 2]) -> (Node, ClaimedLane) {
        let granted = self.call(Call::Lane { n_in, n_out }).unwrap();
        let Grant::Lane { link, class_in, class_out } = granted else { panic!("{granted:?}") };
        assert_eq!((Some(class_in), Some(class_out)), (class_of(n_in), class_of(n_out)));
        let node = self.link(link);
        let lane = ClaimedLane::claim(&node, [class_in, class_out]).unwrap();
        // a lane is one client's
        assert!(ClaimedLane::claim(&node, [class_in, class_out]).is_err());
        (node, lane)
    }

    pub(crate) fn service(&self) -> (Node, Box<dyn OpenedService>) {
        let granted = self.call(Call::Service).unwrap();
        let Grant::Service { link } = granted else { panic!("{granted:?}") };
        let node = self.link(link);
        let client = open_compute(&node).unwrap();
        assert_eq!(self.call(Call::Serve), Ok(Grant::Served));
        (node, client)
    }

    /// The area for batches.
    pub(crate) fn batches(&self) -> ClaimedBatch {
        ClaimedBatch::open(&self.area()).unwrap()
    }

    /// Its descriptor.
    pub(crate) fn area(&self) -> OwnedFd {
        let request = ControlRequest { head: head(), fingerprint: 0, call: Call::Batch };
        let (response, memory) = exchange(&self.socket, &request, deadline()).unwrap();
        assert_eq!(response.outcome, Ok(Grant::Batch));
        memory.unwrap()
    }

    fn link(&self, number: u64) -> Node {
        Link::new(&self.sandbox.domain, self.instance, number).unwrap().node().unwrap()
    }
}

fn head() -> CallHead {
    CallHead { version: PROTOCOL_VERSION, nonce: 7 }
}

/// Heads that lie, what they should get, and numbers that go with them.
fn lies(fingerprint: u64, n_in: usize) -> Vec<(RequestHead, Vec<f64>, Status)> {
    let good = RequestHead { version: PROTOCOL_VERSION, fingerprint, ..RequestHead::default() };
    let zero = vec![0.0; n_in];
    let with = |k: usize, number: f64| {
        (0..n_in).map(|i| if i == k { number } else { 0.0 }).collect::<Vec<f64>>()
    };
    vec![
        (RequestHead { version: 0, ..good }, zero.clone(), Status::BadRequest),
        (RequestHead { version: PROTOCOL_VERSION + 1, ..good }, zero.clone(), Status::BadRequest),
        (RequestHead { fingerprint: fingerprint ^ 1, ..good }, zero.clone(), Status::WrongModel),
        (RequestHead { plan: 1, ..good }, zero.clone(), Status::UnknownRequest),
        (RequestHead { plan: 1023, ..good }, zero.clone(), Status::UnknownRequest),
        (RequestHead { plan: 1024, ..good }, zero.clone(), Status::UnknownRequest),
        (RequestHead { plan: u32::MAX, ..good }, zero.clone(), Status::UnknownRequest),
        (good, with(0, f64::NAN), Status::NonFiniteInput),
        (good, with(n_in - 1, f64::INFINITY), Status::NonFiniteInput),
        (good, with(n_in / 2, f64::from_bits(0x7ff0_0000_0000_0001)), Status::NonFiniteInput),
        (good, zero, Status::Ok),
    ]
}

#[test]
fn lies_through_the_control_socket_are_refused() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("liar", &["--lanes", "1"]);
    let liar = Liar::new(&sandbox, "liar");

    let hello = || ControlRequest { head: head(), fingerprint: 0, call: Call::Hello };
    let other = CallHead { version: PROTOCOL_VERSION + 1, nonce: 9 };
    let refusal = |request| liar.send(&request).unwrap_err();
    assert_eq!(refusal(ControlRequest { head: other, ..hello() }), Refusal::WrongVersion);
    assert_eq!(refusal(ControlRequest { fingerprint: 42, ..hello() }), Refusal::WrongModel);
    for page in [1000, usize::MAX] {
        assert_eq!(liar.call(Call::Model { page }), Err(Refusal::NoSuchPage));
    }
    let deep = "[".repeat(10_000);
    for garbage in ["{", "\0", &deep, "{\"version\":7,\"nonce\":1}", "null"] {
        assert_eq!(liar.raw(garbage.as_bytes()), Refusal::UnknownCall);
    }

    // queries
    for bad in [
        Query { request: 99, ..STATE },
        Query { want: FieldSet(u64::MAX), ..STATE },
        Query { options: QueryOptions(4), ..STATE },
        Query { n_frames: u16::MAX, ..STATE },
        Query { n_wrenches: 17, ..STATE },
        Query { n_frames: 1, frames: [u16::MAX; 32], ..STATE },
        Query { n_joint_runs: 32, ..STATE },
        Query { n_joint_runs: 1, joints: [[0, u16::MAX]; 31], ..STATE },
        Query { n_joint_runs: 1, ..STATE },
        Query { n_joint_runs: 2, joints: [[0, 1]; 31], ..STATE },
    ] {
        assert!(matches!(liar.plan(bad), Err(Refusal::BadQuery { .. })), "{bad:?}");
    }
    assert!(liar.plan(STATE).is_ok());

    // lanes and services
    let lane = |n_in, n_out| liar.call(Call::Lane { n_in, n_out });
    assert_eq!(liar.call(Call::Serve), Err(Refusal::NoEnd));
    assert!(matches!(lane(usize::MAX, 1), Err(Refusal::TooLarge { .. })));
    assert!(matches!(lane(1, 16385), Err(Refusal::TooLarge { .. })));
    assert!(lane(1, 16384).is_ok());
    let second = Liar::new(&sandbox, "liar");
    assert_eq!(second.call(Call::Lane { n_in: 1, n_out: 1 }), Err(Refusal::NoLane { limit: 1 }));
    // another end replaces the one before
    assert!(liar.call(Call::Service).is_ok());
    assert!(second.call(Call::Lane { n_in: 1, n_out: 1 }).is_ok());
    assert_eq!(liar.call(Call::Serve), Ok(Grant::Served));
    assert_eq!(liar.call(Call::Serve), Err(Refusal::NoEnd));

    // what is longer than any message ends the connection, and nobody else's
    assert!(liar.socket.send(&vec![b' '; MAX_MESSAGE + 1], None).is_ok());
    let start = Instant::now();
    while !liar.socket.is_closed() {
        assert!(start.elapsed() < LIMIT);
    }
    assert!(second.plan(STATE).is_ok());
}

#[test]
fn lies_through_a_lane_get_their_status() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("lane", &[]);
    let mut honest = Asker::new(sandbox.connect("lane", Transport::Lane).unwrap());
    let n_in = honest.input.len();

    let liar = Liar::new(&sandbox, "lane");
    let (node, mut lane) = liar.lane([n_in, honest.output.len()]);
    for (k, (head, numbers, status)) in lies(liar.fingerprint, n_in).into_iter().enumerate() {
        let head = RequestHead { sequence: k as u64 + 1, ..head };
        lane.outbox.numbers()[..n_in].copy_from_slice(&numbers);
        lane.outbox.publish(head);
        let start = Instant::now();
        let (answer, numbers) = loop {
            if let Some((answer, numbers)) = lane.inbox.poll() {
                break (answer, numbers.to_vec());
            }
            assert!(start.elapsed() < LIMIT, "no answer to {head:?}");
        };
        assert_eq!(
            answer,
            ResponseHead {
                status: status as u32,
                warnings: answer.warnings,
                sequence: head.sequence,
                ..ResponseHead::default()
            },
            "{head:?}"
        );
        assert!(
            status == Status::Ok
                || numbers[..honest.output.len()].iter().all(|number| number.is_nan()),
            "{head:?}"
        );
    }

    // a lane that is too small for another client's plan
    drop((lane, node));
    let (node, mut lane) = liar.lane([1, 1]);
    lane.outbox.publish(liar.head(0, 1));
    let start = Instant::now();
    let answer = loop {
        if let Some((answer, _)) = lane.inbox.poll() {
            break answer;
        }
        assert!(start.elapsed() < LIMIT);
    };
    assert_eq!(answer.status, Status::WrongSize as u32);

    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    drop((lane, node, liar, honest));
    assert!(server.stop("-TERM").success());
}

#[test]
fn lies_through_the_service_get_their_status() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("transport", &[]);
    let mut honest = Asker::new(sandbox.connect("transport", Transport::Service).unwrap());
    let n_in = honest.input.len();
    let liar = Liar::new(&sandbox, "transport");
    let (_node, mut client) = liar.service();

    for (k, (head, mut numbers, status)) in lies(liar.fingerprint, n_in).into_iter().enumerate() {
        let head = RequestHead { sequence: k as u64 + 1, ..head };
        // more numbers than the plan takes mean nothing
        numbers.resize(MAX_NUMBERS_IN + 100, f64::NAN);
        assert!(client.send(&head, &numbers));
        let start = Instant::now();
        let (answer, numbers) = loop {
            if let Some((answer, numbers)) = client.poll().unwrap() {
                break (answer, numbers.to_vec());
            }
            assert!(start.elapsed() < LIMIT, "no answer to {head:?}");
        };
        client.cancel();
        assert_eq!((answer.status, answer.sequence), (status as u32, head.sequence), "{head:?}");
        assert!(
            status == Status::Ok
                || numbers[..honest.output.len()].iter().all(|number| number.is_nan()),
            "{head:?}"
        );
    }

    // one request at a time: a second one is not taken, and that is reported
    let head = liar.head(0, 99);
    assert!(client.send(&head, &vec![0.0; n_in]));
    assert!(!client.send(&head, &vec![0.0; n_in]));
    client.cancel();
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
}
