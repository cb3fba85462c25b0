//! Latency against the number of clients (`--clients`), each with a lane of its own.
//!
//! In turn: one thread asks with one client after the other, so only the server's work grows with
//! their number. At 250 Hz: each client is a thread on the client's processor that sleeps until its
//! request is due; the times at which requests are due are spread evenly.

use std::thread;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use sarrus_benches::cores::Cores;
use sarrus_benches::table::Table;
use sarrus_client::{Transport, WaitStrategy};
use sarrus_proto::Domain;
use sarrus_report::Outcome;
use sarrus_report::robots::Robot;
use serde_json::{Value, json};

use crate::child::{Child, Role};
use crate::rates::{Asking, Inputs, cells, histogram, open_loop, quantiles};

const NUMBERS: [u32; 5] = [1, 2, 4, 8, 16];
const PERIOD: Duration = Duration::from_millis(4);
/// For all threads to start.
const LEAD: Duration = Duration::from_millis(20);

/// One line of the table.
struct Run {
    clients: u32,
    in_turn: Histogram<u64>,
    at_rate: Histogram<u64>,
}

/// Measures each number of clients.
pub(crate) fn measure(
    robot: &Robot,
    cores: &Cores,
    domain: &Domain,
    time: Duration,
) -> Outcome<(Table, Value)> {
    let inputs = Inputs::new(robot)?;
    let mut runs = Vec::new();
    for clients in NUMBERS {
        let server = Child::start(Role::Server, domain, cores, None)?;
        let connect = |_| Asking::new(domain, Transport::Lane, WaitStrategy::Busy, inputs.n_out);
        let mut all = (0..clients).map(connect).collect::<Outcome<Vec<_>>>()?;
        let in_turn = in_turn(&mut all, &inputs, time)?;
        let at_rate = at_rate(&mut all, &inputs, time)?;
        runs.push(Run { clients, in_turn, at_rate });
        drop(all);
        server.stop()?;
    }
    Ok((table(&runs), runs.iter().map(Run::value).collect()))
}

fn in_turn(all: &mut [Asking], inputs: &Inputs, time: Duration) -> Outcome<Histogram<u64>> {
    let mut times = histogram()?;
    let begin = Instant::now();
    let mut k = 0;
    while begin.elapsed() < time {
        for asking in all.iter_mut() {
            let start = Instant::now();
            asking.trip(inputs.of(k))?;
            times.saturating_record(start.elapsed().as_nanos() as u64);
            k += 1;
        }
    }
    Ok(times)
}

fn at_rate(all: &mut [Asking], inputs: &Inputs, time: Duration) -> Outcome<Histogram<u64>> {
    let count = (time.as_nanos() / PERIOD.as_nanos()) as usize;
    let start = Instant::now() + LEAD;
    let between = PERIOD / all.len() as u32;
    thread::scope(|scope| {
        let begin = |(n, asking): (usize, &mut Asking)| {
            let first = start + between * n as u32;
            // an error of another thread is a text
            let trips = open_loop(first, PERIOD, count, |k| asking.trip(inputs.of(k)));
            trips.map_err(|error| error.to_string())
        };
        let threads: Vec<_> =
            all.iter_mut().enumerate().map(|one| scope.spawn(move || begin(one))).collect();
        let mut times = histogram()?;
        for thread in threads {
            times.add(thread.join().map_err(|_| "a client panics")??)?;
        }
        Ok(times)
    })
}

impl Run {
    fn value(&self) -> Value {
        json!({
            "clients": self.clients,
            "in_turn": quantiles(&self.in_turn),
            "at_250_hz": quantiles(&self.at_rate),
        })
    }
}

fn table(runs: &[Run]) -> Table {
    let row = |run: &Run| {
        let [in_turn, at_rate] = [&run.in_turn, &run.at_rate].map(|times| {
            let [p10, p50, p99, _] = cells(times);
            [p10, p50, p99]
        });
        [&[run.clients.to_string()][..], &in_turn, &at_rate].concat()
    };
    let notes = [
        "ns; in turn: one thread asks with one client after the other;",
        "at 250 Hz: each client a thread on one processor, from the time at which a request is due",
    ];
    Table {
        title: "Inverse dynamics of the upper body through lanes".to_owned(),
        columns: vec!["clients", "in turn p10", "p50", "p99", "at 250 Hz p10", "p50", "p99"],
        n_text: 0,
        rows: runs.iter().map(row).collect(),
        notes: notes.map(str::to_owned).into(),
    }
}
