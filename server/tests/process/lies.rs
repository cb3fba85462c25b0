//! Clients that lie: whatever they write, the server answers with a status and lives.

use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use sarrus_client::{Status, Transport};
use sarrus_proto::board::{ClaimedLane, class_of};
use sarrus_proto::lane::{Threadsafe, send_request};
use sarrus_proto::message::{
    Call, ControlRequest, ControlResponse, MAX_NUMBERS_IN, Refusal, RequestHead, ResponseHead,
};
use sarrus_proto::service::{ControlClient, open_compute, open_control};
use sarrus_proto::{FieldSet, PROTOCOL_VERSION, Query, QueryOptions, ServerName};

use crate::support::{Asker, STATE, Sandbox};

pub(crate) fn call(client: &ControlClient, request: ControlRequest) -> ControlResponse {
    let pending = client.send_copy(request).unwrap();
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2) {
        if let Some(response) = pending.receive().unwrap() {
            return *response.payload();
        }
    }
    panic!("no answer");
}

pub(crate) fn request(call: u32) -> ControlRequest {
    ControlRequest {
        version: PROTOCOL_VERSION,
        call,
        fingerprint: 0,
        arguments: [0; 2],
        query: STATE,
    }
}

/// Says hello as any client does.
pub(crate) fn hello(node: &Node<Threadsafe>, name: &ServerName) -> ControlResponse {
    call(&open_control(node, name).unwrap(), request(Call::Hello as u32))
}

/// A lane, claimed.
pub(crate) fn lane(
    node: &Node<Threadsafe>,
    name: &ServerName,
    [n_in, n_out]: [usize; 2],
) -> ClaimedLane {
    let client = open_control(node, name).unwrap();
    let hello = call(&client, request(Call::Hello as u32));
    let granted = call(
        &client,
        ControlRequest { arguments: [n_in as u64, n_out as u64], ..request(Call::Lane as u32) },
    );
    let (id, class_in, class_out) = granted.lane();
    ClaimedLane::claim(node, name, hello.instance, id, [class_in, class_out]).unwrap()
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
fn lies_through_the_control_service_are_refused() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("liar", &["--lanes", "1"]);
    let name = ServerName::new("liar").unwrap();
    let node = sandbox.domain.node::<Threadsafe>().unwrap();
    let client = open_control(&node, &name).unwrap();

    let refusal = |request| Refusal::from_code(call(&client, request).refusal);
    let hello = request(Call::Hello as u32);
    assert_eq!(refusal(ControlRequest { version: 7, ..hello }), Some(Refusal::WrongVersion));
    assert_eq!(refusal(ControlRequest { fingerprint: 42, ..hello }), Some(Refusal::WrongModel));
    assert_eq!(refusal(request(0)), Some(Refusal::UnknownCall));
    assert_eq!(refusal(request(u32::MAX)), Some(Refusal::UnknownCall));
    for page in [1000, u64::MAX] {
        assert_eq!(
            refusal(ControlRequest { arguments: [page, 0], ..request(Call::Model as u32) }),
            Some(Refusal::NoSuchPage)
        );
    }

    // queries
    let plan = |query: Query| refusal(ControlRequest { query, ..request(Call::Plan as u32) });
    assert_eq!(plan(Query { request: 99, ..STATE }), Some(Refusal::BadQuery));
    assert_eq!(plan(Query { want: FieldSet(u64::MAX), ..STATE }), Some(Refusal::BadQuery));
    assert_eq!(plan(Query { options: QueryOptions(4), ..STATE }), Some(Refusal::BadQuery));
    assert_eq!(plan(Query { n_frames: u16::MAX, ..STATE }), Some(Refusal::BadQuery));
    assert_eq!(plan(Query { n_wrenches: 17, ..STATE }), Some(Refusal::BadQuery));
    assert_eq!(
        plan(Query { n_frames: 1, frames: [u16::MAX; 32], ..STATE }),
        Some(Refusal::BadQuery)
    );
    assert_eq!(plan(STATE), None);

    // lanes
    let lane = |arguments| refusal(ControlRequest { arguments, ..request(Call::Lane as u32) });
    assert_eq!(lane([u64::MAX, 1]), Some(Refusal::TooLarge));
    assert_eq!(lane([1, 16385]), Some(Refusal::TooLarge));
    // who attaches and never comes is forgotten in the end
    assert_eq!(lane([1, 16384]), None);
    assert_eq!(lane([1, 1]), Some(Refusal::NoLane));
    std::thread::sleep(Duration::from_millis(5300));
    assert_eq!(lane([1, 1]), None);
}

#[test]
fn lies_through_a_lane_get_their_status() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("lane", &[]);
    let name = ServerName::new("lane").unwrap();
    let mut honest = Asker::new(sandbox.connect("lane", Transport::Lane).unwrap());
    let n_in = honest.input.len();

    let node = sandbox.domain.node::<Threadsafe>().unwrap();
    let client = open_control(&node, &name).unwrap();
    let hello = call(&client, request(Call::Hello as u32));
    let granted = call(
        &client,
        ControlRequest {
            arguments: [n_in as u64, honest.output.len() as u64],
            ..request(Call::Lane as u32)
        },
    );
    let (id, class_in, class_out) = granted.lane();
    assert_eq!((Some(class_in), Some(class_out)), (class_of(n_in), class_of(honest.output.len())));
    let mut lane =
        ClaimedLane::claim(&node, &name, hello.instance, id, [class_in, class_out]).unwrap();
    // a lane is one client's
    assert!(ClaimedLane::claim(&node, &name, hello.instance, id, [class_in, class_out]).is_err());

    for (k, (head, numbers, status)) in lies(hello.fingerprint, n_in).into_iter().enumerate() {
        let head = RequestHead { sequence: k as u64 + 1, ..head };
        lane.outbox.numbers()[..n_in].copy_from_slice(&numbers);
        lane.outbox.publish(head);
        let start = Instant::now();
        let (answer, numbers) = loop {
            if let Some((answer, numbers)) = lane.inbox.poll() {
                break (answer, numbers.to_vec());
            }
            assert!(start.elapsed() < Duration::from_secs(2), "no answer to {head:?}");
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
    let small = call(&client, ControlRequest { arguments: [1, 1], ..request(Call::Lane as u32) });
    let (id, class_in, class_out) = small.lane();
    let mut lane =
        ClaimedLane::claim(&node, &name, hello.instance, id, [class_in, class_out]).unwrap();
    lane.outbox.publish(RequestHead {
        version: PROTOCOL_VERSION,
        plan: 0,
        fingerprint: hello.fingerprint,
        sequence: 1,
        ..RequestHead::default()
    });
    let start = Instant::now();
    let answer = loop {
        if let Some((answer, _)) = lane.inbox.poll() {
            break answer;
        }
        assert!(start.elapsed() < Duration::from_secs(2));
    };
    assert_eq!(answer.status, Status::WrongSize as u32);

    assert_eq!(honest.ask().unwrap().status, Status::Ok);
    drop((lane, client, node, honest));
    assert!(server.stop("-TERM").success());
}

#[test]
fn lies_through_the_service_get_their_status() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("transport", &[]);
    let name = ServerName::new("transport").unwrap();
    let mut honest = Asker::new(sandbox.connect("transport", Transport::Service).unwrap());
    let n_in = honest.input.len();
    let node = sandbox.domain.node::<Threadsafe>().unwrap();
    let hello = call(&open_control(&node, &name).unwrap(), request(Call::Hello as u32));
    let client = open_compute(&node, &name, hello.instance).unwrap();

    for (k, (head, mut numbers, status)) in lies(hello.fingerprint, n_in).into_iter().enumerate() {
        let head = RequestHead { sequence: k as u64 + 1, ..head };
        // more numbers than the plan takes mean nothing
        numbers.resize(MAX_NUMBERS_IN + 100, f64::NAN);
        let pending = send_request(&client, &head, &numbers).unwrap();
        let start = Instant::now();
        let answer = loop {
            if let Some(response) = pending.receive().unwrap() {
                break *response.payload();
            }
            assert!(start.elapsed() < Duration::from_secs(2), "no answer to {head:?}");
        };
        assert_eq!(
            (answer.head.status, answer.head.sequence),
            (status as u32, head.sequence),
            "{head:?}"
        );
        assert!(
            status == Status::Ok
                || answer.numbers[..honest.output.len()].iter().all(|number| number.is_nan()),
            "{head:?}"
        );
    }

    // one request at a time: a second one is not taken, and that is reported
    let head = RequestHead {
        version: PROTOCOL_VERSION,
        plan: 0,
        fingerprint: hello.fingerprint,
        sequence: 99,
        ..RequestHead::default()
    };
    let first = send_request(&client, &head, &vec![0.0; n_in]).unwrap();
    assert!(send_request(&client, &head, &vec![0.0; n_in]).is_none());
    drop(first);
    assert_eq!(honest.ask().unwrap().status, Status::Ok);
}
