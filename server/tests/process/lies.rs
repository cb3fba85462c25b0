//! Clients that lie: the server answers every lie with a status and goes on.

use std::time::Instant;

use sarrus_client::{Status, Transport};
use sarrus_proto::board::{ClaimedLane, class_of};
use sarrus_proto::control::{Call, CallHead, ControlRequest, ControlResponse, Grant, Refusal};
use sarrus_proto::message::{
    MAX_NUMBERS_IN, RequestHead, ResponseHead, load_numbers, store_numbers,
};
use sarrus_proto::run::Run;
use sarrus_proto::socket::MAX_MESSAGE;
use sarrus_proto::{FieldSet, PROTOCOL_VERSION, Query, QueryOptions, ServerName, TaskParts};

use sarrus_torture::patience::{LIMIT, deadline, poll};
use sarrus_torture::raw::Raw;

use crate::support::{Asker, STATE, Sandbox};

/// Calls of a client of version 7, and the refusal of its server.
const VERSION_7: &str = include_str!("../../../tests/vectors/wire/version_7.jsonl");

/// The refusal of a message that is no call.
fn refusal_of(raw: &Raw, message: &[u8]) -> Refusal {
    raw.socket.send(message, None).unwrap();
    let mut buffer = vec![0; MAX_MESSAGE];
    assert!(raw.socket.wait(deadline()).unwrap());
    let (bytes, _) = raw.socket.receive(&mut buffer).unwrap().unwrap();
    let response = ControlResponse::from_bytes(&buffer[..bytes]);
    response.unwrap().outcome.unwrap_err()
}

/// Heads that lie, their numbers and the statuses of their answers.
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
fn a_client_names_both_versions_where_the_server_has_version_7() {
    let sandbox = Sandbox::new();
    sandbox.make_root();
    let run = Run::start(sandbox.domain(), &ServerName::new("old").unwrap()).unwrap();
    let listener = run.listen().unwrap();
    let server = std::thread::spawn(move || {
        let client = poll(|| listener.accept().unwrap()).unwrap();
        let mut call = vec![0; MAX_MESSAGE];
        assert!(client.wait(deadline()).unwrap());
        client.receive(&mut call).unwrap().unwrap();
        client.send(VERSION_7.lines().last().unwrap().as_bytes(), None).unwrap();
        client
    });
    let refused = sandbox.connect("old", Transport::Lane).err().unwrap().to_string();
    let both = format!("protocol version 7, expected {PROTOCOL_VERSION}");
    assert!(refused.contains(&both), "{refused}");
    drop(server.join().unwrap());
}

#[test]
fn lies_through_the_control_socket_are_refused() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("liar", &["--lanes", "1"]);
    let liar = sandbox.raw("liar");

    let hello = || liar.request(Call::Hello);
    for call in VERSION_7.lines().take(4) {
        assert_eq!(refusal_of(&liar, call.as_bytes()), Refusal::WrongVersion);
    }
    let other = CallHead { version: PROTOCOL_VERSION + 1, nonce: 9 };
    let refusal = |request| liar.send(&request).unwrap().unwrap_err();
    assert_eq!(refusal(ControlRequest { head: other, ..hello() }), Refusal::WrongVersion);
    assert_eq!(refusal(ControlRequest { fingerprint: 42, ..hello() }), Refusal::WrongModel);
    for page in [1000, usize::MAX] {
        assert_eq!(liar.try_call(Call::Model { page }), Ok(Err(Refusal::NoSuchPage)));
    }
    let deep = "[".repeat(10_000);
    for garbage in ["{", "\0", &deep, "{\"version\":8,\"nonce\":1}", "null"] {
        assert_eq!(refusal_of(&liar, garbage.as_bytes()), Refusal::UnknownCall);
    }

    // queries
    for bad in [
        Query { request: 99, ..STATE },
        Query { want: FieldSet(u128::MAX), ..STATE },
        Query { options: QueryOptions(16), ..STATE },
        Query { reserved: [1; 10], ..STATE },
        Query { tasks: [TaskParts(1); 32], ..STATE },
        Query { request: 5, ..STATE },
        Query { axes: 3, ..STATE },
        Query { relative_to: 7_000, ..STATE },
        Query { n_directions: 1, ..STATE },
        STATE.with_directions(65),
        Query { n_frames: u16::MAX, ..STATE },
        Query { n_wrenches: 17, ..STATE },
        Query { n_frames: 1, frames: [u16::MAX; 32], ..STATE },
        Query { n_joint_runs: 32, ..STATE },
        Query { n_joint_runs: 1, joints: [[0, u16::MAX]; 31], ..STATE },
        Query { n_joint_runs: 1, ..STATE },
        Query { n_joint_runs: 2, joints: [[0, 1]; 31], ..STATE },
    ] {
        let answered = liar.try_call(Call::Plan { query: Box::new(bad) });
        assert!(matches!(answered, Ok(Err(Refusal::BadQuery { .. }))), "{bad:?}");
    }
    assert!(liar.plan(&STATE).is_ok());

    // lanes and services
    let lane = |n_in, n_out| liar.try_call(Call::Lane { n_in, n_out }).unwrap();
    assert_eq!(liar.try_call(Call::Serve), Ok(Err(Refusal::NoEnd)));
    assert!(matches!(lane(usize::MAX, 1), Err(Refusal::TooLarge { .. })));
    assert!(matches!(lane(1, 16385), Err(Refusal::TooLarge { .. })));
    assert!(lane(1, 16384).is_ok());
    let second = sandbox.raw("liar");
    let taken = second.try_call(Call::Lane { n_in: 1, n_out: 1 });
    assert_eq!(taken, Ok(Err(Refusal::NoLane { limit: 1 })));
    // another end replaces the one before
    assert!(liar.call(Call::Service).is_ok());
    assert!(second.call(Call::Lane { n_in: 1, n_out: 1 }).is_ok());
    assert_eq!(liar.call(Call::Serve), Ok(Grant::Served));
    assert_eq!(liar.try_call(Call::Serve), Ok(Err(Refusal::NoEnd)));

    // a message beyond the longest ends its connection alone
    assert!(liar.socket.send(&vec![b' '; MAX_MESSAGE + 1], None).is_ok());
    let start = Instant::now();
    while !liar.socket.is_closed() {
        assert!(start.elapsed() < LIMIT);
    }
    assert!(second.plan(&STATE).is_ok());
}

#[test]
fn lies_through_a_lane_get_their_status() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("lane", &[]);
    let mut honest = Asker::new(sandbox.connect("lane", Transport::Lane).unwrap());
    let n_in = honest.input.len();

    let liar = sandbox.raw("lane");
    let sizes = [n_in, honest.output.len()];
    let (link, classes) = liar.lane(sizes).unwrap();
    assert_eq!(classes.map(Some), sizes.map(class_of));
    let (mut lane, node) = liar.claim(link, classes).unwrap();
    assert!(ClaimedLane::claim(&node, classes).is_err(), "a lane has one client");
    for (k, (head, numbers, status)) in lies(liar.fingerprint, n_in).into_iter().enumerate() {
        let head = RequestHead { sequence: k as u64 + 1, ..head };
        assert!(store_numbers(lane.outbox.numbers(), &numbers));
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
    let (node, mut lane) = liar.take_lane([1, 1]).unwrap();
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
    assert!(server.stop().success());
}

#[test]
fn lies_through_the_service_get_their_status() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("transport", &[]);
    let mut honest = Asker::new(sandbox.connect("transport", Transport::Service).unwrap());
    let n_in = honest.input.len();
    let liar = sandbox.raw("transport");
    let (_node, mut client) = liar.take_service().unwrap();

    for (k, (head, mut numbers, status)) in lies(liar.fingerprint, n_in).into_iter().enumerate() {
        let head = RequestHead { sequence: k as u64 + 1, ..head };
        // more numbers than the plan takes mean nothing
        numbers.resize(MAX_NUMBERS_IN + 100, f64::NAN);
        assert!(client.send(&head, &numbers));
        let start = Instant::now();
        let (answer, numbers) = loop {
            if let Some((answer, numbers)) = client.poll().unwrap() {
                let mut private = vec![0.0; numbers.len()];
                assert!(load_numbers(numbers, &mut private));
                break (answer, private);
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
