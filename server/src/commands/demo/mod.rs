//! `sarrus demo`: a server process, a controller, and every answer checked.

mod process;
mod processors;
mod report;
mod trajectory;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::Args;
use hdrhistogram::Histogram;
use sarrus_client::{
    Answer, ConnectError, ConnectOptions, Error, LoadError, Options, Robot, Source, Status,
    Transport, WaitStrategy, describe,
};
use sarrus_dynamics::{Plan, Workspace};
use sarrus_models::{bundled, load};
use sarrus_server::Wait;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::output::{Failure, FormatFlag, Outcome, Results};
use super::progress::Progress;
use process::ServerProcess;
use processors::Processors;
use report::{Report, Way};
use trajectory::{QUERY, Reference, SAMPLES, Trajectory, counts};

const ROBOT: &str = "rh5v2_upper_body";
/// Time of the requests through each transport, at least one whole movement.
const LONG: Duration = Duration::from_millis(1200);
/// Time of the requests without a server.
const SHORT: Duration = Duration::from_millis(400);

/// Longest wait for an answer, for busy computers.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Flags of `demo`.
#[derive(Args)]
pub(crate) struct Demo {
    #[command(flatten)]
    format: FormatFlag,
}

/// The reason why there is no report.
#[derive(Debug, thiserror::Error)]
enum DemoError {
    #[error("stopped")]
    Stopped,
    #[error("signal {signal} cannot be caught: {source}")]
    Signal { signal: i32, source: std::io::Error },
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error("the server does not start: {0}")]
    Server(std::io::Error),
    #[error(transparent)]
    Connect(#[from] ConnectError),
    #[error(transparent)]
    Ask(#[from] Error),
    #[error("times of an hour cannot be counted")]
    Histogram,
}

impl Demo {
    pub(crate) fn run(self) -> Outcome {
        let stop = Arc::new(AtomicBool::new(false));
        let report = demo(&stop);
        if stop.load(Relaxed) {
            // the exit code that shells give an interrupted program
            return Err(Failure { code: 130, ..Failure::start(DemoError::Stopped) });
        }
        let report = report.map_err(Failure::start)?;
        let about = bundled().find(|(name, _)| *name == ROBOT).map_or("", |(_, about)| about);
        let text = self.format.render(&report, |report| report.in_words(about));
        Ok(Results { text, code: u8::from(!report.good) })
    }
}

fn demo(stop: &Arc<AtomicBool>) -> Result<Report, DemoError> {
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, stop.clone())
            .map_err(|source| DemoError::Signal { signal, source })?;
    }
    let mut progress = Progress::new();
    let mut go_on = |step: &str, done: f64| {
        progress.show(step, done);
        !stop.load(Relaxed)
    };

    // the reference, before any measurement
    let loaded = load(&Source::Bundled(ROBOT.to_owned()), &Options::default())?;
    let info = describe(&loaded);
    let trajectory = Trajectory::new(&info);
    let reference = Reference::compute(&loaded.compiled.exact, &trajectory, |done| {
        go_on("in double-double", 0.2 * done)
    });
    let reference = reference.ok_or(DemoError::Stopped)?;
    let course = Course { trajectory, reference, counts: counts(&info) };

    // the computation without a server
    let model = loaded.compiled.model;
    let plan = Plan::new(&model, &QUERY).map_err(Error::Query)?;
    let mut workspace = Workspace::new(&model);
    let in_process =
        |input: &[f64], output: &mut [f64]| Ok(plan.run(&model, &mut workspace, input, output));
    let alone = course.ask("in process, no server", SHORT, in_process, |done| {
        go_on("in process", 0.2 + 0.1 * done)
    })?;

    // the server, through both transports
    let name = format!("demo-{}", std::process::id());
    // chosen before the processors are split: the choice depends on their number
    let wait = Wait::auto();
    let wait_strategy = WaitStrategy::auto();
    let processors = Processors::split();
    processors.iter().try_for_each(Processors::take_servers).map_err(DemoError::Server)?;
    let _server = ServerProcess::start(ROBOT, &name, wait).map_err(DemoError::Server)?;
    processors.iter().try_for_each(Processors::take_controllers).map_err(DemoError::Server)?;
    let mut ways = Vec::new();
    for (k, (transport, way)) in
        [(Transport::Lane, "lane"), (Transport::Service, "service")].into_iter().enumerate()
    {
        let options = ConnectOptions {
            transport,
            timeout: TIMEOUT,
            wait_strategy,
            fingerprint: Some(info.fingerprint),
            ..ConnectOptions::default()
        };
        let mut robot = Robot::connect_with(&name, options)?;
        let plan = robot.prepare(&QUERY)?;
        let through = |input: &[f64], output: &mut [f64]| robot.ask(plan, input, output);
        ways.push(
            course.ask(way, LONG, through, |done| go_on(way, 0.3 + 0.35 * (k as f64 + done)))?,
        );
    }
    ways.push(alone);
    Ok(Report::new(&info, course.counts, course.reference.failed == 0, ways))
}

/// The repeated movement and its reference.
struct Course {
    trajectory: Trajectory,
    reference: Reference,
    counts: (usize, usize),
}

impl Course {
    /// Follows the movement for some time and checks every answer.
    fn ask(
        &self,
        way: &'static str,
        time: Duration,
        mut ask: impl FnMut(&[f64], &mut [f64]) -> Result<Answer, Error>,
        mut go_on: impl FnMut(f64) -> bool,
    ) -> Result<Way, DemoError> {
        let mut input = vec![0.0; self.counts.0];
        let mut output = vec![0.0; self.counts.1];
        // up to an hour, three digits
        let mut times = Histogram::<u64>::new_with_bounds(1, 3_600_000_000_000, 3)
            .map_err(|_| DemoError::Histogram)?;
        let mut failed = 0;
        let mut worst = 0.0_f64;
        let begin = Instant::now();
        let mut passes = 0;
        while passes == 0 || begin.elapsed() < time {
            for k in 0..SAMPLES {
                self.trajectory.sample(k, &mut input);
                let start = Instant::now();
                let answer = ask(&input, &mut output)?;
                times.saturating_record(start.elapsed().as_nanos() as u64);
                failed += u64::from(answer.status != Status::Ok);
                worst = worst.max(self.reference.error(k, &output));
                if k % 64 == 0
                    && !go_on((begin.elapsed().as_secs_f64() / time.as_secs_f64()).min(1.0))
                {
                    return Err(DemoError::Stopped);
                }
            }
            passes += 1;
        }
        Ok(Way::new(way, &times, failed, worst))
    }
}
