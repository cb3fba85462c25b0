//! Servers are killed under their clients, and start again; clients go on by themselves.

use std::fs;
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use clap::Args;
use fastrand::Rng;
use rustix::process::Signal;

use crate::Settings;
use crate::honest::Askers;
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::process::send_signal;
use crate::report::{Clock, Report, Verdict};
use crate::sandbox::{Sandbox, Server, program, words};

/// A client should be answered again within this after a kill.
const BACK: Duration = Duration::from_millis(100);

#[derive(Args, Default)]
pub(crate) struct KillServers {
    /// Kill the child of `serve --supervise` and let that start the next one, four times a minute.
    #[arg(long)]
    supervise: bool,
}

impl KillServers {
    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        if self.supervise && !can_supervise(settings)? {
            return Ok(Verdict::NotRun("`sarrus serve` has no flag --supervise".to_owned()));
        }
        let mut report = Report::new(settings);
        let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
        let oracle = Arc::new(Oracle::new(robot, settings.seed, 512)?);
        let sandbox = Sandbox::new(settings)?;
        let flags: &[&str] = if self.supervise { &["--supervise"] } else { &[] };
        let mut server = sandbox.serve(robot, flags)?;

        // a request that a kill fell into, or the first one after it, is answered after a gap
        let kills = Arc::new(AtomicU64::new(0));
        let gaps = Arc::new(Mutex::new(Vec::new()));
        let seen = kills.clone();
        let all_gaps = gaps.clone();
        let mut last = [0_u64; 8];
        let timeout = LIMIT;
        let ask = move |honest: &mut crate::honest::Honest, number: usize| {
            let start = Instant::now();
            let asked = honest.ask().is_ok();
            let now = seen.load(Relaxed);
            let Some(last) = last.get_mut(number) else { return };
            if asked && *last != now {
                *last = now;
                if let Ok(mut gaps) = all_gaps.lock() {
                    gaps.push(start.elapsed());
                }
            }
        };
        let askers = Askers::start_with(sandbox.domain(), &oracle, 2, timeout, settings.seed, ask)?;

        let mut random = Rng::with_seed(settings.seed);
        let mut starts_killed = 0_u64;
        let mut gone_by_itself = 0_u64;
        let mut clock = Clock::new("kill-servers", settings.seconds);
        while clock.runs(|| format!("{} kills", kills.load(Relaxed))) {
            if self.supervise {
                // seldom enough that it does not give up
                std::thread::sleep(Duration::from_millis(random.u64(13_000..16_000)));
                let Some(child) = child_of(server.id()) else { continue };
                send_signal(child, Signal::KILL);
                kills.fetch_add(1, Relaxed);
                continue;
            }
            std::thread::sleep(Duration::from_micros(random.u64(..150_000)));
            if let Some(status) = server.ended() {
                report.fault(format!("the server ended by itself with {status}"));
                gone_by_itself += 1;
            }
            server.signal(Signal::KILL);
            kills.fetch_add(1, Relaxed);
            drop(server);
            // some are killed before they are ready
            while random.u8(..3) == 0 {
                let mut early = sandbox.command(robot, &[]).spawn().map_err(words)?;
                std::thread::sleep(Duration::from_micros(random.u64(..40_000)));
                early.kill().and_then(|()| early.wait()).map_err(words)?;
                starts_killed += 1;
            }
            server = sandbox.serve(robot, &[])?;
        }
        // the last gap ends
        std::thread::sleep(Duration::from_millis(500));
        let counts = askers.finish();
        let kills = kills.load(Relaxed);
        report.count(format!(
            "{kills} kills of a server that answers, {starts_killed} of one that starts, \
             {gone_by_itself} ended by themselves"
        ));
        counts.report(&mut report, "clients", false);
        if let Ok(mut gaps) = gaps.lock() {
            report.times("answered again after a kill", &mut gaps, Some(BACK));
        }
        check_end(&sandbox, server, &mut report)?;
        Ok(Verdict::Done(report))
    }
}

fn check_end(sandbox: &Sandbox, server: Server, report: &mut Report) -> Result<(), String> {
    server.stop()?;
    sandbox.require_empty(report);
    Ok(())
}

/// Whether this `sarrus` watches over its server itself.
fn can_supervise(settings: &Settings) -> Result<bool, String> {
    let help = Command::new(program(settings)?).args(["serve", "--help"]).output();
    Ok(String::from_utf8_lossy(&help.map_err(words)?.stdout).contains("--supervise"))
}

/// The process that a supervisor watches over.
fn child_of(process: u32) -> Option<u32> {
    let path = format!("/proc/{process}/task/{process}/children");
    fs::read_to_string(path).ok()?.split_whitespace().next()?.parse().ok()
}
