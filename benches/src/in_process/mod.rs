//! Times in process: every case of every robot, errors first, then batches that take turns.

mod tables;

use std::path::PathBuf;
use std::time::Duration;

use sarrus_report::Outcome;
use sarrus_report::measure::machine::machine;
use sarrus_report::measure::progress::Progress;
use sarrus_report::measure::timing;
use sarrus_report::robots::{Robot, Subject};
use serde_json::json;

use crate::cases::{self, Case};
use crate::cores::Cores;
use crate::errors;
use crate::printed::Printed;
use crate::table::Format;

/// How much a run repeats.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// States whose error is measured.
    states: usize,
    /// How long the rounds through all cases go on.
    rounds: Duration,
}

impl Effort {
    /// At most a minute.
    const QUICK: Effort = Effort { states: 256, rounds: Duration::from_secs(15) };
    /// Some minutes.
    const FULL: Effort = Effort { states: 1024, rounds: Duration::from_secs(120) };
}

/// The cases to measure and the destination of the results.
#[derive(Clone, Debug)]
pub struct Options {
    /// Fewer repetitions.
    pub quick: bool,
    /// Only the cases whose name has this in it.
    pub only: String,
    /// How the tables are printed.
    pub format: Format,
    /// The file for every batch of every case.
    pub out: PathBuf,
    /// Print the names of the cases only.
    pub list: bool,
}

/// Measures, prints and keeps.
///
/// # Errors
///
/// A case that does not answer, a file that cannot be written.
pub fn run(options: &Options) -> Outcome {
    let effort = if options.quick { Effort::QUICK } else { Effort::FULL };
    let progress = Progress::silent();
    Cores::choose()?.pin_client();

    // the same states for every way to close a robot's loops
    let mut robots = Vec::new();
    let whats: Vec<Subject> = Subject::all().filter(|what| what.may_have(&options.only)).collect();
    for (k, what) in whats.iter().enumerate() {
        progress.show(what.name(), k as f64 / whats.len() as f64);
        match Robot::load(*what, what.states(if options.list { 0 } else { effort.states })) {
            Ok(robot) => robots.push(robot),
            Err(error) => eprintln!("not measured: {error}"),
        }
    }
    let mut cases = Vec::new();
    for robot in &robots {
        cases.extend(
            cases::of_robot(robot)?.into_iter().filter(|case| case.name().contains(&options.only)),
        );
    }
    if options.list {
        cases.iter().map(Case::name).for_each(|name| println!("{name}"));
        return Ok(());
    }

    // errors first: a case that does not answer is not timed
    let mut errors = Vec::new();
    let mut kept = Vec::new();
    let n_cases = cases.len();
    for (k, case) in cases.iter_mut().enumerate() {
        progress.show("errors", k as f64 / n_cases as f64);
        errors.push(errors::measure(case, &mut kept)?);
    }
    let samples =
        timing::interleaved(&mut cases, effort.rounds, |done| progress.show("in process", done))?;
    progress.clear();

    let rows = cases.iter().zip(&errors).zip(&samples);
    let value =
        |((case, errors), samples): ((&Case<'_>, _), _)| tables::value(case, errors, samples);
    let values: Vec<_> = rows.map(value).collect();
    let printed = Printed {
        package: "sarrus-benches",
        machine: machine()?,
        tables: tables::all(&robots, &cases, &errors, &samples),
        values: json!({ "in_process": values }),
        samples,
    };
    printed.finish(options.format, &options.out)
}
