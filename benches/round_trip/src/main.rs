//! Round trips through both transports of a server process, compared with plain shared memory that
//! carries the same bytes.
//!
//! ```text
//! cargo run --release -p sarrus-round-trip                    # some minutes
//! cargo run --release -p sarrus-round-trip -- --quick --only lane/FD
//! cargo run --release -p sarrus-round-trip -- --quick --only lane/ID --flooding 3
//! cargo run --release -p sarrus-round-trip -- --clients
//! cargo run --release -p sarrus-round-trip -- --rates
//! ```

mod child;
mod clients;
mod crowd;
mod floor;
mod measure;
mod rates;
mod socket;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use sarrus_benches::cores::Cores;
use sarrus_benches::printed::Printed;
use sarrus_benches::table::{Format, Table, ns};
use sarrus_proto::Domain;
use sarrus_report::Outcome;
use sarrus_report::measure::machine::machine;
use sarrus_report::measure::progress::Progress;
use sarrus_report::measure::timing::Samples;
use sarrus_report::robots::Robot;
use sarrus_report::robots::Subject;
use serde_json::json;

use crate::crowd::Numbers;
use crate::measure::{Effort, ROBOT, STATES, Trip};

/// The service needs it: see `sarrus_serve::pool`.
#[global_allocator]
static POOL: sarrus_serve::pool::Pool = sarrus_serve::pool::Pool;

/// Times of round trips between two processes.
#[derive(Parser)]
struct Flags {
    /// Fewer repetitions.
    #[arg(long)]
    quick: bool,
    /// Only the cases whose name has this in it, such as `lane`; the floor is always measured.
    #[arg(long, value_name = "SUBSTRING", default_value = "")]
    only: String,
    /// How the table is printed.
    #[arg(long, default_value = "text")]
    format: Format,
    /// Where the raw data goes: every round trip, as JSON.
    #[arg(long, default_value = "target/benches/round_trip.json")]
    out: PathBuf,
    /// Print the names of the cases and end.
    #[arg(long)]
    list: bool,
    /// The server records to this file, see `sarrus serve --record`.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Number of other clients with an idle lane.
    #[arg(long, value_name = "N", default_value_t = 0)]
    idle: usize,
    /// So many other clients always have a batch of 1024 states under way.
    #[arg(long, value_name = "N", default_value_t = 0)]
    flooding: usize,
    /// Latency against the number of clients, and end.
    #[arg(long)]
    clients: bool,
    /// Requests at fixed rates, on an idle machine and beside busy loops, and end.
    #[arg(long)]
    rates: bool,
    #[arg(long, hide = true)]
    child: Option<child::Role>,
    /// Processors of the child: it inherits the one that its parent is tied to.
    #[arg(long, hide = true, num_args = 2)]
    processors: Vec<usize>,
}

fn main() -> ExitCode {
    let outcome = match Flags::parse() {
        Flags { child: Some(role), processors, record, .. } => {
            child::child(role, &processors, record)
        }
        Flags { list: true, .. } => {
            measure::names().for_each(|name| println!("{name}"));
            Ok(())
        }
        flags => run(&flags),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sarrus-round-trip: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(flags: &Flags) -> Outcome {
    let mut effort = Effort::new(flags.quick);
    effort.record = flags.record.clone();
    effort.crowd = Numbers { idle: flags.idle, flooding: flags.flooding };
    let progress = Progress::silent();
    let cores = Cores::choose()?;
    cores.pin_client();
    let robot = Robot::load(Subject::Bundled(ROBOT), STATES)?;
    if flags.clients || flags.rates {
        return scaling(flags, &robot, &cores);
    }
    let trips = measure::measure(&robot, &cores, &effort, &flags.only, &progress)?;
    progress.clear();
    let tables = match trips.is_empty() {
        true => Vec::new(),
        false => vec![round_trips(&trips, &cores, effort.crowd)],
    };
    let printed = Printed {
        package: "sarrus-round-trip",
        machine: machine()?,
        tables,
        values: json!({ "round_trip": trips.iter().map(Trip::value).collect::<Vec<_>>() }),
        samples: trips.into_iter().map(|trip| trip.samples).collect(),
    };
    printed.finish(flags.format, &flags.out)
}

/// The table of `--clients`, of `--rates`, or both.
fn scaling(flags: &Flags, robot: &Robot, cores: &Cores) -> Outcome {
    if cores.is_one() {
        eprintln!("not run: server and client poll, each needs a processor of its own");
        return Ok(());
    }
    let name = format!("sarrus-round-trip-{}", std::process::id());
    let domain = Domain::at(&std::env::temp_dir().join(name))?;
    let time = Duration::from_secs(if flags.quick { 1 } else { 5 });
    let mut tables = Vec::new();
    let mut values = json!({});
    if flags.clients {
        let (table, value) = clients::measure(robot, cores, &domain, time)?;
        tables.push(table);
        values["clients"] = value;
    }
    if flags.rates {
        let (table, value) = rates::measure(robot, cores, &domain, time)?;
        tables.push(table);
        values["rates"] = value;
    }
    domain.tidy();
    let package = "sarrus-round-trip";
    let machine = machine()?;
    let printed = Printed { package, machine, tables, values, samples: Vec::new() };
    printed.finish(flags.format, &flags.out)
}

fn round_trips(trips: &[Trip], cores: &Cores, crowd: Numbers) -> Table {
    let row = |trip: &Trip| {
        let mut row = vec![
            trip.payload.name.to_owned(),
            format!("{} in, {} out", trip.n_in, trip.n_out),
            trip.route.name().to_owned(),
        ];
        row.extend([0.5, 0.9, 0.99, 0.999].map(|quantile| ns(trip.samples.at(quantile))));
        row.push(format!("{} to {}", ns(trip.starts.0), ns(trip.starts.1)));
        let served = trip.computation > 0.0;
        let optional = |x: f64| if served { ns(x) } else { "-".to_owned() };
        row.extend([
            optional(trip.computation),
            ns(trip.samples.median() - trip.computation),
            optional(trip.over_floor()),
        ]);
        row
    };
    let count = trips.iter().map(|trip| trip.samples.count()).min().unwrap_or(0);
    Table {
        title: "Round trip, upper body, server and client two processes that poll".to_owned(),
        columns: vec![
            "asked",
            "numbers",
            "way",
            "p50",
            "p90",
            "p99",
            "p99.9",
            "p50 of starts",
            "computation",
            "p50 without it",
            "over the floor",
        ],
        n_text: 3,
        rows: trips.iter().map(row).collect(),
        notes: vec![
            format!(
                "Besides {} clients with a lane that say nothing, and {} that always have a batch \
                under way.",
                crowd.idle, crowd.flooding
            ),
            "p50 of starts: the least and the largest p50 of one start of the processes; where \
            they differ much, the machine does."
                .to_owned(),
            format!(
                "ns; {count} round trips each in turns; the clock's own {} ns are included; \
                {cores}",
                ns(clock())
            ),
            "checked: the lane, with a checksum on every request and every answer.".to_owned(),
            "floor: the same bytes there and back through shared atomics, nothing computed; \
            computation: the same plan in process, median."
                .to_owned(),
        ],
    }
}

/// Time of reading the clock twice, in nanoseconds: a part of every round trip that is shown.
fn clock() -> f64 {
    let pair = |_| {
        let start = Instant::now();
        start.elapsed().as_nanos() as f64
    };
    Samples::new((0..10_001).map(pair).collect()).median()
}
