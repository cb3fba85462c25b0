//! `sarrus-can run`: the bridge on the robot.
//!
//! One thread runs the rules at absolute deadlines; each bus has a thread of its own, which waits
//! for frames and sends what the rules hand over, so that a slow adapter holds nobody else up.
//! Threads share nothing but queues of fixed size: nothing locks.

mod bus;
mod fault_log;
mod realtime;
mod rules;

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use clap::Args;
use rustix::process::{Pid, Signal, getppid};
use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::bus_load;
use sarrus_can_core::config::Configuration;
use sarrus_can_core::fault_files::FaultFiles;
use sarrus_can_core::telemetry::Telemetry;
use sarrus_proto::bridge::BridgeEnd;
use sarrus_proto::lane::Threadsafe;
use sarrus_proto::{Domain, ServerName};
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGTERM, SIGTSTP, SIGUSR1, SIGUSR2,
    SIGVTALRM, SIGXCPU, SIGXFSZ,
};

use crate::bus::{Address, own};
use crate::stderr::{self, say};
use bus::BusThread;
pub(crate) use realtime::{lock_memory, permits_priority};
use rules::Rules;
use sarrus_client::now_ns;

/// Signals that would end or stop this program: each is a clean end of it.
const ENDS: [i32; 13] = [
    SIGINT,
    SIGTERM,
    SIGHUP,
    SIGQUIT,
    SIGTSTP,
    SIGUSR1,
    SIGUSR2,
    SIGALRM,
    SIGVTALRM,
    SIGPROF,
    SIGXCPU,
    SIGIO,
    Signal::POWER.as_raw(),
];

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
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u8).range(1..=98))]
    priority: u8,
    /// Folder for what led to each fault, which `replay` reads; without it `sarrus/faults` where
    /// programs keep their state
    #[arg(long, value_name = "FOLDER")]
    fault_log: Option<PathBuf>,
}

impl Run {
    /// Runs until a signal ends it: 0; 1 for a faulty configuration, 2 for what cannot be opened.
    pub(crate) fn run(self) -> ExitCode {
        let parent = if self.outlive_parent { None } else { getppid() };
        let configuration = match crate::configuration(&self.config) {
            Ok(configuration) => configuration,
            Err(code) => return code,
        };
        stderr::never_wait();
        configuration.warnings.iter().for_each(|warning| say(format_args!("warning: {warning}")));
        let code = match self.bridge(configuration, parent) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                say(format_args!("{error}"));
                ExitCode::from(2)
            }
        };
        stderr::finish();
        code
    }

    fn bridge(
        &self,
        configuration: Configuration,
        parent: Option<Pid>,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let stop = Arc::new(AtomicBool::new(false));
        for signal in ENDS {
            signal_hook::flag::register(signal, stop.clone())?;
        }
        // a log that may not grow any more: the write tells the same
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        let name = ServerName::new(&self.name)?;
        let domain = Domain::of_user()?;
        let node = domain.node::<Threadsafe>()?;
        let services = BridgeEnd::create(&node, &name)?;

        let (loads, fingerprint) = (bus_load::loads(&configuration), configuration.fingerprint);
        let usual = || FaultFiles::usual_folder(|name| std::env::var_os(name));
        let files = FaultFiles::new(self.fault_log.clone().unwrap_or_else(usual), name.as_str());
        let (log, keeper) = fault_log::fault_log(files, configuration.without_motors());
        let bridge = Bridge::new(configuration);
        let (mut threads, mut ends, mut owned) = (Vec::new(), Vec::new(), Vec::new());
        for (number, config) in bridge.configuration().buses.iter().enumerate() {
            owned.extend(own(Address::of(config))?);
            let (thread, end) = BusThread::new(config, bridge.shutdown_frames(number))?;
            threads.push(thread);
            ends.push(end);
        }
        let telemetry = Telemetry::new(&bridge, &loads, std::process::id(), now_ns())
            .ok_or("no memory for histograms")?;
        realtime::lock_memory().into_iter().for_each(|note| say(format_args!("{note}")));

        let result = thread::scope(|scope| {
            let buses: Vec<_> = threads
                .into_iter()
                .map(|thread| scope.spawn(|| thread.run(self.priority)))
                .collect();
            scope.spawn(move || keeper.run());
            let mut rules = Rules { bridge, telemetry, services, ends, log, stop: &stop };
            // however this thread ends, also by a panic, its queues end with it, and each bus says
            // its shutdown frames
            let rules = scope.spawn(move || {
                realtime::be_first(self.priority);
                rules.run();
            });
            announce(&self.name, fingerprint);
            while !rules.is_finished() {
                // a bus only ends before the rules by breaking down
                let is_orphan = parent.is_some() && getppid() != parent;
                if is_orphan || buses.iter().any(|bus| bus.is_finished()) {
                    stop.store(true, Ordering::Relaxed);
                }
                thread::sleep(Duration::from_millis(20));
            }
            let result = rules.join();
            let mut faults = Vec::new();
            for bus in buses {
                if bus.join().is_err() {
                    faults.push("the thread of a bus broke down");
                }
            }
            if result.is_err() {
                faults.push("the thread of the rules broke down; the motors were disabled");
            }
            faults
        });
        drop((owned, node));
        domain.tidy();
        if result.is_empty() { Ok(()) } else { Err(result.join("; ").into()) }
    }
}

/// Whoever started the bridge may have closed its end: it goes on.
fn announce(name: &str, fingerprint: u64) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "ready {name} {fingerprint:016x}").and_then(|()| out.flush());
}
