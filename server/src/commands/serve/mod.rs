//! `sarrus serve`.

mod log;
mod standby;
mod supervise;

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::{Args, ValueEnum};
use sarrus_client::describe;
use sarrus_dynamics::Model;
use sarrus_models::LoadError;
use sarrus_proto::{Domain, ServerName, supervision};
use sarrus_server::record::{RecordOptions, RecordedRobot};
use sarrus_server::{Kernels, ServeError, ServeOptions, Wait, serve};
use signal_hook::consts::{SIGINT, SIGTERM};

use super::kernel::KernelFlag;
use super::robot::{RobotFlags, refuse};
use log::LogFlags;
use standby::{Message, Order};

/// Flags of `serve`.
#[derive(Args)]
pub(crate) struct Serve {
    #[command(flatten)]
    robot: RobotFlags,
    /// Name under which clients find the server.
    #[arg(long, default_value = "default")]
    name: String,
    /// How to wait for requests; without it, busy where there are three processors or more.
    #[arg(long)]
    wait: Option<WaitFlag>,
    /// How many clients can have a lane at one time.
    #[arg(long, default_value_t = 16)]
    lanes: usize,
    /// Serve in a process of its own, and again when it dies: a second one is loaded and waits.
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
    /// Answer by generated code, with the same bits: FILE, a shared object of `sarrus generate` for
    /// its query, or auto: what the C compiler (CC, or cc) makes in the background of each query
    /// that clients register, kept in the cache (XDG_CACHE_HOME).
    #[arg(long, value_name = "none|auto|FILE", default_value = "none")]
    kernel: KernelFlag,
    /// Keep the last requests and answers in this file, for `sarrus replay`; one of an earlier run
    /// goes to FILE.1.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// How many seconds of them at least, with every lane at 1 kHz.
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
    /// Be a process of the supervisor that has this number: load, say so, and wait for an order.
    #[arg(long, value_name = "PROCESS", hide = true, conflicts_with = "supervise")]
    standby: Option<i32>,
    /// Seconds after which a server's death is no reason to wait before the next.
    #[arg(long, value_name = "SECONDS", hide = true, default_value_t = 10)]
    short_life: u64,
}

#[derive(Clone, Copy, ValueEnum)]
enum WaitFlag {
    /// Poll without pause: lowest latency, one whole processor.
    Busy,
    /// Sleep 50 µs at a time when idle.
    Sleep,
}

impl Serve {
    pub(crate) fn run(self) -> ExitCode {
        if let Err(words) = self.log.start() {
            eprintln!("sarrus serve: {words}");
            return ExitCode::from(2);
        }
        if self.supervise {
            return supervise::run(&self.name, Duration::from_secs(self.short_life));
        }
        if self.standby.is_some_and(|parent| !standby::die_with(parent)) {
            return ExitCode::from(2);
        }
        // a standby ends by its supervisor's word, or by any signal, until it serves
        let stop = Arc::new(AtomicBool::new(false));
        if self.standby.is_none()
            && let Err(code) = self.catch(&stop)
        {
            return code;
        }

        let mut options = self.options();
        if let Err(error) = options.check() {
            return self.fail(&error);
        }
        let loaded = match self.robot.load() {
            Ok(loaded) => loaded,
            Err(error) => {
                self.reply(&Message::Failed(first_line(&error)));
                return refuse("serve", &error);
            }
        };
        let info = describe(&loaded);
        // all that takes long, before the order
        options.record = match self.record() {
            Ok(record) => record,
            Err(error) => {
                self.reply(&Message::Failed(first_line(&error)));
                return refuse("serve", &error);
            }
        };
        let kernels = self.kernels(&loaded.compiled.model);
        let is_whole = |record: &RecordOptions| is_whole(&record.robot, info.fingerprint);
        let is_whole = options.record.as_ref().is_none_or(is_whole);
        let mut warn = true;
        if self.standby.is_some() {
            self.reply(&Message::Loaded(info.fingerprint));
            match standby::order() {
                Order::Serve => {}
                Order::ServeAgain => warn = false,
                Order::Leave => return ExitCode::SUCCESS,
            }
            if let Err(code) = self.catch(&stop) {
                return code;
            }
        }
        options.kernels = match kernels {
            Ok(kernels) => kernels,
            // what went bad since the first start makes answers slow, not wrong
            Err(error) if !warn => {
                eprintln!("sarrus serve: warning: {error}; the generic kernels answer");
                Kernels::default()
            }
            Err(error) => return self.fail(&error),
        };

        if warn {
            if !is_whole {
                eprintln!(
                    "sarrus serve: warning: the recording cannot hold this robot, whose files name \
                     further ones; replay it with --urdf"
                );
            }
            info.warnings.iter().for_each(|warning| eprintln!("sarrus serve: warning: {warning}"));
        }
        let ready = || {
            // whatever a supervisor gave up before: a server runs
            if let (Ok(domain), Ok(name)) = (Domain::of_user(), ServerName::new(&self.name)) {
                supervision::clear(domain.root(), &name);
            }
            print_line(&format!("ready {} {:016x}", self.name, info.fingerprint));
        };
        match serve(Arc::new(loaded.compiled.model), &info, &options, &stop, ready) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => self.fail(&error),
        }
    }

    fn options(&self) -> ServeOptions {
        let wait = match self.wait {
            None => Wait::auto(),
            Some(WaitFlag::Busy) => Wait::Busy,
            Some(WaitFlag::Sleep) => Wait::Sleep,
        };
        let &Serve { lanes, cpu, priority, lock_memory, .. } = self;
        let name = self.name.clone();
        let kernels = Kernels::default();
        ServeOptions { name, wait, lanes, cpu, priority, lock_memory, kernels, record: None }
    }

    /// The kernels of the plans of clients.
    fn kernels(&self, model: &Model<f64>) -> Result<Kernels, ServeError> {
        match &self.kernel {
            KernelFlag::None => Ok(Kernels::default()),
            KernelFlag::Auto => Kernels::auto(),
            KernelFlag::File(path) => Kernels::of_file(path, model),
        }
    }

    /// What to record, if anything is: the robot's files go with it.
    fn record(&self) -> Result<Option<RecordOptions>, LoadError> {
        let Some(file) = self.record.clone() else { return Ok(None) };
        let robot = self.robot.recorded()?;
        Ok(Some(RecordOptions { file, seconds: self.record_seconds, robot }))
    }

    /// From now on SIGTERM and SIGINT are a clean stop.
    fn catch(&self, stop: &Arc<AtomicBool>) -> Result<(), ExitCode> {
        for signal in [SIGTERM, SIGINT] {
            if let Err(error) = signal_hook::flag::register(signal, stop.clone()) {
                eprintln!("sarrus serve: signal {signal} cannot be caught: {error}");
                return Err(ExitCode::from(2));
            }
        }
        Ok(())
    }

    /// Says why it does not serve: to people, and to the supervisor where there is one.
    fn fail(&self, error: &ServeError) -> ExitCode {
        let reason = error.to_string();
        self.reply(&match error {
            ServeError::NameTaken { .. } => Message::Taken(reason),
            _ => Message::Failed(reason),
        });
        eprintln!("sarrus serve: {error}");
        ExitCode::from(2)
    }

    fn reply(&self, message: &Message) {
        if self.standby.is_some() {
            print_line(&message.to_string());
        }
    }
}

/// Whether the texts alone make the robot that is served.
fn is_whole(robot: &RecordedRobot, fingerprint: u64) -> bool {
    robot.load().is_ok_and(|loaded| loaded.compiled.model.fingerprint() == fingerprint)
}

/// Whoever started the server may have closed its end: serving goes on.
fn print_line(line: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}

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
