//! `sarrus serve`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};
use sarrus_client::describe;
use sarrus_server::record::{RecordOptions, RecordedRobot};
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
        let record = match self.record.map(|file| (file, self.robot.recorded())) {
            None => None,
            Some((file, Ok(robot))) => {
                if !is_whole(&robot, info.fingerprint) {
                    eprintln!(
                        "sarrus serve: warning: the recording cannot hold this robot, whose files \
                         name further ones; replay it with --urdf"
                    );
                }
                Some(RecordOptions { file, seconds: self.record_seconds, robot })
            }
            Some((_, Err(error))) => return refuse("serve", &error),
        };
        let options = ServeOptions { name: self.name, wait, lanes: self.lanes, record };
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

/// Whether the texts alone make the robot that is served.
fn is_whole(robot: &RecordedRobot, fingerprint: u64) -> bool {
    robot.load().is_ok_and(|loaded| loaded.compiled.model.fingerprint() == fingerprint)
}
