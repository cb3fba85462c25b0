//! Fuzzing by hand: any number of inputs, any seed, one target.
//!
//! ```sh
//! cargo run --release -p sarrus-fuzz -- urdf --inputs 10000000 --seed 7
//! cargo run --release -p sarrus-fuzz -- urdf --replay target/fuzz/urdf-0123456789abcdef
//! ```

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use clap::builder::PossibleValuesParser;
use sarrus_fuzz::{Limits, TARGETS, Target, hash, replay, run};

/// Damaged and hostile inputs for every reader of sarrus.
///
/// Exits with 0 when every input kept the laws, with 1 when one did not (a reduced input is written
/// to a file, and the command that replays it is printed), and with 2 when the target cannot start.
#[derive(Parser)]
#[command(name = "sarrus-fuzz")]
struct Arguments {
    /// Reader to test.
    #[arg(value_parser = PossibleValuesParser::new(TARGETS.iter().map(|target| target.name)))]
    target: String,
    /// Number of inputs.
    #[arg(long, default_value_t = 1_000_000)]
    inputs: u64,
    /// Longest duration `[min]`.
    #[arg(long)]
    minutes: Option<f64>,
    /// Seed of the random changes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Try only this input.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["inputs", "minutes", "seed"])]
    replay: Option<PathBuf>,
    /// Keep the slowest input when it takes more processor time than this `[ms]`.
    #[arg(long, value_name = "MS", default_value_t = 200)]
    slow: u64,
    /// Folder for kept inputs.
    #[arg(long, default_value = "target/fuzz")]
    folder: PathBuf,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let Some(target) = TARGETS.iter().find(|target| target.name == arguments.target) else {
        return ExitCode::from(2);
    };
    let outcome = match &arguments.replay {
        Some(file) => replay_file(target, file),
        None => search(target, &arguments),
    };
    outcome.unwrap_or_else(|words| {
        eprintln!("sarrus-fuzz: {words}");
        ExitCode::from(2)
    })
}

fn replay_file(target: &Target, file: &Path) -> Result<ExitCode, String> {
    let input = std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
    match replay(target, &input) {
        Ok(()) => println!("{}: every law holds", target.name),
        Err(words) => {
            println!("{}: {words}", target.name);
            return Ok(ExitCode::from(1));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn search(target: &Target, arguments: &Arguments) -> Result<ExitCode, String> {
    let limits = Limits {
        seed: arguments.seed,
        inputs: arguments.inputs,
        time: arguments.minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes.max(0.0))),
    };
    println!("{}: seed {}", target.name, limits.seed);

    // one line, overwritten, on a terminal; one line every ten seconds elsewhere
    let is_terminal = std::io::stderr().is_terminal();
    let (pause, end) = if is_terminal { (0.2, "\r") } else { (10.0, "\n") };
    let mut next = pause;
    let outcome = run(target, limits, &mut |progress| {
        let seconds = progress.elapsed.as_secs_f64();
        if seconds >= next {
            next = seconds + pause;
            let rate = progress.inputs as f64 / seconds;
            let inputs = progress.inputs;
            let kinds = progress.kinds;
            eprint!("{inputs} inputs, {rate:.0} a second, {kinds} kinds of outcomes{end}");
            let _ = std::io::stderr().flush();
        }
    })?;

    println!("{} inputs, {} kinds of outcomes", outcome.inputs, outcome.kinds);
    let (time, slowest) = &outcome.slowest;
    println!("slowest input: {:.1} ms of processor time", 1e3 * time.as_secs_f64());
    if time.as_millis() as u64 > arguments.slow {
        keep(target, slowest, &arguments.folder)?;
    }
    let Some(failure) = outcome.failure else { return Ok(ExitCode::SUCCESS) };
    println!("FAILED: {}", failure.words);
    keep(target, &failure.input, &arguments.folder)?;
    Ok(ExitCode::from(1))
}

/// Writes an input to a file and prints the command that replays it.
fn keep(target: &Target, input: &[u8], folder: &Path) -> Result<(), String> {
    let file = folder.join(format!("{}-{:016x}", target.name, hash(input)));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&file, input))
        .map_err(|error| format!("{}: {error}", file.display()))?;
    let name = target.name;
    let file = file.display();
    println!("cargo run --release -p sarrus-fuzz -- {name} --replay {file}");
    Ok(())
}
