//! Clients write random bytes into shared memory and cut its files short: the numbers of their own
//! lanes, or with flags the transport's own records and the memory of other clients.

use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;
use fastrand::Rng;

use crate::Settings;
use crate::honest::{Askers, TRANSPORTS};
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::process::Process;
use crate::report::{Clock, Report, Verdict};
use crate::roles::transport_flags;
use crate::sandbox::{Sandbox, words};

/// The ending of the files that hold numbers of lanes and no records of the transport.
const NUMBERS: &str = ".blackboard_data";
/// Scribblers at one time.
const SCRIBBLERS: usize = 3;

#[derive(Args, Default)]
pub(crate) struct Scribble {
    /// Scribble over the transport's own records as well, and cut them short. The server may end, a
    /// limit that SECURITY.md names: ends are counted, and are no fault.
    #[arg(long)]
    records: bool,
    /// Scribble over the memory of all clients, with the same limit.
    #[arg(long)]
    others: bool,
    /// Only into files whose names hold this.
    #[arg(long)]
    only: Option<String>,
    /// Cut files short only, or never.
    #[arg(long)]
    truncate: Option<bool>,
}

impl Scribble {
    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        let mut report = Report::new(settings);
        let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
        let oracle = Arc::new(Oracle::new(robot, settings.seed, 256)?);
        let sandbox = Sandbox::new(settings)?;
        let mut random = Rng::with_seed(settings.seed);
        let is_limit = self.records || self.others;
        let only = self.only.clone().or((!self.records).then(|| NUMBERS.to_owned()));
        let mut clock = Clock::new("scribble", settings.seconds);
        let mut scribblers_made = 0_u64;
        let mut deaths = BTreeMap::<String, u64>::new();
        let mut total = crate::honest::Counts::default();
        let mut over = false;
        while !over {
            let mut server = sandbox.serve(robot, &[])?;
            // a damaged server may never answer
            let timeout = if is_limit { Duration::from_secs(2) } else { LIMIT };
            let askers = Askers::start(sandbox.domain(), &oracle, 1, timeout, settings.seed)?;
            let mut scribblers: Vec<(Process, Instant, String)> = Vec::new();
            let mut recent = Vec::new();
            loop {
                over = !clock.runs(|| format!("{scribblers_made} scribblers, {deaths:?} deaths"));
                if let Some(status) = server.ended() {
                    let how =
                        status.signal().map_or(format!("{status}"), |n| format!("signal {n}"));
                    *deaths.entry(how.clone()).or_default() += 1;
                    if !is_limit {
                        report.fault(format!("the server ended by {how} under {recent:?}"));
                    }
                    break;
                }
                if over {
                    break;
                }
                let now = Instant::now();
                scribblers.retain_mut(|(process, end, _)| {
                    now < *end && matches!(process.0.try_wait(), Ok(None))
                });
                while scribblers.len() < SCRIBBLERS {
                    let seed = random.u64(..1 << 32);
                    let truncate = self.truncate.unwrap_or(random.u8(..4) == 0);
                    let mut flags = vec!["--seed".to_owned(), seed.to_string()];
                    flags.extend(transport_flags(TRANSPORTS[random.usize(..2)]));
                    flags.extend(truncate.then(|| "--truncate".to_owned()));
                    flags.extend(self.others.then(|| "--others".to_owned()));
                    if let Some(part) = &only {
                        flags.extend(["--only".to_owned(), part.clone()]);
                    }
                    let process = sandbox.role("scribbler", &flags)?.spawn().map_err(words)?;
                    let end = now + Duration::from_millis(random.u64(20..200));
                    scribblers_made += 1;
                    let what = flags.join(" ");
                    if recent.len() >= SCRIBBLERS {
                        recent.remove(0);
                    }
                    recent.push(what.clone());
                    scribblers.push((Process(process), end, what));
                }
                std::thread::sleep(Duration::from_millis(2));
            }
            total.add(askers.finish());
            drop(scribblers);
            if server.ended().is_none() {
                server.stop().map_err(|error| format!("{error}, after {recent:?}"))?;
            }
        }
        report.count(format!("{scribblers_made} scribblers, deaths of the server: {deaths:?}"));
        match is_limit {
            true => report.count(format!(
                "others: {} answers, {} wrong, {} lost (a limit that is documented)",
                total.answers, total.wrong, total.lost
            )),
            false => total.report(&mut report, "honest clients", false),
        }
        Ok(Verdict::Done(report))
    }
}
