//! `sarrus serve`.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};
use sarrus_client::describe;
use sarrus_server::{ServeOptions, Wait, serve};
use signal_hook::consts::{SIGINT, SIGTERM};

use super::robot::{RobotFlags, refuse};

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
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGTERM, SIGINT] {
            if let Err(error) = signal_hook::flag::register(signal, stop.clone()) {
                eprintln!("sarrus serve: signal {signal} cannot be caught: {error}");
                return ExitCode::from(2);
            }
        }

        let loaded = match self.robot.load() {
            Ok(loaded) => loaded,
            Err(error) => return refuse("serve", &error),
        };
        let info = describe(&loaded);
        info.warnings.iter().for_each(|warning| eprintln!("sarrus serve: warning: {warning}"));
        let wait = match self.wait {
            None => Wait::auto(),
            Some(WaitFlag::Busy) => Wait::Busy,
            Some(WaitFlag::Sleep) => Wait::Sleep,
        };
        let options =
            ServeOptions { name: self.name, wait, lanes: self.lanes, ..ServeOptions::default() };
        let ready = || {
            // whoever started the server may have closed its end: serving goes on
            let mut out = std::io::stdout().lock();
            let _ = writeln!(out, "ready {} {:016x}", options.name, info.fingerprint)
                .and_then(|()| out.flush());
        };
        match serve(Arc::new(loaded.compiled.model), &info, &options, &stop, ready) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("sarrus serve: {error}");
                ExitCode::from(2)
            }
        }
    }
}
