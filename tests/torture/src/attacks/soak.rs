//! Requests of every kind through many lanes and services, every bit compared.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use clap::Args;
use fastrand::Rng;
use sarrus_client::Status;
use sarrus_proto::Node;
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::message::{RequestHead, ResponseHead, load_numbers, store_numbers};
use sarrus_proto::service::OpenedService;

use crate::Settings;
use crate::honest::Askers;
use crate::oracle::{Oracle, Question};
use crate::patience::{LIMIT, holds};
use crate::raw::Raw;
use crate::report::{Clock, Report, Verdict};
use crate::sandbox::{NAME, Sandbox};

/// Questions, each asked again and again.
const QUESTIONS: usize = 4096;

#[derive(Args, Clone)]
pub(crate) struct Soak {
    /// Lanes.
    #[arg(long, default_value_t = 12)]
    lanes: usize,
    /// Services.
    #[arg(long, default_value_t = 4)]
    services: usize,
    /// Threads that ask.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Threads that only take processor time.
    #[arg(long, default_value_t = 0)]
    load: usize,
    /// Requests after which it ends, however many seconds are left.
    #[arg(long)]
    requests: Option<u64>,
}

impl Default for Soak {
    fn default() -> Soak {
        Soak { lanes: 12, services: 4, threads: 1, load: 0, requests: None }
    }
}

/// Counts of the asking threads.
#[derive(Default)]
struct Tally {
    answers: u64,
    garbage: u64,
    wrong: u64,
    statuses: BTreeMap<u32, u64>,
    first: Option<String>,
}

impl Soak {
    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        let mut report = Report::new(settings);
        let robot = settings.robot.as_deref().unwrap_or("lambda");
        let oracle = Arc::new(Oracle::new(robot, settings.seed, QUESTIONS)?);
        let sandbox = Sandbox::new(settings)?;
        // one process has all but an eighth of them
        let lanes = ((self.lanes + 1).div_ceil(7) * 8).to_string();
        // a server that polls answers more, unless something else was asked for
        let wait: &[&str] = if settings.wait.is_some() { &[] } else { &["--wait", "busy"] };
        let mut server = sandbox.serve(robot, &[&["--lanes", &lanes], wait].concat())?;
        let descriptors = server.descriptors();
        let memory = server.memory();

        let stop = Arc::new(AtomicBool::new(false));
        let done = Arc::new(AtomicU64::new(0));
        let spinning: Vec<_> = (0..self.load)
            .map(|_| {
                let stop = stop.clone();
                std::thread::spawn(move || {
                    while !stop.load(Relaxed) {
                        std::hint::spin_loop();
                    }
                })
            })
            .collect();
        // clients as programs are: a false "gone" would show here
        let timeout = LIMIT;
        let askers = Askers::start(sandbox.domain(), &oracle, 1, timeout, settings.seed)?;
        let mut threads = Vec::new();
        for number in 0..self.threads.max(1) {
            let share =
                |n: usize| n / self.threads.max(1) + usize::from(n % self.threads.max(1) > number);
            let ends = attach(&sandbox, &oracle, share(self.lanes), share(self.services))?;
            let oracle = oracle.clone();
            let stop = stop.clone();
            let done = done.clone();
            let seed = settings.seed.wrapping_add(number as u64);
            threads.push(std::thread::spawn(move || soak(ends, &oracle, seed, &stop, &done)));
        }

        let start = std::time::Instant::now();
        let mut clock = Clock::new("soak", settings.seconds);
        let most = self.requests.unwrap_or(u64::MAX);
        while clock.runs(|| format!("{:.1} M requests", 1e-6 * done.load(Relaxed) as f64)) {
            if done.load(Relaxed) >= most || server.ended().is_some() {
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let rate = done.load(Relaxed) as f64 / start.elapsed().as_secs_f64();
        stop.store(true, Relaxed);
        let mut tally = Tally::default();
        for thread in threads {
            let more = thread.join().map_err(|_| "a thread that asks ended")?;
            tally.answers += more.answers;
            tally.garbage += more.garbage;
            tally.wrong += more.wrong;
            more.statuses.iter().for_each(|(k, n)| *tally.statuses.entry(*k).or_default() += n);
            tally.first = tally.first.take().or(more.first);
        }
        for thread in spinning {
            let _ = thread.join();
        }
        let Tally { answers, garbage, wrong, statuses, first } = tally;
        report.count(format!(
            "{answers} answers compared, {garbage} of them to garbage, {wrong} wrong, {rate:.0} a \
             second, {} lanes, {} services, {} threads of load",
            self.lanes, self.services, self.load
        ));
        let names = statuses.iter().map(|(k, n)| format!("{} {n}", Status::of_answer(*k).name()));
        report.count(format!("statuses: {}", names.collect::<Vec<_>>().join(", ")));
        report.require(wrong == 0, || format!("{wrong} wrong: {}", first.unwrap_or_default()));
        report.require(answers > 0, || "no answer".to_owned());
        let counts = askers.finish();
        counts.report(&mut report, "honest clients", false);
        if let Some(status) = server.ended() {
            report.fault(format!("the server ended with {status}"));
            return Ok(Verdict::Done(report));
        }
        let leaks = !holds(|| server.descriptors() <= descriptors);
        report.require(!leaks, || "descriptors are not given back".to_owned());
        report.count(format!(
            "descriptors {descriptors} then {}, memory {memory} then {} kB",
            server.descriptors(),
            server.memory()
        ));
        server.stop()?;
        Ok(Verdict::Done(report))
    }
}

/// A client's end and its request under way.
struct End {
    way: Way,
    raw: Raw,
    plans: Vec<u32>,
    sequence: u64,
    /// The question under way; `None` for garbage, with the status that it must get.
    asked: Option<(usize, Option<Status>)>,
}

/// Ports go before their nodes.
enum Way {
    Lane { lane: ClaimedLane, _node: Node },
    Service { client: Box<dyn OpenedService>, _node: Node },
}

fn attach(
    sandbox: &Sandbox,
    oracle: &Oracle,
    lanes: usize,
    services: usize,
) -> Result<Vec<End>, String> {
    let mut ends = Vec::new();
    for number in 0..lanes + services {
        let raw = Raw::greet(sandbox.domain(), NAME)?;
        let mut plans = Vec::new();
        let mut needs = [0; 2];
        for query in &oracle.queries {
            let (plan, sizes) = raw.plan(query)?;
            plans.push(plan);
            needs = [needs[0].max(sizes[0]), needs[1].max(sizes[1])];
        }
        let way = if number < lanes {
            let (_node, lane) = raw.take_lane(needs)?;
            Way::Lane { lane, _node }
        } else {
            let (_node, client) = raw.take_service()?;
            Way::Service { client, _node }
        };
        ends.push(End { way, raw, plans, sequence: 0, asked: None });
    }
    Ok(ends)
}

/// Keeps a request under way at every end.
fn soak(
    mut ends: Vec<End>,
    oracle: &Oracle,
    seed: u64,
    stop: &AtomicBool,
    done: &AtomicU64,
) -> Tally {
    let mut random = Rng::with_seed(seed);
    let mut tally = Tally::default();
    while !stop.load(Relaxed) {
        let before = tally.answers;
        for end in &mut ends {
            if end.take(oracle, &mut tally) {
                end.ask(oracle, &mut random);
            }
        }
        done.fetch_add(tally.answers - before, Relaxed);
        if tally.answers == before {
            // the server may need this processor
            std::thread::yield_now();
        }
    }
    tally
}

impl End {
    /// Takes the answer; true where the end is free for the next request.
    fn take(&mut self, oracle: &Oracle, tally: &mut Tally) -> bool {
        let Some((index, garbage)) = self.asked else { return true };
        let Some(question) = oracle.questions.get(index) else { return true };
        let mut judge = |head: ResponseHead, numbers: &[f64]| {
            let right =
                head.sequence == self.sequence && is_right(question, garbage, &head, numbers);
            tally.answers += 1;
            tally.garbage += u64::from(garbage.is_some());
            *tally.statuses.entry(head.status).or_default() += 1;
            if !right {
                tally.wrong += 1;
                tally.first.get_or_insert_with(|| {
                    format!("{head:?} to request {} ({garbage:?}), {index}", self.sequence)
                });
            }
        };
        match &mut self.way {
            Way::Lane { lane, .. } => {
                let Some((head, numbers)) = lane.inbox.poll() else { return false };
                judge(head, numbers);
            }
            Way::Service { client, .. } => {
                let Ok(Some((head, words))) = client.poll() else { return false };
                let mut numbers = vec![0.0; words.len()];
                load_numbers(words, &mut numbers);
                judge(head, &numbers);
                client.cancel();
            }
        }
        true
    }

    fn ask(&mut self, oracle: &Oracle, random: &mut Rng) {
        let index = random.usize(..oracle.questions.len());
        let Some(question) = oracle.questions.get(index) else { return };
        self.sequence += 1;
        let plan = self.plans.get(question.query).copied().unwrap_or_default();
        let good = self.raw.head(plan, self.sequence);
        // one in twenty has a head that lies
        let (head, garbage) = match random.u8(..100) {
            0 => (RequestHead { version: random.u32(1000..), ..good }, Some(Status::BadRequest)),
            1 | 2 => {
                let fingerprint = good.fingerprint ^ random.u64(1..);
                (RequestHead { fingerprint, ..good }, Some(Status::WrongModel))
            }
            3 | 4 => {
                let plan = random.u32(512..1024);
                (RequestHead { plan, ..good }, Some(Status::UnknownRequest))
            }
            _ => (good, None),
        };
        match &mut self.way {
            Way::Lane { lane, .. } => {
                store_numbers(lane.outbox.numbers(), &question.input);
                lane.outbox.publish(head);
            }
            Way::Service { client, .. } => {
                if !client.send(&head, &question.input) {
                    self.asked = None;
                    return;
                }
            }
        }
        self.asked = Some((index, garbage));
    }
}

fn is_right(
    question: &Question,
    garbage: Option<Status>,
    head: &ResponseHead,
    numbers: &[f64],
) -> bool {
    match garbage {
        Some(status) => head.status == status as u32,
        None => numbers
            .get(..question.output.len())
            .is_some_and(|numbers| question.is_answered_by(head.status, head.warnings, numbers)),
    }
}
