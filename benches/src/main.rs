//! Measures times in process; see the library.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use sarrus_benches::{Options, PartialOptions, ScalingOptions, table::Format};

/// Times of sarrus beside their errors.
#[derive(Parser)]
struct Flags {
    /// Fewer repetitions: at most a minute instead of three.
    #[arg(long)]
    quick: bool,
    /// Only the cases whose name has this in it, such as `torso` or `warm/FD`.
    #[arg(long, value_name = "SUBSTRING", default_value = "")]
    only: String,
    /// How the tables are printed.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Where the raw data goes: every batch of every case, as JSON.
    #[arg(long, default_value = "target/benches/last.json")]
    out: PathBuf,
    /// Print the names of the cases and end.
    #[arg(long)]
    list: bool,
    /// Go this many times through 16 states of one case and end; for counting instructions.
    #[arg(long, num_args = 2, value_names = ["CASE", "REPEATS"])]
    count: Option<Vec<String>>,
    /// Many states at once beside one after the other, of the robots whose name has `--only` in
    /// it, and end.
    #[arg(long)]
    batches: bool,
    /// Forward dynamics by each method, predicted beside measured, and end.
    #[arg(long)]
    forward: bool,
    /// Searches and steps in task space, and end.
    #[arg(long)]
    tasks: bool,
    /// Work and time of partial questions as fractions of the whole, of the robots whose name has
    /// `--only` in it, and end.
    #[arg(long)]
    partial: bool,
    /// Digits against processor time of Andrews' squeezer, and end.
    #[arg(long)]
    published: bool,
    /// Cost against bodies, loops, joints of a loop, rows of a block and states of a batch, and
    /// end.
    #[arg(long)]
    scaling: bool,
    /// With `--scaling`: also instructions, under callgrind.
    #[arg(long, requires = "scaling")]
    instructions: bool,
}

fn main() -> ExitCode {
    let outcome = match Flags::parse() {
        Flags { count: Some(count), .. } => sarrus_benches::count(&count),
        Flags { batches: true, only, .. } => sarrus_benches::batches(&only),
        Flags { forward: true, .. } => sarrus_benches::forward(),
        Flags { tasks: true, .. } => sarrus_benches::tasks(),
        Flags { published: true, .. } => sarrus_benches::published(),
        Flags { partial: true, quick, only, format, out, .. } => {
            sarrus_benches::partial(&PartialOptions { quick, only, format, out })
        }
        Flags { scaling: true, quick, instructions, format, out, .. } => {
            sarrus_benches::scaling(&ScalingOptions { quick, instructions, format, out })
        }
        Flags { quick, only, format, out, list, .. } => {
            sarrus_benches::in_process(&Options { quick, only, format, out, list })
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sarrus-benches: {error}");
            ExitCode::FAILURE
        }
    }
}
