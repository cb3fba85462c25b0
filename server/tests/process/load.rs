//! The answering thread under load: fair, without the system's allocator and system calls.

use std::fs;
use std::io::{BufRead, BufReader, Lines};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::Instant;

use rustix::process::Signal;
use sarrus_client::{Options, QueryOptions, Robot, Source, Status, Transport};
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::message::{RequestHead, store_numbers};
use sarrus_proto::service::OpenedService;
use sarrus_serve::pool;

use sarrus_torture::patience::LIMIT;
use sarrus_torture::process::send_signal;
use sarrus_torture::raw::Raw;

use crate::batches::Rows;
use crate::support::{Asker, ROBOT, STATE, Sandbox, Server, published, wait_until};

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

/// The system calls of a process, as strace writes them.
struct Trace {
    strace: Child,
    // it stays open as long as strace runs
    _words: Lines<BufReader<ChildStderr>>,
    path: PathBuf,
}

impl Trace {
    /// Traces all threads of a server from now on; `None`, with a word, where that cannot be.
    fn of(server: &Server) -> Option<Trace> {
        let path = std::env::temp_dir().join(format!("sarrus-strace-{}", std::process::id()));
        let mut command = Command::new("strace");
        command.args(["-f", "-s", "200", "-o"]).arg(&path);
        let spawned = command.args(["-p", &server.id().to_string()]).stderr(Stdio::piped()).spawn();
        let Ok(mut strace) = spawned else {
            println!("not run: strace is missing");
            return None;
        };
        let mut words = BufReader::new(strace.stderr.take().unwrap()).lines();
        // printed once it traces all threads
        if words.any(|line| line.unwrap().contains(" attached")) {
            return Some(Trace { strace, _words: words, path });
        }
        let status = strace.wait().unwrap();
        println!("not run: strace may not look into processes here ({status})");
        None
    }

    fn end(mut self) -> String {
        send_signal(self.strace.id(), Signal::INT);
        self.strace.wait().unwrap();
        let calls = fs::read_to_string(&self.path).unwrap();
        fs::remove_file(&self.path).unwrap();
        calls
    }
}

#[test]
fn nobody_lists_the_files_of_other_programs_while_clients_come_and_go() {
    let sandbox = Sandbox::new();
    let server = sandbox.serve("beside", &[]);
    let mut stays = Asker::new(sandbox.connect("beside", Transport::Lane).unwrap());
    let Some(trace) = Trace::of(&server) else { return };
    for transport in [Transport::Lane, Transport::Service] {
        let mut asker = Asker::new(sandbox.connect("beside", transport).unwrap());
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        drop(asker);
        let alone = || stays.robot.statistics().unwrap().clients.len() == 1;
        wait_until("it is gone", alone);
    }
    assert_eq!(stays.ask().unwrap().status, Status::Ok);
    let of_server = trace.end();
    // the client's side, from its start to its end
    let path = std::env::temp_dir().join(format!("sarrus-client-{}", std::process::id()));
    let mut client = Command::new("strace");
    client.args(["-f", "-o"]).arg(&path).arg(env!("CARGO_BIN_EXE_sarrus"));
    client.args(["ask", "kinematics", "--connect", "beside"]);
    client.env("SARRUS_ROOT", sandbox.domain().root()).stdin(Stdio::null());
    assert!(client.status().unwrap().success());
    let of_client = fs::read_to_string(&path).unwrap();
    fs::remove_file(&path).unwrap();
    for calls in [of_server, of_client] {
        assert!(calls.contains("\"/dev/shm/sarrus_"), "the trace sees nothing");
        let listed = calls.lines().find(|line| line.contains("\"/dev/shm\", O_"));
        assert_eq!(listed, None);
    }
}

/// Serves with these flags, and looks at the answering thread while it answers.
pub(crate) fn system_calls_of_the_busy_loop(flags: &[&str]) {
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
    let hot = hot.file_name().unwrap().to_str().unwrap();
    let Some(trace) = Trace::of(&server) else { return };
    let before = askers[0].robot.statistics().unwrap();
    for (asker, rows) in askers.iter_mut().zip(&mut rows) {
        rows.ask(asker).unwrap();
        // something to log
        assert!(asker.robot.prepare(&STATE.with_options(QueryOptions::CHECKSUM)).is_ok());
        for _ in 0..5_000 {
            assert_eq!(asker.ask().unwrap().status, Status::Ok);
        }
    }
    let calls = trace.end();
    // counts are published now and then
    published(&askers[0].robot, |after| {
        after.counts.lane_requests >= before.counts.lane_requests + 5_000
            && after.counts.service_requests >= before.counts.service_requests + 5_000
            && after.counts.batch_states >= before.counts.batch_states + 6_000
    });
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
                assert!(store_numbers(lane.outbox.numbers(), numbers));
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
        assert!(store_numbers(lane.outbox.numbers(), &numbers));
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
