//! `sarrus-can run`: the bridge on the robot.

use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use clap::Args;
use rustix::process::{Pid, getppid};
use sarrus_can_core::config::{BusConfig, Configuration};
use sarrus_can_run::bus::{Address, Bus, Reconnecting, own};
use sarrus_can_run::stderr::{self, say};
use sarrus_can_run::{Settings, prepare};
use signal_hook::consts::{
    SIGBUS, SIGCHLD, SIGCONT, SIGFPE, SIGILL, SIGINT, SIGKILL, SIGPIPE, SIGSEGV, SIGSTOP, SIGTERM,
    SIGTTIN, SIGTTOU, SIGURG, SIGWINCH, SIGXFSZ,
};

/// Signals that are no clean end: some say nothing of an end, others cannot be caught or are faults
/// of this program.
const OTHERS: [i32; 14] = [
    SIGBUS, SIGCHLD, SIGCONT, SIGFPE, SIGILL, SIGKILL, SIGPIPE, SIGSEGV, SIGSTOP, SIGTTIN, SIGTTOU,
    SIGURG, SIGWINCH, SIGXFSZ,
];

/// Usual priority of the threads under SCHED_FIFO.
pub(crate) const PRIORITY: u8 = 60;

type Error = Box<dyn std::error::Error>;

/// Flags of `run`.
#[derive(Args)]
pub(crate) struct Run {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// Name under which controllers find the bridge
    #[arg(long, default_value = "default")]
    name: String,
    /// Go on when the process that started this one ends; without it the motors are disabled then
    #[arg(long)]
    outlive_parent: bool,
    /// Priority of the threads under SCHED_FIFO, where that is permitted
    #[arg(long, default_value_t = PRIORITY, value_parser = clap::value_parser!(u8).range(1..=98))]
    priority: u8,
    /// Folder for the log of each fault, which `replay` reads; without it `sarrus/faults` where
    /// programs keep their state
    #[arg(long, value_name = "FOLDER")]
    fault_log: Option<PathBuf>,
    /// Log all inputs of the bridge, as JSON lines for `replay`
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

impl Run {
    /// Runs until a signal ends it: 0; 1 for a faulty configuration, 2 for failures at start-up.
    pub(crate) fn run(self) -> Result<ExitCode, ExitCode> {
        let parent = if self.outlive_parent { None } else { getppid() };
        let configuration = crate::configuration(&self.config)?;
        stderr::never_wait("sarrus-can");
        configuration.warnings.iter().for_each(|warning| say(format_args!("warning: {warning}")));
        let code = match self.bridge(configuration, parent) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                say(format_args!("{error}"));
                ExitCode::from(2)
            }
        };
        stderr::finish();
        Ok(code)
    }

    fn bridge(&self, configuration: Configuration, parent: Option<Pid>) -> Result<(), Error> {
        let stop = Arc::new(AtomicBool::new(false));
        end_by_signals(&stop)?;
        let settings = Settings {
            name: self.name.clone(),
            priority: Some(self.priority),
            fault_log: self.fault_log.clone(),
            log: self.log.clone(),
        };
        let mut owned = Vec::new();
        let prepared = prepare(configuration, settings, stop.clone(), |bus| open(bus, &mut owned))?;
        let fingerprint = prepared.fingerprint();
        let running = prepared.start()?;
        // a closed stdout changes nothing
        let _ = crate::tell(format_args!("ready {} {fingerprint:016x}", self.name));
        while !running.is_over() {
            if parent.is_some() && getppid() != parent {
                stop.store(true, Ordering::Relaxed);
            }
            thread::sleep(Duration::from_millis(20));
        }
        running.end().map(drop)
    }
}

/// Opens a bus; the lock that keeps others off it joins `owned`.
pub(crate) fn open(bus: &BusConfig, owned: &mut Vec<OwnedFd>) -> Result<Box<dyn Bus>, Error> {
    let address = Address::of(bus);
    owned.extend(own(&address)?);
    Ok(Box::new(Reconnecting::open(&bus.name, address)?))
}

/// A flag that SIGINT and SIGTERM set.
pub(crate) fn until_asked() -> Result<Arc<AtomicBool>, String> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        let registered = signal_hook::flag::register(signal, stop.clone());
        registered.map_err(|error| format!("signals: {error}"))?;
    }
    Ok(stop)
}

/// Sets a flag at every signal that would end or stop this program.
pub(crate) fn end_by_signals(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    // 32 and 33 belong to the system's library
    for signal in (1..32).chain(34..65).filter(|signal| !OTHERS.contains(signal)) {
        signal_hook::flag::register(signal, stop.clone())?;
    }
    // a log beyond the limit of a file's size: the write reports it
    signal_hook::flag::register(SIGXFSZ, Arc::default())?;
    Ok(())
}
