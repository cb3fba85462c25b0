//! Clients send calls and garbage without end; others attach, and the server stops in time.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::Settings;
use crate::honest::{Askers, Honest, TRANSPORTS, is_full};
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::process::Process;
use crate::report::{Clock, Report, Verdict};
use crate::sandbox::{Sandbox, words};

/// Clients that flood.
const FLOODERS: u64 = 4;
/// Another client should attach within this.
const ATTACHED: Duration = Duration::from_secs(1);
/// The server should have stopped within this.
const STOPPED: Duration = Duration::from_secs(2);

pub(crate) fn run(settings: &Settings) -> Result<Verdict, String> {
    let mut report = Report::new(settings);
    let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
    let oracle = Arc::new(Oracle::new(robot, settings.seed, 256)?);
    let sandbox = Sandbox::new(settings)?;
    let mut server = sandbox.serve(robot, &["--lanes", "64"])?;
    let timeout = LIMIT;
    let askers = Askers::start(sandbox.domain(), &oracle, 1, timeout, settings.seed)?;
    let mut flooders = Vec::new();
    for number in 0..FLOODERS {
        let seed = settings.seed.wrapping_add(number).to_string();
        let command = sandbox.role("flooder", ["--seed", &seed])?.spawn();
        flooders.push(Process(command.map_err(words)?));
    }

    let mut attached = Vec::new();
    let mut full = 0_u64;
    let mut clock = Clock::new("flood", settings.seconds);
    while clock.runs(|| format!("{} attached", attached.len())) {
        let transport = TRANSPORTS[attached.len() % 2];
        let start = Instant::now();
        match Honest::connect(sandbox.domain(), transport, timeout, &oracle, settings.seed) {
            Ok(mut honest) => {
                attached.push(start.elapsed());
                honest.ask().map_err(words)?;
                report.require(honest.counts.wrong == 0, || "a wrong answer".to_owned());
            }
            Err(error) if is_full(&error) => full += 1,
            // on a busy machine flooders may fill the queue of connections
            Err(error) if !settings.strict && start.elapsed() >= timeout / 2 => {
                report.count(format!("late: {error}"));
            }
            Err(error) => report.fault(format!("a client cannot attach: {error}")),
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    if let Some(status) = server.ended() {
        report.fault(format!("the server ended with {status}"));
    }
    askers.finish().report(&mut report, "honest clients", false);
    report.count(format!("{} attached, {full} found no room", attached.len()));
    report.times("attached under the flood", &mut attached, Some(ATTACHED));
    // they go on while the server stops
    match server.stop() {
        Ok(took) => report.times("stopped under the flood", &mut [took], Some(STOPPED)),
        Err(error) => report.fault(error),
    }
    drop(flooders);
    sandbox.require_empty(&mut report);
    Ok(Verdict::Done(report))
}
