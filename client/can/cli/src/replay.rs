//! `sarrus-can replay`: the rules on a recorded input, without buses. The frames go to stdout as
//! `candump -L` writes them.

use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::log::{self, Line, What};

/// Flags of `replay`.
#[derive(Args)]
pub(crate) struct Replay {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// JSON lines `{"t": NS, "frame": "123#00", "bus": NAME}`, or with `"command": {…}`,
    /// `"operate": "arm"`, `"event": "bus_off"`, `"cycle": true`
    log: PathBuf,
}

impl Replay {
    /// 0; 1 for a faulty configuration or line, 2 for a file that cannot be opened.
    pub(crate) fn run(&self) -> Result<ExitCode, ExitCode> {
        let configuration = crate::configuration(&self.config)?;
        let log = std::fs::File::open(&self.log).map_err(|error| {
            eprintln!(
                "sarrus-can replay: cannot open {}: {error}; give the path of a readable file",
                self.log.display()
            );
            ExitCode::from(2)
        })?;
        let mut out = BufWriter::new(io::stdout().lock());
        let mut bridge = Bridge::new(configuration);
        let lines = BufReader::new(log).lines().enumerate();
        let result = lines.map(|(number, line)| (number, line.map_err(Fault::Read))).try_for_each(
            |(number, line)| {
                let line = line.and_then(|line| {
                    if line.trim().is_empty() { Ok(()) } else { step(&mut bridge, &line, &mut out) }
                });
                line.map_err(|fault| (number, fault))
            },
        );
        let flushed = out.flush();
        let written = match result {
            Ok(()) => flushed,
            Err((_, Fault::Output(error))) => Err(error),
            Err((number, Fault::Line(fault))) => {
                eprintln!("{}:{}:1: {fault}", self.log.display(), number + 1);
                return Err(ExitCode::from(1));
            }
            Err((_, Fault::Read(error))) => {
                eprintln!(
                    "sarrus-can replay: cannot read {}: {error}; give the path of a text file",
                    self.log.display()
                );
                return Err(ExitCode::from(2));
            }
        };
        match written {
            // a reader that has gone away wants no more
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                eprintln!("sarrus-can replay: stdout: {error}");
                Err(ExitCode::from(2))
            }
            _ => Ok(ExitCode::SUCCESS),
        }
    }
}

/// Why a replay ends early.
enum Fault {
    Line(String),
    Read(io::Error),
    Output(io::Error),
}

/// Applies one line; the frames of a cycle are written.
fn step(bridge: &mut Bridge, text: &str, out: &mut impl Write) -> Result<(), Fault> {
    let line = Line::read(text, bridge.configuration()).map_err(Fault::Line)?;
    let (faults, _) = bridge.faults();
    line.apply(bridge);
    if bridge.faults().0 != faults
        && let Some(fault) = log::fault(bridge)
    {
        eprintln!("sarrus-can replay: at {} ns {fault}", line.t);
    }
    if line.what == What::Cycle {
        log::sent(bridge, line.t)
            .try_for_each(|frame| writeln!(out, "{frame}"))
            .map_err(Fault::Output)?;
    }
    Ok(())
}
