//! Every number that is published: time beside error, of one run, on the same models and states.
//!
//! ```text
//! cargo run --release -p sarrus-benches                       # everything, up to 5 minutes
//! cargo run --release -p sarrus-benches -- --quick            # the same with fewer repetitions, up to 1 minute
//! cargo run --release -p sarrus-benches -- --only upper_body/analytic --format markdown
//! cargo run --release -p sarrus-benches -- --list             # the names of the cases
//! cargo run --release -p sarrus-benches -- --forward          # forward dynamics by each method, beside what the cost model predicts
//! benches/count.sh --check                                    # instructions per call against benches/instructions.tsv
//! ```
//!
//! - In process (`cases.rs`, `states.rs`, `timing.rs`, `error.rs`): nanoseconds per call of [`sarrus_dynamics::Plan::run`], in short
//!   batches that take turns through all cases, so that ratios hold on a machine that others use too; each time beside the error of the
//!   same answers against double-double.
//! - Round trip (`round_trip/`): both doors of a server process, between two runs of plain shared memory that carries the same bytes.
//!
//! - Cases are named `robot/closures[/start]/asked`: `FD` goes by the method that the model chooses, `FD-recursion`, `FD-projection` and
//!   `FD-kkt` by that one; `chain/N/FD` is a row of N lambdas, whose instructions per lambda must not grow with N.
//!
//! To add a bundled robot or a way to close its loops: one line in `cases.rs`. A small robot as text: `extra.rs`. A case of the regression
//! gate: one line in `count.sh`, then `benches/count.sh --update`.

mod cases;
mod chain;
mod count;
mod error;
mod extra;
mod forward;
mod progress;
mod report;
mod round_trip;
mod states;
mod table;
mod timing;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};

use crate::progress::Progress;
use crate::report::Report;

/// The requests door needs it: see `sarrus_server::pool`. Nothing else here notices.
#[global_allocator]
static POOL: sarrus_server::pool::Pool = sarrus_server::pool::Pool;

/// A benchmark that fails stops and says why.
type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// Times of sarrus beside their errors.
#[derive(Parser)]
struct Flags {
    /// Fewer repetitions: at most a minute instead of five.
    #[arg(long)]
    quick: bool,
    /// Only the cases whose name has this in it, such as `torso`, `warm/FD`, `round_trip/lane`.
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
    /// Forward dynamics by each method, predicted beside measured, and end.
    #[arg(long)]
    forward: bool,
    #[arg(long, hide = true)]
    child: Option<round_trip::Role>,
    /// Processors of the child: it inherits the one that its parent is tied to.
    #[arg(long, hide = true, num_args = 2)]
    processors: Vec<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Markdown,
    Json,
}

fn main() -> ExitCode {
    let outcome = match Flags::parse() {
        Flags { child: Some(role), processors, .. } => round_trip::child(role, &processors),
        Flags { count: Some(count), .. } => count::run(&count),
        Flags { forward: true, .. } => forward::run(),
        flags => run(&flags),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sarrus-benches: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(flags: &Flags) -> Outcome {
    let effort = if flags.quick { timing::Effort::QUICK } else { timing::Effort::FULL };
    let progress = Progress::new();
    let cores = round_trip::Cores::choose()?;
    cores.pin_client();

    // the same states for every way to close a robot's loops
    let mut robots = Vec::new();
    let whats: Vec<cases::What> = cases::What::all().filter(|what| what.may_have(&flags.only)).collect();
    for (k, what) in whats.iter().enumerate() {
        progress.show(what.name(), k as f64 / whats.len() as f64);
        match states::Robot::load(*what, what.states(if flags.list { 0 } else { effort.states })) {
            Ok(robot) => robots.push(robot),
            Err(error) => eprintln!("not measured: {error}"),
        }
    }
    let mut cases = Vec::new();
    for robot in &robots {
        cases.extend(cases::of_robot(robot)?.into_iter().filter(|case| case.name().contains(&flags.only)));
    }
    let trips = round_trip::names().filter(|name| name.contains(&flags.only)).count() > 0;
    if flags.list {
        cases.iter().map(cases::Case::name).chain(round_trip::names()).for_each(|name| println!("{name}"));
        return Ok(());
    }

    // errors first: a case that does not answer is not timed
    let (mut errors, mut kept) = (Vec::new(), Vec::new());
    let n_cases = cases.len();
    for (k, case) in cases.iter_mut().enumerate() {
        progress.show("errors", k as f64 / n_cases as f64);
        errors.push(error::measure(case, &mut kept)?);
    }
    let samples = timing::interleaved(&mut cases, &effort, &progress)?;
    let trips = if trips { round_trip::measure(&robots, &cores, &effort, &flags.only, &progress)? } else { Vec::new() };
    progress.clear();

    let report = Report::new(&robots, &cases, &errors, &samples, &trips, &cores);
    report.save(&flags.out)?;
    match flags.format {
        Format::Text => print!("{}", report.text()),
        Format::Markdown => print!("{}", report.markdown()),
        Format::Json => println!("{:#}", report.summary()),
    }
    eprintln!("raw data: {}", flags.out.display());
    Ok(())
}
