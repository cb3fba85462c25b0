//! `sarrus serve`.

mod backoff;
mod log;
mod supervise;

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;
use sarrus_client::describe;
use sarrus_dynamics::Model;
use sarrus_models::{LoadError, Loaded};
use sarrus_proto::{Domain, ModelInfo, ServerName, supervision};
use sarrus_serve::record::{RecordOptions, RecordedRobot};
use sarrus_serve::system::stderr::line;
use sarrus_serve::{Kernels, ServeError, ServeOptions, Wait, serve};
use signal_hook::consts::{SIGINT, SIGTERM};

use super::output::{self, Outcome, Results};
use super::robot::RobotFlags;
use super::{Choices, choice};
use log::LogFlags;
use supervise::{FAILED, TAKEN, print_line};

/// Flags of `serve`.
#[derive(Args)]
pub(crate) struct Serve {
    #[command(flatten)]
    robot: RobotFlags,
    /// Name under which clients find the server.
    #[arg(long, default_value = "default")]
    name: String,
    /// How to wait for requests; without it, busy where there are three processors or more.
    #[arg(long, value_parser = choice(&WAITS))]
    wait: Option<Wait>,
    /// Number of clients that can have a lane at one time.
    #[arg(long, default_value_t = 16)]
    lanes: usize,
    /// Serve in a child process and start it again when it dies.
    #[arg(long)]
    supervise: bool,
    /// Processor of the answering thread; all other threads leave it.
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Priority of the answering thread under SCHED_FIFO, 1 to 99.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Lock memory, so that the answering thread meets no page fault.
    #[arg(long)]
    lock_memory: bool,
    /// Answer by generated code, with the same bits: FILE is a shared object of `sarrus generate`
    /// and answers its query; auto compiles each query that clients register in the background (CC,
    /// or cc) and keeps the results in the cache (XDG_CACHE_HOME).
    #[arg(long, value_name = "none|auto|FILE", default_value = "none")]
    kernel: PathBuf,
    /// Keep the last requests and answers in this file, for `sarrus replay`; files of
    /// earlier runs are kept as FILE.1 to FILE.4.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Seconds of requests to keep at least, with every lane at 1 kHz.
    #[arg(
        long,
        value_name = "N",
        requires = "record",
        default_value_t = 60,
        value_parser = clap::value_parser!(u32).range(1..=86_400)
    )]
    record_seconds: u32,
    #[command(flatten)]
    log: LogFlags,
    /// Serve as the child of the supervisor with this process number.
    #[arg(long, value_name = "PROCESS", hide = true, conflicts_with = "supervise")]
    supervisor: Option<i32>,
    /// Serve in place of a server with this fingerprint that died.
    #[arg(long, value_name = "FINGERPRINT", hide = true, requires = "supervisor")]
    again: Option<String>,
    /// Load this object for the robot, compare its answers, and end.
    #[arg(long, value_name = "FILE", hide = true, conflicts_with = "supervise")]
    try_kernel: Option<PathBuf>,
    /// Folder of a test that stands for /sys/fs/cgroup, with `self` for /proc/self/cgroup.
    #[arg(long, value_name = "FOLDER", hide = true)]
    cgroups: Option<PathBuf>,
    /// Seconds of life after which the next server starts without delay.
    #[arg(long, value_name = "SECONDS", hide = true, default_value_t = 10)]
    short_life: u64,
}

const WAITS: Choices<Wait, 2> = [
    (Wait::Busy, "busy", "Poll without pause: lowest latency, one whole processor"),
    (Wait::Sleep, "sleep", "Sleep 50 µs at a time when idle"),
];

/// The reason why the command cannot serve.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
enum ServeFailure {
    Load(#[from] LoadError),
    Serve(#[from] ServeError),
    #[error("{0}")]
    Other(String),
}

impl Serve {
    pub(crate) fn run(self) -> Outcome {
        // neither a caught panic of the transport nor an end, for which a supervisor waits, may
        // wait for a reader of stderr
        std::panic::set_hook(Box::new(|panic| line(format_args!("sarrus serve: {panic}"))));
        let code = self.run_until_stopped().unwrap_or_else(|failure| {
            failure.text("serve").lines().for_each(|words| line(format_args!("{words}")));
            failure.code
        });
        Ok(Results { text: String::new(), code })
    }

    fn run_until_stopped(&self) -> Result<u8, output::Failure> {
        self.log.start().map_err(output::Failure::start)?;
        Ok(if self.supervise {
            let robot = RecordedRobot::new(&self.robot.source(), &self.robot.options());
            supervise::run(&self.name, Duration::from_secs(self.short_life), robot.ok())?
        } else if let Some(object) = &self.try_kernel {
            let loaded = self.robot.load()?;
            Kernels::of_file(object, &loaded.compiled.model).map_err(output::Failure::start)?;
            print_line("compared");
            0
        } else if self.supervisor.is_some_and(|supervisor| !supervise::die_with(supervisor)) {
            2
        } else {
            let stop = output::stop_at(&[SIGTERM, SIGINT])?;
            self.serve(&stop).map_err(|failure| self.report(failure))?;
            0
        })
    }

    /// Loads the robot and serves it until a signal.
    fn serve(&self, stop: &AtomicBool) -> Result<(), ServeFailure> {
        let mut options = self.options();
        options.check()?;
        let (loaded, robot) = self.load()?;
        let info = describe(&loaded);
        options.record = self.record(robot);
        options.kernels = self.kernels(&loaded.compiled.model)?;
        // the first server of a supervisor has printed the warnings
        if self.again.is_none() {
            self.warn(&info, options.record.as_ref());
        }
        let ready = || {
            // a reason left by an earlier supervisor no longer holds
            if let (Ok(domain), Ok(name)) = (Domain::of_user(), ServerName::new(&self.name)) {
                supervision::clear(domain.root(), &name);
            }
            print_line(&format!("ready {} {:016x}", self.name, info.fingerprint));
        };
        Ok(serve(Arc::new(loaded.compiled.model), &info, &options, stop, ready)?)
    }

    /// The robot and its files, read now; where they have changed since the supervisor's first
    /// server, as the supervisor read them before it.
    fn load(&self) -> Result<(Loaded, RecordedRobot), ServeFailure> {
        let loaded = self.robot.load();
        let now = RecordedRobot::new(&self.robot.source(), &self.robot.options());
        let Some(served) = &self.again else { return Ok((loaded?, now?)) };
        let fingerprint = |loaded: &Loaded| format!("{:016x}", loaded.compiled.model.fingerprint());
        if loaded.as_ref().is_ok_and(|loaded| fingerprint(loaded) == *served) {
            return Ok((loaded?, now?));
        }
        let copy: Option<RecordedRobot> = serde_json::from_reader(std::io::stdin().lock()).ok();
        if let Some(copy) = copy
            && let Ok(first) = copy.load()
            && fingerprint(&first) == *served
        {
            line(format_args!(
                "sarrus serve: warning: the robot's files have changed; the robot as first loaded \
                 is served until the supervisor is started again"
            ));
            return Ok((first, copy));
        }
        let found = fingerprint(&loaded?);
        Err(ServeFailure::Other(format!(
            "the robot's files have changed (fingerprint {found}, served was {served}); start the \
             supervisor again to serve the new robot"
        )))
    }

    fn warn(&self, info: &ModelInfo, record: Option<&RecordOptions>) {
        let is_served = |loaded: Loaded| loaded.compiled.model.fingerprint() == info.fingerprint;
        // the recorded files alone describe the robot that is served
        if record.is_some_and(|record| !record.robot.load().is_ok_and(is_served)) {
            line(format_args!(
                "sarrus serve: warning: the recording cannot hold this robot, whose files name \
                 further ones; replay it with --urdf"
            ));
        }
        for warning in &info.warnings {
            line(format_args!("sarrus serve: warning: {warning}"));
        }
    }

    /// Reports a failure to the supervisor, where there is one.
    fn report(&self, failure: ServeFailure) -> output::Failure {
        if self.supervisor.is_some() {
            let (word, reason) = match &failure {
                ServeFailure::Load(error) => (FAILED, first_line(error)),
                ServeFailure::Serve(error @ ServeError::NameTaken(_)) => (TAKEN, error.to_string()),
                other => (FAILED, other.to_string()),
            };
            print_line(&format!("{word} {}", reason.replace(['\n', '\r'], " ")));
        }
        match failure {
            ServeFailure::Load(error) => error.into(),
            other => output::Failure::start(other),
        }
    }

    fn options(&self) -> ServeOptions {
        let wait = self.wait.unwrap_or_else(Wait::auto);
        let &Serve { lanes, cpu, priority, lock_memory, supervisor, .. } = self;
        ServeOptions {
            name: self.name.clone(),
            wait,
            lanes,
            cpu,
            priority,
            lock_memory,
            supervisor,
            cgroups: self.cgroups.clone(),
            ..ServeOptions::default()
        }
    }

    /// The kernels of the clients' plans.
    fn kernels(&self, model: &Model<f64>) -> Result<Kernels, ServeError> {
        // a file called `auto` is `./auto`
        let kernels = match self.kernel.to_str() {
            Some("none") => Ok(Kernels::default()),
            Some("auto") => Kernels::auto(trial),
            _ => Kernels::of_file(&self.kernel, model),
        };
        match kernels {
            // a file that went bad after the first start makes answers slow, not wrong
            Err(error) if self.again.is_some() => {
                line(format_args!("sarrus serve: warning: {error}; the generic kernels answer"));
                Ok(Kernels::default())
            }
            kernels => kernels,
        }
    }

    /// The recording, with the robot's files in it; `None` without `--record`.
    fn record(&self, robot: RecordedRobot) -> Option<RecordOptions> {
        let file = self.record.clone()?;
        // a server that was announced answers, recorded or not
        let is_optional = self.again.is_some();
        Some(RecordOptions { file, seconds: self.record_seconds, robot, is_optional })
    }
}

/// This program with its arguments, as the process that tries an object before this one loads it.
fn trial(object: &Path) -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("sarrus").args(std::env::args_os().skip(1)).arg("--try-kernel").arg(object);
    command
}

/// The first fault of a robot, and the number of the others.
fn first_line(error: &LoadError) -> String {
    match error {
        LoadError::Faults(report) => {
            let first = report.errors.first().map(ToString::to_string).unwrap_or_default();
            match report.errors.len() {
                0 | 1 => first,
                n => format!("{first} (and {} more)", n - 1),
            }
        }
        other => other.to_string(),
    }
}
