//! Server and clients are stopped and continued; errors are true, and nothing leaks.

use std::io::Read;
use std::process::Stdio;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use fastrand::Rng;
use rustix::process::Signal;
use sarrus_proto::Node;
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::control::{Call, Grant};
use sarrus_proto::message::Statistics;
use sarrus_proto::service::OpenedService;

use crate::Settings;
use crate::honest::{Askers, Honest, TRANSPORTS};
use crate::oracle::Oracle;
use crate::patience::holds;
use crate::process::{Process, send_signal, state_of};
use crate::raw::Raw;
use crate::report::{Clock, Report, Verdict};
use crate::roles::transport_flags;
use crate::sandbox::{NAME, Sandbox, words};

/// A client's time-out, shorter than most stops.
const TIMEOUT: Duration = Duration::from_millis(100);
/// Connections that come and go while the server is stopped: more than may wait to be accepted.
const PASSERS: usize = 300;

/// Whether the server is stopped, as a number that grows with each change: it runs, is about to
/// stop, is stopped, is about to run.
const STOPPED: u64 = 2;
const PHASES: u64 = 4;

pub(crate) fn run(settings: &Settings) -> Result<Verdict, String> {
    let mut report = Report::new(settings);
    let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
    let oracle = Arc::new(Oracle::new(robot, settings.seed, 256)?);
    let sandbox = Sandbox::new(settings)?;
    let mut server = sandbox.serve(robot, &[])?;
    let observer = Raw::greet(sandbox.domain(), NAME)?;
    let mut random = Rng::with_seed(settings.seed);

    // clients in other processes, which are stopped in turn and check their own answers
    let mut stoppable = Vec::new();
    for transport in TRANSPORTS {
        let flags = ["--robot", robot].map(str::to_owned);
        let mut command =
            sandbox.role("asker", flags.into_iter().chain(transport_flags(transport)))?;
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        stoppable.push(Process(command.spawn().map_err(words)?));
    }

    // clients that give up
    let phase = Arc::new(AtomicU64::new(0));
    let lies = Arc::new(Mutex::new(Vec::new()));
    let true_words = Arc::new(AtomicU64::new(0));
    let now = phase.clone();
    let false_words = lies.clone();
    let said = true_words.clone();
    let ask = move |honest: &mut Honest, _| {
        let before = now.load(Relaxed);
        let Err(error) = honest.ask() else { return };
        if before != now.load(Relaxed) {
            return;
        }
        let text = error.to_string();
        let is_true = match before % PHASES {
            // with a full queue the server's process is unknown
            STOPPED => text.contains("is stopped by a signal") || text.contains("is not known; "),
            // on a busy machine it may be late, but neither stopped nor dead nor gone
            0 => text.contains("gave no answer") && text.contains(" lives"),
            _ => true,
        };
        match is_true {
            true => _ = said.fetch_add(1, Relaxed),
            false => {
                if let Ok(mut lies) = false_words.lock() {
                    lies.push(format!("phase {}: {text}", before % PHASES));
                }
            }
        }
    };
    let askers = Askers::start_with(sandbox.domain(), &oracle, 2, TIMEOUT, settings.seed, ask)?;

    let mut stops = 0_u64;
    let mut client_stops = 0_u64;
    let mut before = None;
    let mut clock = Clock::new("stop", settings.seconds);
    while clock.runs(|| format!("{stops} stops of the server, {client_stops} of clients")) {
        // a client; the others go on
        if let Some(client) = random.choice(&stoppable) {
            send_signal(client.0.id(), Signal::STOP);
            std::thread::sleep(Duration::from_millis(random.u64(1..60)));
            send_signal(client.0.id(), Signal::CONT);
            client_stops += 1;
        }
        // the server, with requests under way that are given up in order meanwhile
        let mut leaving = leave_open(&sandbox, &oracle)?;
        phase.fetch_add(1, Relaxed);
        server.signal(Signal::STOP);
        if !holds(|| state_of(server.id()) == Some('T')) {
            return Err("the server cannot be stopped".to_owned());
        }
        phase.fetch_add(1, Relaxed);
        stops += 1;
        leaving.iter_mut().for_each(Leaving::ask);
        drop(leaving);
        if stops % 4 == 1 {
            // those that find no room are part of it
            (0..PASSERS).for_each(|_| drop(Raw::connect(sandbox.domain(), NAME)));
        }
        std::thread::sleep(Duration::from_millis(random.u64(1..500)));
        phase.fetch_add(1, Relaxed);
        server.signal(Signal::CONT);
        phase.fetch_add(1, Relaxed);
        // the first round attaches everybody
        observer.call(Call::Statistics)?;
        if before.is_none() {
            // one of the two other processes and two of the four threads have a lane, the others a
            // service; the seventh client is the observer
            let have = |statistics: &Statistics, end| {
                statistics.clients.iter().filter(|client| client.end == end).count()
            };
            holds(|| {
                matches!(observer.call(Call::Statistics), Ok(Grant::Statistics(statistics))
                    if [have(&statistics, "lane"), have(&statistics, "service")] == [3, 3]
                        && statistics.clients.len() == 7 && statistics.lanes_taken == 3)
            });
            before = Some(server.descriptors());
        }
    }

    // everybody is attached again as before; a service that its client has yet to open has three
    // descriptors fewer, and six clients leave at each stop
    let before = before.unwrap_or_default();
    let leaks = !holds(|| server.descriptors() < before + 4 + stops as usize);
    let after = server.descriptors();
    let counts = askers.finish();
    let true_words = true_words.load(Relaxed);
    report.count(format!("{stops} stops of the server, {client_stops} of clients"));
    report.count(format!("descriptors {before} then {after}; {true_words} errors that are true"));
    report.require(!leaks, || format!("descriptors grew from {before} to {after}"));
    if let Ok(lies) = lies.lock()
        && let Some(first) = lies.first()
    {
        report.fault(format!("{} errors that are not true, as: {first}", lies.len()));
    }
    counts.report(&mut report, "clients that give up", true);
    for (client, transport) in stoppable.into_iter().zip(TRANSPORTS) {
        finish(client, &format!("stopped client ({transport:?})"), &mut report);
    }
    drop(observer);
    if let Some(status) = server.ended() {
        report.fault(format!("the server ended with {status}"));
        return Ok(Verdict::Done(report));
    }
    server.stop()?;
    sandbox.require_empty(&mut report);
    Ok(Verdict::Done(report))
}

/// A client that asks and leaves without an answer.
struct Leaving {
    end: LeavingEnd,
    raw: Raw,
}

/// Ports go before their nodes.
enum LeavingEnd {
    Lane { lane: ClaimedLane, _node: Node },
    Service { client: Box<dyn OpenedService>, _node: Node },
}

fn leave_open(sandbox: &Sandbox, oracle: &Oracle) -> Result<Vec<Leaving>, String> {
    let mut leaving = Vec::new();
    for number in 0..6 {
        let raw = Raw::greet(sandbox.domain(), NAME)?;
        let query = oracle.queries.first().ok_or("no query")?;
        let (_, sizes) = raw.plan(query)?;
        let end = if number % 2 == 0 {
            let (_node, lane) = raw.take_lane(sizes)?;
            LeavingEnd::Lane { lane, _node }
        } else {
            let (_node, client) = raw.take_service()?;
            LeavingEnd::Service { client, _node }
        };
        leaving.push(Leaving { end, raw });
    }
    Ok(leaving)
}

impl Leaving {
    fn ask(&mut self) {
        let head = self.raw.head(0, 1);
        match &mut self.end {
            LeavingEnd::Lane { lane, .. } => lane.outbox.publish(head),
            LeavingEnd::Service { client, .. } => {
                client.send(&head, &[]);
                client.cancel();
            }
        }
    }
}

/// Ends a client in another process and reports its counts.
pub(crate) fn finish(mut client: Process, who: &str, report: &mut Report) {
    drop(client.0.stdin.take());
    let mut text = String::new();
    if let Some(mut out) = client.0.stdout.take() {
        let _ = out.read_to_string(&mut text);
    }
    let mut words = text.trim().splitn(5, ' ');
    let kind = words.next();
    let mut number = || words.next().and_then(|word| word.parse::<u64>().ok());
    match (kind, number(), number(), number()) {
        (Some("counts"), Some(answers), Some(wrong), Some(lost)) => {
            report.count(format!("{who}: {answers} answers, {wrong} wrong, {lost} lost"));
            report.require(wrong == 0 && lost == 0 && answers > 0, || format!("{who}: {text}"));
        }
        _ => report.fault(format!("{who}: said {text:?}, ended with {:?}", client.0.wait())),
    }
}
