//! The server's folder is removed while it runs, as cleaners of temporary files do.

use std::fs;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fastrand::Rng;

use crate::Settings;
use crate::honest::{Askers, Honest, TRANSPORTS};
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::report::{Clock, Report, Verdict};
use crate::sandbox::Sandbox;

/// New clients should find the server again within this.
const FOUND: Duration = Duration::from_secs(3);

pub(crate) fn run(settings: &Settings) -> Result<Verdict, String> {
    let mut report = Report::new(settings);
    let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
    let oracle = Arc::new(Oracle::new(robot, settings.seed, 256)?);
    let sandbox = Sandbox::new(settings)?;
    let mut server = sandbox.serve(robot, &[])?;
    let timeout = LIMIT;
    let askers = Askers::start(sandbox.domain(), &oracle, 1, timeout, settings.seed)?;
    let mut random = Rng::with_seed(settings.seed);

    let mut found = Vec::new();
    let mut clock = Clock::new("clear", settings.seconds);
    while clock.runs(|| format!("{} times cleared", found.len())) {
        std::thread::sleep(Duration::from_millis(random.u64(..300)));
        let _ = fs::remove_dir_all(sandbox.domain().root());
        let start = Instant::now();
        let transport = TRANSPORTS[found.len() % 2];
        loop {
            let attached =
                Honest::connect(sandbox.domain(), transport, timeout, &oracle, settings.seed);
            match attached {
                Ok(mut honest) => {
                    let answered = honest.ask();
                    report.require(answered.is_ok() && honest.counts.wrong == 0, || {
                        format!("a new client is answered {answered:?}")
                    });
                    break;
                }
                Err(error) if start.elapsed() > LIMIT => {
                    report.fault(format!("the server is not found any more: {error}"));
                    return Ok(Verdict::Done(report));
                }
                Err(_) => std::thread::sleep(Duration::from_millis(5)),
            }
        }
        found.push(start.elapsed());
    }
    if let Some(status) = server.ended() {
        report.fault(format!("the server ended with {status}"));
    }
    report.times("found again after its folder was removed", &mut found, Some(FOUND));
    askers.finish().report(&mut report, "clients from before", false);
    server.stop()?;
    sandbox.require_empty(&mut report);
    Ok(Verdict::Done(report))
}
