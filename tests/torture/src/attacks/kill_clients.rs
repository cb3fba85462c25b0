//! Clients are killed while they attach and ask; others go on, and nothing is left of the dead.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;
use fastrand::Rng;
use rustix::process::Signal;
use sarrus_client::{Statistics, Transport};
use sarrus_proto::control::{Call, Grant, Refusal};

use crate::Settings;
use crate::honest::{Askers, TRANSPORTS};
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::process::{Process, send_signal};
use crate::raw::Raw;
use crate::report::{Clock, Report, Verdict};
use crate::roles::{Stage, transport_flags};
use crate::sandbox::{NAME, Sandbox, Server};

/// A lane of a dead client should serve the next one within this.
const FREE: Duration = Duration::from_millis(10);
/// Growth of a server's memory that its allocator may keep `[kB]`.
const SLACK: u64 = 4096;

#[derive(Args)]
pub(crate) struct KillClients {
    /// Clients at one time.
    #[arg(long, default_value_t = 8)]
    clients: usize,
}

impl Default for KillClients {
    fn default() -> KillClients {
        KillClients { clients: 8 }
    }
}

/// Resources of the server, which must not grow.
#[derive(Debug, PartialEq, Eq)]
struct Holdings {
    descriptors: usize,
    files: usize,
    lanes: u64,
    plans: u64,
}

impl Holdings {
    /// True if any count is larger than before; a slow machine may still hold more before.
    fn exceeds(&self, before: &Holdings) -> bool {
        self.descriptors > before.descriptors
            || self.files > before.files
            || self.lanes > before.lanes
            || self.plans > before.plans
    }
}

impl KillClients {
    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        let mut report = Report::new(settings);
        let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
        let oracle = Arc::new(Oracle::new(robot, settings.seed, 512)?);
        let sandbox = Sandbox::new(settings)?;
        let mut server = sandbox.serve(robot, &[])?;
        let timeout = LIMIT;
        let askers = Askers::start(sandbox.domain(), &oracle, 1, timeout, settings.seed)?;
        let observer = Raw::greet(sandbox.domain(), NAME)?;

        // resources that a first round takes for good are no leak
        let mut random = Rng::with_seed(settings.seed);
        let warm = settings.seconds.min(2.0) / 4.0;
        self.kill(&sandbox, &mut random, Clock::new("kill-clients", warm))?;
        let before = settle(&sandbox, &server, &observer, None)?;
        let memory = server.memory();

        let clock = Clock::new("kill-clients", 0.75 * settings.seconds);
        let kills = self.kill(&sandbox, &mut random, clock)?;
        let after = settle(&sandbox, &server, &observer, Some(&before))?;
        let counts = askers.finish();

        let by_stage: Vec<String> =
            kills.iter().map(|(stage, n)| format!("{} {n}", stage.flag())).collect();
        report.count(format!("{} kills: {}", kills.values().sum::<u64>(), by_stage.join(", ")));
        counts.report(&mut report, "honest clients", false);
        report.count(format!(
            "before {before:?}, after {after:?}, memory {memory} then {} kB",
            server.memory()
        ));
        report.require(!after.exceeds(&before), || {
            format!("left behind: {before:?} became {after:?}")
        });
        report.require(server.memory() <= memory + SLACK, || {
            format!("memory grew from {memory} to {} kB", server.memory())
        });
        if let Some(status) = server.ended() {
            report.fault(format!("the server ended with {status}"));
        } else {
            drop(observer);
            server.stop()?;
            sandbox.require_empty(&mut report);
        }
        drop(sandbox);
        free_again(settings, robot, &mut report)?;
        Ok(Verdict::Done(report))
    }

    /// Kills clients at random; how many after each stage.
    fn kill(
        &self,
        sandbox: &Sandbox,
        random: &mut Rng,
        mut clock: Clock,
    ) -> Result<BTreeMap<Stage, u64>, String> {
        let mut kills = BTreeMap::<Stage, u64>::new();
        let mut victims: Vec<(Process, Stage)> = Vec::new();
        while clock.runs(|| format!("{} kills", kills.values().sum::<u64>())) {
            victims.retain_mut(|(victim, stage)| match victim.0.try_wait() {
                Ok(Some(status)) => {
                    // one that was refused was not killed
                    if !status.success() && status.code().is_none() {
                        *kills.entry(*stage).or_default() += 1;
                    }
                    false
                }
                _ => true,
            });
            if victims.len() >= self.clients.max(1) {
                std::thread::sleep(Duration::from_micros(300));
                continue;
            }
            let stage = *random.choice(&Stage::WEIGHTED).unwrap_or(&Stage::Granted);
            // at once, or up to some milliseconds later, short spans as often as long ones
            let delay = match random.u8(..3) {
                0 => 0,
                _ => 2_f64.powf(12.0 * random.f64()) as u64,
            };
            let transport = TRANSPORTS[random.usize(..2)];
            let flags = ["--stage".to_owned(), stage.flag(), "--delay".into(), delay.to_string()];
            let flags = flags.into_iter().chain(transport_flags(transport));
            let victim = sandbox.role("victim", flags)?.spawn().map_err(crate::sandbox::words)?;
            victims.push((Process(victim), stage));
        }
        Ok(kills)
    }
}

/// The resources when they are at most `expected`, or no longer change.
fn settle(
    sandbox: &Sandbox,
    server: &Server,
    observer: &Raw,
    expected: Option<&Holdings>,
) -> Result<Holdings, String> {
    let start = Instant::now();
    let mut last = look(sandbox, server, observer)?;
    let mut same = 0;
    while start.elapsed() < LIMIT {
        std::thread::sleep(Duration::from_millis(50));
        let next = look(sandbox, server, observer)?;
        same = if next == last { same + 1 } else { 0 };
        last = next;
        if expected.map_or(same >= 10, |expected| !last.exceeds(expected)) {
            break;
        }
    }
    Ok(last)
}

fn look(sandbox: &Sandbox, server: &Server, observer: &Raw) -> Result<Holdings, String> {
    let Grant::Statistics(statistics) = observer.call(Call::Statistics)? else {
        return Err("no statistics".to_owned());
    };
    let Statistics { lanes_taken, plans, process, .. } = *statistics;
    if process != u64::from(server.id()) {
        return Err(format!("process {process} answers instead of {}", server.id()));
    }
    let files = sandbox.files().len();
    Ok(Holdings { descriptors: server.descriptors(), files, lanes: lanes_taken, plans })
}

/// Measures the time from a kill until the only lane of a server is granted to the next client.
fn free_again(settings: &Settings, robot: &str, report: &mut Report) -> Result<(), String> {
    let sandbox = Sandbox::new(settings)?;
    let server = sandbox.serve(robot, &["--lanes", "1"])?;
    let mut since_kill = Vec::new();
    let mut since_death = Vec::new();
    let mut clock = Clock::new("kill-clients", 0.25 * settings.seconds);
    while clock.runs(|| format!("{} lanes granted again", since_kill.len())) {
        let flags = ["--stage", "never", "--tell"].map(str::to_owned);
        let flags = flags.into_iter().chain(transport_flags(Transport::Lane));
        let mut command = sandbox.role("victim", flags)?;
        let mut victim =
            Process(command.stdout(Stdio::piped()).spawn().map_err(crate::sandbox::words)?);
        let mut line = String::new();
        if let Some(out) = victim.0.stdout.take() {
            let _ = BufReader::new(out).read_line(&mut line);
        }
        if line != "answered\n" {
            return Err(format!("the holder of the lane was not answered: {line}"));
        }
        let next = Raw::greet(sandbox.domain(), NAME)?;
        if !matches!(next.try_call(Call::Lane { n_in: 1, n_out: 1 })?, Err(Refusal::NoLane { .. }))
        {
            report.fault("the only lane was granted twice");
        }
        let killed = Instant::now();
        send_signal(victim.0.id(), Signal::KILL);
        let _ = victim.0.wait();
        let dead = Instant::now();
        loop {
            match next.try_call(Call::Lane { n_in: 1, n_out: 1 })? {
                Ok(_) => break,
                Err(Refusal::NoLane { .. }) if dead.elapsed() < LIMIT => {}
                Err(refusal) => return Err(format!("no lane: {refusal:?}")),
            }
        }
        since_kill.push(killed.elapsed());
        since_death.push(dead.elapsed());
    }
    report.times("lane granted again after the kill", &mut since_kill, None);
    report.times("lane granted again after the death", &mut since_death, Some(FREE));
    server.stop()?;
    Ok(())
}
