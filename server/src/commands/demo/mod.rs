//! `sarrus demo`: a server process, a controller, and every answer checked.

mod process;
mod processors;
mod report;
mod trajectory;

use std::io;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::Args;
use hdrhistogram::Histogram;
use rustix::thread::sched_setaffinity;
use sarrus_client::{
    Answer, ConnectOptions, Error, Options, Robot, Source, Status, Transport, WaitStrategy,
    describe,
};
use sarrus_dynamics::{Plan, Workspace};
use sarrus_models::{bundled, load};
use sarrus_serve::Wait;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::output::{Failure, FormatFlag, Outcome, Results, stop_at};
use super::progress::Progress;
use process::ServerProcess;
use report::{Report, Way};
use trajectory::{QUERY, Reference, SAMPLES, Trajectory};

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

impl Demo {
    pub(crate) fn run(self) -> Outcome {
        let stop = stop_at(&[SIGINT, SIGTERM, SIGHUP])?;
        let report = demo(&stop);
        if stop.load(Relaxed) {
            // the exit code that shells give an interrupted program
            return Err(Failure { code: 130, ..stopped() });
        }
        let report = report?;
        let about = bundled().find(|(name, _)| *name == ROBOT).map_or("", |(_, about)| about);
        let text = self.format.render(&report, |report| report.in_words(about));
        Ok(Results { text, code: u8::from(!report.good) })
    }
}

fn stopped() -> Failure {
    Failure::start("stopped")
}

fn demo(stop: &AtomicBool) -> Result<Report, Failure> {
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
    let reference = reference.ok_or_else(stopped)?;
    let model = loaded.compiled.model;
    let plan = Plan::new(&model, &QUERY).map_err(Failure::start)?;
    let counts = (plan.given().len(), plan.want().len());
    let course = Course { trajectory, reference, counts };

    // the computation without a server
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
    let failed = |error: io::Error| Failure::start(format!("the server does not start: {error}"));
    let processors = processors::split();
    let take = |part: usize| {
        let set = processors.as_ref().map(|parts| &parts[part]);
        set.map_or(Ok(()), |set| sched_setaffinity(None, set)).map_err(|error| failed(error.into()))
    };
    // the server inherits the processors of this thread
    take(0)?;
    let _server = ServerProcess::start(ROBOT, &name, wait).map_err(failed)?;
    take(1)?;
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
        let mut robot = Robot::connect_with(&name, options).map_err(Failure::start)?;
        let plan = robot.prepare(&QUERY).map_err(Failure::start)?;
        let through = |input: &[f64], output: &mut [f64]| robot.ask(plan, input, output);
        ways.push(
            course.ask(way, LONG, through, |done| go_on(way, 0.3 + 0.35 * (k as f64 + done)))?,
        );
    }
    ways.push(alone);
    #[cfg(feature = "show")]
    let page = page();
    #[cfg(not(feature = "show"))]
    let page = None;
    Ok(Report::new(&info, course.counts, course.reference.failed == 0, ways, page))
}

/// Writes the robot as a page into the folder of temporary files; none where it cannot be written.
#[cfg(feature = "show")]
fn page() -> Option<std::path::PathBuf> {
    let source = Source::Bundled(ROBOT.to_owned());
    let options = Options::default();
    let loaded = load(&source, &options).ok()?;
    let settings = sarrus_show::Settings::new(&source, &options, true);
    let path = std::env::temp_dir().join(format!("sarrus_{ROBOT}.html"));
    // not through another user's link
    let _ = std::fs::remove_file(&path);
    let text = sarrus_show::page(&loaded, &settings).ok()?;
    let mut file = std::fs::File::create_new(&path).ok()?;
    io::Write::write_all(&mut file, text.as_bytes()).ok()?;
    Some(path)
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
    ) -> Result<Way, Failure> {
        let mut input = vec![0.0; self.counts.0];
        let mut output = vec![0.0; self.counts.1];
        // up to an hour, three digits
        let mut times =
            Histogram::<u64>::new_with_bounds(1, 3_600_000_000_000, 3).map_err(Failure::start)?;
        let mut failed = 0;
        let mut worst = 0.0_f64;
        let begin = Instant::now();
        let mut passes = 0;
        while passes == 0 || begin.elapsed() < time {
            for k in 0..SAMPLES {
                self.trajectory.sample(k, &mut input);
                let start = Instant::now();
                let answer = ask(&input, &mut output).map_err(Failure::start)?;
                times.saturating_record(start.elapsed().as_nanos() as u64);
                failed += u64::from(answer.status != Status::Ok);
                worst = worst.max(self.reference.error(k, &output));
                if k % 64 == 0
                    && !go_on((begin.elapsed().as_secs_f64() / time.as_secs_f64()).min(1.0))
                {
                    return Err(stopped());
                }
            }
            passes += 1;
        }
        Ok(Way::new(way, &times, failed, worst))
    }
}
