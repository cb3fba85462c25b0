//! The answering thread under load: fair, without the system's allocator and system calls.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Instant;

use sarrus_client::{Options, QueryOptions, Robot, Source, Status, Transport};
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::message::RequestHead;
use sarrus_proto::service::OpenedService;
use sarrus_serve::pool;

use sarrus_torture::patience::LIMIT;
use sarrus_torture::raw::Raw;

use crate::batches::Rows;
use crate::support::{Asker, ROBOT, STATE, Sandbox, published};

#[test]
fn no_request_reaches_the_systems_allocator() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("frugal", &["--wait", "busy"]);
    for transport in [Transport::Lane, Transport::Service] {
        let mut asker = Asker::new(sandbox.connect("frugal", transport).unwrap());
        for _ in 0..20_000 {
            assert_eq!(asker.ask().unwrap().status, Status::Ok);
        }
        let bad = vec![f64::NAN; asker.input.len()];
        assert_eq!(
            asker.robot.ask(asker.plan, &bad, &mut asker.output).unwrap().status,
            Status::NonFiniteInput
        );
        let mut rows = Rows::new(&asker, 3000);
        rows.ask(&mut asker).unwrap();
        let statistics = published(&asker.robot, |statistics| {
            let counts = &statistics.counts;
            let requests = if transport == Transport::Lane {
                counts.lane_requests
            } else {
                counts.service_requests
            };
            requests >= 20_001 && counts.batch_states >= 3000
        });
        assert_eq!(statistics.system_allocations, 0, "{transport:?}: {statistics:?}");
        assert!(statistics.counts.batch_states >= 3000, "{transport:?}: {statistics:?}");
        let served = if transport == Transport::Lane {
            statistics.counts.lane_requests
        } else {
            statistics.counts.service_requests
        };
        assert_eq!(served, 20_001, "{transport:?}: {statistics:?}");
        assert_eq!(
            statistics.pool_allocations > 0,
            transport == Transport::Service,
            "{transport:?}: {statistics:?}"
        );
        assert!(statistics.latency_ns[0] > 0 && statistics.answered(Status::NonFiniteInput) > 0);
    }
}

#[test]
fn asking_allocates_nothing_through_a_lane_and_in_process() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("sparing", &[]);
    // the transport itself makes one small block for each request through the other transport
    let local = Robot::load(&Source::Bundled(ROBOT.into()), &Options::default()).unwrap();
    let [lane, requests] = [Transport::Lane, Transport::Service]
        .map(|transport| sandbox.connect("sparing", transport).unwrap());
    for (robot, blocks) in [(local, 0), (lane, 0), (requests, 1)] {
        let mut asker = Asker::new(robot);
        let _ = asker.ask().unwrap();
        assert_eq!(asker.thousand(), (1000, 1000 * blocks, 0));
        // batches make none anywhere
        let mut rows = Rows::new(&asker, 2000);
        rows.ask(&mut asker).unwrap();
        let before = pool::counts();
        let adopted = pool::adopt_thread();
        let outcome = rows.ask(&mut asker);
        drop(adopted);
        let after = pool::counts();
        assert!(outcome.is_ok());
        assert_eq!((after.pool - before.pool, after.system - before.system), (0, 0));
    }
}

#[test]
fn the_busy_loop_makes_no_system_call() {
    system_calls_of_the_busy_loop(&[]);
}

#[test]
fn the_busy_loop_makes_no_system_call_where_everything_is_logged() {
    system_calls_of_the_busy_loop(&["--log", "debug"]);
}

/// Serves with these flags, and looks at the answering thread while it answers.
pub(crate) fn system_calls_of_the_busy_loop(flags: &[&str]) {
    if Command::new("strace").arg("-V").stdout(Stdio::null()).status().is_err() {
        return println!("not run: strace is missing");
    }
    let sandbox = Sandbox::new();
    let server = sandbox.serve("silent", &[&["--wait", "busy"], flags].concat());
    let mut askers = [Transport::Lane, Transport::Service]
        .map(|transport| Asker::new(sandbox.connect("silent", transport).unwrap()));
    askers.iter_mut().for_each(|asker| assert_eq!(asker.ask().unwrap().status, Status::Ok));
    let mut rows = askers.each_ref().map(|asker| Rows::new(asker, 3000));

    let tasks = fs::read_dir(format!("/proc/{}/task", server.id()))
        .unwrap()
        .flatten()
        .map(|task| task.path());
    let hot = tasks
        .filter(|task| {
            fs::read_to_string(task.join("comm")).is_ok_and(|name| name == "sarrus-hot\n")
        })
        .collect::<Vec<_>>();
    let [hot] = &hot[..] else { panic!("one answering thread, found {hot:?}") };
    let trace = std::env::temp_dir().join(format!("sarrus-strace-{}", std::process::id()));
    let hot = hot.file_name().unwrap().to_str().unwrap();
    let mut strace = Command::new("strace")
        .args(["-f", "-s", "200", "-o"])
        .arg(&trace)
        .args(["-p", &server.id().to_string()])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // strace prints this once it traces all threads; its pipe stays open as long as it runs
    let mut words = BufReader::new(strace.stderr.take().unwrap()).lines();
    if !words.any(|line| line.unwrap().contains(" attached")) {
        let status = strace.wait().unwrap();
        return println!("not run: strace may not look into processes here ({status})");
    }
    let before = askers[0].robot.statistics().unwrap();
    for (asker, rows) in askers.iter_mut().zip(&mut rows) {
        rows.ask(asker).unwrap();
        // something to log
        assert!(asker.robot.prepare(&STATE.with_options(QueryOptions::CHECKSUM)).is_ok());
        for _ in 0..5_000 {
            assert_eq!(asker.ask().unwrap().status, Status::Ok);
        }
    }
    assert!(
        Command::new("kill").args(["-INT", &strace.id().to_string()]).status().unwrap().success()
    );
    strace.wait().unwrap();
    // counts are published now and then
    published(&askers[0].robot, |after| {
        after.counts.lane_requests >= before.counts.lane_requests + 5_000
            && after.counts.service_requests >= before.counts.service_requests + 5_000
            && after.counts.batch_states >= before.counts.batch_states + 6_000
    });
    let calls = fs::read_to_string(&trace).unwrap();
    fs::remove_file(&trace).unwrap();
    let (of_hot, of_others): (Vec<&str>, Vec<&str>) =
        calls.lines().partition(|line| line.split(' ').next() == Some(hot));
    assert!(!of_others.is_empty(), "the trace sees nothing");
    let logged = of_others.iter().any(|line| line.contains("plan registered"));
    let is_logged = flags.contains(&"--log");
    assert_eq!(logged, is_logged, "what the other thread logs");
    let of_hot: Vec<&&str> = of_hot.iter().filter(|line| !line.contains("detached")).collect();
    assert!(of_hot.is_empty(), "{} system calls, the first: {}", of_hot.len(), of_hot[0]);
}

/// A client that always has a request under way.
enum Pusher {
    /// With the sequence of its last request.
    Lane(ClaimedLane, u64),
    /// With whether a request waits.
    Requests(Box<dyn OpenedService>, bool),
}

impl Pusher {
    /// Takes the answer if it is there and asks again at once.
    fn push(&mut self, head: &RequestHead, numbers: &[f64]) -> u64 {
        match self {
            Pusher::Lane(lane, sequence) => {
                if lane.inbox.poll().is_none() {
                    return 0;
                }
                lane.outbox.numbers()[..numbers.len()].copy_from_slice(numbers);
                *sequence += 1;
                lane.outbox.publish(RequestHead { sequence: *sequence, ..*head });
                1
            }
            Pusher::Requests(client, pending) => {
                let answered = !*pending || client.poll().unwrap().is_some();
                if answered {
                    client.cancel();
                    *pending = client.send(head, numbers);
                }
                answered.into()
            }
        }
    }
}

#[test]
fn no_client_starves_another() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("fair", &["--wait", "busy"]);
    let asker = Asker::new(sandbox.connect("fair", Transport::Service).unwrap());
    let numbers = asker.input.clone();

    // three clients of the service and two lanes, all backlogged, driven by one thread
    let liars: Vec<Raw> = (0..5).map(|_| sandbox.raw("fair")).collect();
    let mut nodes = Vec::new();
    let head = liars[0].head(0, 1);
    let mut pushers: Vec<Pusher> = Vec::new();
    for liar in &liars[..3] {
        let (node, client) = liar.take_service().unwrap();
        nodes.push(node);
        pushers.push(Pusher::Requests(client, false));
    }
    for liar in &liars[3..] {
        let (node, mut lane) = liar.take_lane([numbers.len(), asker.output.len()]).unwrap();
        nodes.push(node);
        lane.outbox.numbers()[..numbers.len()].copy_from_slice(&numbers);
        lane.outbox.publish(head);
        pushers.push(Pusher::Lane(lane, head.sequence));
    }
    let mut answered = [0; 5];
    let start = Instant::now();
    // enough rounds, also where the machine does other things
    while answered[0] < 1000 && start.elapsed() < LIMIT {
        for (pusher, answered) in pushers.iter_mut().zip(&mut answered) {
            *answered += pusher.push(&head, &numbers);
        }
    }
    let least = answered.iter().min().unwrap();
    let most = answered.iter().max().unwrap();
    assert!(*least > 10 && most < &(2 * least), "{answered:?}");
}
