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
        let shown = self.log.display();
        let log = std::fs::File::open(&self.log).map_err(|error| {
            eprintln!(
                "sarrus-can replay: cannot open {shown}: {error}; give the path of a readable file"
            );
            ExitCode::from(2)
        })?;
        let mut out = BufWriter::new(io::stdout().lock());
        let mut bridge = Bridge::new(configuration);
        let replayed = BufReader::new(log).lines().enumerate().try_for_each(|(number, line)| {
            let line = line.map_err(|error| {
                let fault = format!("cannot read {shown}: {error}; give the path of a text file");
                Fault::Input(2, format!("sarrus-can replay: {fault}"))
            })?;
            if line.trim().is_empty() {
                return Ok(());
            }
            let line = Line::read(&line, bridge.configuration())
                .map_err(|fault| Fault::Input(1, format!("{shown}:{}:1: {fault}", number + 1)))?;
            match step(&mut bridge, &line, &mut out).map_err(Fault::Output)? {
                true => Ok(()),
                false => Err(Fault::Input(1, format!("{shown}:{}:1: {OTHER}", number + 1))),
            }
        });
        let flushed = out.flush().map_err(Fault::Output);
        match replayed.and(flushed) {
            Ok(()) => Ok(ExitCode::SUCCESS),
            // a reader that has gone away wants no more
            Err(Fault::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => {
                Ok(ExitCode::SUCCESS)
            }
            Err(Fault::Output(error)) => {
                eprintln!("sarrus-can replay: stdout: {error}");
                Err(ExitCode::from(2))
            }
            Err(Fault::Input(code, message)) => {
                eprintln!("{message}");
                Err(ExitCode::from(code))
            }
        }
    }
}

/// Why a replay ends early.
enum Fault {
    /// The exit code and the message.
    Input(u8, String),
    Output(io::Error),
}

/// The fault of a line that a bridge does not take.
const OTHER: &str = "the state is of another configuration or version, expected those of the log";

/// Applies one line, or gives false; the frames of a cycle are written.
fn step(bridge: &mut Bridge, line: &Line, out: &mut impl Write) -> io::Result<bool> {
    let (faults, _) = bridge.faults();
    if !line.apply(bridge) {
        return Ok(false);
    }
    if bridge.faults().0 != faults
        && let Some(fault) = log::fault(bridge)
    {
        eprintln!("sarrus-can replay: at {} ns {fault}", line.t);
    }
    if line.what == What::Cycle {
        log::sent(bridge, line.t).try_for_each(|frame| writeln!(out, "{frame}"))?;
    }
    Ok(true)
}
