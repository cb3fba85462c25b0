//! `sarrus-can replay`: the rules on a recorded input, without buses. The frames go to stdout as
//! `candump -L` writes them; of `sarrus-can log` the measured numbers do, as CSV.

use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::Configuration;
use sarrus_can_core::log::{self, Line, What};
use sarrus_client::actuators::{ActuatorCommand, MechanismState, Reason};

/// Flags of `replay`.
#[derive(Args)]
pub(crate) struct Replay {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// JSON lines `{"t": NS, "frame": "123#00", "bus": NAME}`, or with `"command": {…}`,
    /// `"operate": "arm"`, `"event": "bus_off"`, `"cycle": true`
    log: PathBuf,
}

/// Flags of `log`.
#[derive(Args)]
pub(crate) struct Log {
    #[command(flatten)]
    input: Replay,
    /// Rows with commas between cells, the only form
    #[arg(long)]
    csv: bool,
}

impl Log {
    /// A head, then a row each cycle; codes as of [`Replay::run`].
    pub(crate) fn run(&self) -> Result<ExitCode, ExitCode> {
        let mut command = ActuatorCommand::default();
        let mut is_first = true;
        self.input.repeat("log", &mut |bridge, line, out| {
            if std::mem::take(&mut is_first) {
                writeln!(out, "{}", head(bridge.configuration()))?;
            }
            if let What::Command(given) = &line.what {
                command = **given;
            }
            if !line.apply(bridge) {
                return Ok(false);
            }
            if line.what == What::Cycle {
                writeln!(out, "{}", row(bridge, &command, line.t))?;
            }
            Ok(true)
        })
    }
}

/// Names of the columns.
fn head(configuration: &Configuration) -> String {
    const PARTS: &str = "position velocity effort commanded_position commanded_velocity \
                         commanded_effort state reason";
    let cell = |name: String| match name.contains([',', '"', '\n']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name,
    };
    let names = configuration.actuators.iter();
    let columns =
        names.flat_map(|name| PARTS.split(' ').map(move |part| cell(format!("{name}/{part}"))));
    std::iter::once("time".to_owned()).chain(columns).collect::<Vec<_>>().join(",")
}

/// Time of a cycle `[s]`, and of each actuator its measurement, its command and its mechanism; an
/// empty cell is no number.
fn row(bridge: &Bridge, command: &ActuatorCommand, t: u64) -> String {
    let state = bridge.state();
    let number = |x: f64| if x.is_finite() { format!("{x:?}") } else { String::new() };
    let mut cells = vec![format!("{}.{:09}", t / 1_000_000_000, t % 1_000_000_000)];
    for k in 0..bridge.configuration().actuators.len() {
        let of = [&state.position, &state.velocity, &state.effort];
        let asked = [&command.position, &command.velocity, &command.effort];
        cells.extend(of.into_iter().chain(asked).map(|list| number(list[k])));
        cells.push(MechanismState::name_of(state.states[k]).to_owned());
        cells.push(Reason::name_of(state.reasons[k]).to_owned());
    }
    cells.join(",")
}

impl Replay {
    /// 0; 1 for a faulty configuration or line, 2 for a file that cannot be opened.
    pub(crate) fn run(&self) -> Result<ExitCode, ExitCode> {
        self.repeat("replay", &mut step)
    }

    /// Does something with each line, which gives false for a state of another bridge.
    fn repeat(&self, command: &str, each: &mut Each<'_>) -> Result<ExitCode, ExitCode> {
        let configuration = crate::configuration(&self.config)?;
        let shown = self.log.display();
        let log = std::fs::File::open(&self.log).map_err(|error| {
            let help = "give the path of a readable file";
            crate::failed(command, format_args!("cannot open {shown}: {error}; {help}"))
        })?;
        let mut out = BufWriter::new(io::stdout().lock());
        let mut bridge = Bridge::new(configuration);
        let replayed = BufReader::new(log).lines().enumerate().try_for_each(|(number, line)| {
            let line = line.map_err(|error| {
                let fault = format!("cannot read {shown}: {error}; give the path of a text file");
                Fault::Input(2, format!("sarrus-can {command}: {fault}"))
            })?;
            if line.trim().is_empty() {
                return Ok(());
            }
            let line = Line::read(&line, bridge.configuration())
                .map_err(|fault| Fault::Input(1, format!("{shown}:{}:1: {fault}", number + 1)))?;
            match each(&mut bridge, &line, &mut out).map_err(Fault::Output)? {
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
                Err(crate::failed(command, format_args!("stdout: {error}")))
            }
            Err(Fault::Input(code, message)) => {
                eprintln!("{message}");
                Err(ExitCode::from(code))
            }
        }
    }
}

/// Applies a line to a bridge and writes; false where the bridge does not take it.
type Each<'a> = dyn FnMut(&mut Bridge, &Line, &mut dyn Write) -> io::Result<bool> + 'a;

/// Why a replay ends early.
enum Fault {
    /// The exit code and the message.
    Input(u8, String),
    Output(io::Error),
}

/// The fault of a line that a bridge does not take.
const OTHER: &str = "the state is of another configuration or version, expected those of the log";

/// Applies one line, or gives false; the frames of a cycle are written.
fn step(bridge: &mut Bridge, line: &Line, out: &mut dyn Write) -> io::Result<bool> {
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
