//! Clients lie in batches, flood with them, are killed over them and keep their memory; others ask
//! one by one and for rows, with every bit compared.

use std::fs::{self, File};
use std::os::unix::fs::MetadataExt;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use fastrand::Rng;
use sarrus_client::{Domain, Status};
use sarrus_proto::batch::BATCH_WORDS;
use sarrus_proto::control::{Call, Grant};

use crate::Settings;
use crate::honest::{Askers, TRANSPORTS};
use crate::oracle::Oracle;
use crate::patience::{LIMIT, holds};
use crate::process::{Process, batch_areas};
use crate::raw::Raw;
use crate::report::{Clock, Report, Verdict};
use crate::roles::transport_flags;
use crate::sandbox::{NAME, Sandbox, Server, words};

/// Attackers at one time; every other one floods.
const ATTACKERS: usize = 4;
/// The most rows that an honest client asks for together.
const ROWS: usize = 1500;
/// The statuses with which lies are answered.
const REFUSALS: [Status; 5] = [
    Status::BadRequest,
    Status::WrongModel,
    Status::UnknownRequest,
    Status::WrongSize,
    Status::Overloaded,
];
/// A lane should be answered within this beside them: it waits for one tile.
const ANSWERED: Duration = Duration::from_millis(10);

pub(crate) fn run(settings: &Settings) -> Result<Verdict, String> {
    let mut report = Report::new(settings);
    let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
    let oracle = Arc::new(Oracle::new(robot, settings.seed, 1024)?);
    let sandbox = Sandbox::new(settings)?;
    let mut server = sandbox.serve(robot, &[])?;
    let observer = Raw::greet(sandbox.domain(), NAME)?;
    // everything that takes memory for good has happened once
    let mut attackers = Attackers { sandbox: &sandbox, random: Rng::with_seed(settings.seed) };
    attackers.run(Clock::new("batches", 0.2), &mut server)?;
    holds(|| batch_areas(server.id()) == 0);
    let before = server.descriptors();

    // one lane asks without a pause of its own; the others ask one by one and for rows
    let times = Arc::new(Mutex::new(Vec::new()));
    let noted = times.clone();
    let timeout = LIMIT;
    let ask = move |honest: &mut crate::honest::Honest, number: usize| {
        let start = Instant::now();
        let outcome = if number < 2 { honest.ask() } else { honest.ask_rows(ROWS) };
        if number == 0
            && outcome.is_ok()
            && let Ok(mut times) = noted.lock()
        {
            times.push(start.elapsed());
        }
    };
    let askers = Askers::start_with(sandbox.domain(), &oracle, 2, timeout, settings.seed, ask)?;
    std::thread::sleep(Duration::from_secs_f64(settings.seconds.min(10.0) / 8.0));
    let mut take = |what: &str, aim: Option<Duration>| {
        if let Ok(mut times) = times.lock() {
            report.times(what, &mut times, aim);
            times.clear();
        }
    };
    take("a lane beside honest batches", None);
    let attacks = attackers.run(Clock::new("batches", settings.seconds), &mut server)?;
    take("a lane beside attackers", Some(ANSWERED));
    askers.finish().report(&mut report, "honest clients", false);
    report.count(format!("{attacks} attackers killed"));

    // how they were refused
    if let Grant::Statistics(statistics) = observer.call(Call::Statistics)? {
        let refused = REFUSALS.map(|status| statistics.answered(status));
        let words =
            REFUSALS.iter().zip(refused).map(|(status, n)| format!("{} {n}", status.name()));
        let rows = statistics.counts.batch_states;
        report.count(format!("{rows} rows, {}", words.collect::<Vec<_>>().join(", ")));
        report.require(refused.iter().any(|n| *n > 0), || "nothing was refused".to_owned());
    }

    // nothing of them is left
    let free = holds(|| {
        let is_free = matches!(observer.call(Call::Statistics), Ok(Grant::Statistics(statistics))
            if statistics.lanes_taken == 0 && statistics.plans == 0);
        is_free && batch_areas(server.id()) == 0 && server.descriptors() <= before
    });
    report.require(free, || {
        format!(
            "descriptors {before} then {}, {} areas",
            server.descriptors(),
            batch_areas(server.id())
        )
    });
    keep(sandbox.domain(), (20.0 * settings.seconds).clamp(20.0, 200.0) as usize, &mut report)?;
    if let Some(status) = server.ended() {
        report.fault(format!("the server ended with {status}"));
        return Ok(Verdict::Done(report));
    }
    drop(observer);
    server.stop()?;
    sandbox.require_empty(&mut report);
    Ok(Verdict::Done(report))
}

/// Processes that lie and flood, each killed after some tenths of a second.
struct Attackers<'a> {
    sandbox: &'a Sandbox,
    random: Rng,
}

impl Attackers<'_> {
    /// Attacks for a time; the number of attackers.
    fn run(&mut self, mut clock: Clock, server: &mut Server) -> Result<u64, String> {
        let mut running: Vec<(Process, Instant)> = Vec::new();
        let mut made = 0_u64;
        while clock.runs(|| format!("{made} attackers")) && server.ended().is_none() {
            let now = Instant::now();
            running.retain(|(_, end)| now < *end);
            while running.len() < ATTACKERS {
                let mut flags = vec!["--seed".to_owned(), self.random.u64(..1 << 32).to_string()];
                flags.extend(transport_flags(TRANSPORTS[self.random.usize(..2)]));
                flags.extend(made.is_multiple_of(2).then(|| "--flood".to_owned()));
                let process = self.sandbox.role("liar", &flags)?.spawn().map_err(words)?;
                let end = now + Duration::from_millis(self.random.u64(30..300));
                running.push((Process(process), end));
                made += 1;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        Ok(made)
    }
}

/// Takes areas and gives them back, and keeps their descriptors: their memory is free.
fn keep(domain: &Domain, n: usize, report: &mut Report) -> Result<(), String> {
    let before = shared_memory();
    let mut kept = Vec::new();
    let mut raw = Raw::greet(domain, NAME)?;
    for k in 0..n {
        // sometimes by a new connection
        if k % 8 == 7 {
            raw = Raw::greet(domain, NAME)?;
        }
        raw.lane([1, 1])?;
        let (_, memory) = raw.batches()?;
        let memory = File::from(memory);
        let len = 8 * BATCH_WORDS as u64;
        for size in [0, 4096, len - 1, len + 1, 2 * len] {
            report.require(memory.set_len(size).is_err(), || format!("an area is {size} bytes"));
        }
        kept.push(memory);
        if k % 2 == 0 {
            raw.call(Call::Leave)?;
        }
    }
    drop(raw);
    let blocks =
        || -> u64 { kept.iter().filter_map(|one| Some(one.metadata().ok()?.blocks())).sum() };
    let free = holds(|| blocks() == 0);
    report.count(format!(
        "{n} areas kept by their descriptors: {} kB; shared memory {before} then {} kB",
        blocks() / 2,
        shared_memory()
    ));
    report.require(free, || format!("areas that were given back keep {} kB", blocks() / 2));
    Ok(())
}

/// Shared memory in use on this machine `[kB]`.
fn shared_memory() -> u64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("Shmem:"));
    line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok()).unwrap_or(0)
}
