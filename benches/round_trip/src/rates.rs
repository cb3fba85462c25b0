//! Requests at fixed rates (`--rates`), on an idle machine and beside busy loops.
//!
//! A request is due at a time that no answer moves. Its latency counts from then: requests that
//! become due while another one is late are late too, and none is omitted.

use std::hint::{black_box, spin_loop};
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use sarrus_benches::cores::{Cores, pin};
use sarrus_benches::table::{Table, ns};
use sarrus_client::{ConnectOptions, Robot as Client, Transport, WaitStrategy};
use sarrus_dynamics::{Plan, Status};
use sarrus_proto::Domain;
use sarrus_report::Outcome;
use sarrus_report::robots::{Question, Robot, packed};
use serde_json::{Value, json};

use crate::child::{Child, Role};
use crate::measure::ROBOT;
use crate::{floor, socket};

/// Requests per second.
const RATES: [u32; 3] = [250, 1000, 4000];
/// Before the first request is due.
const LEAD: Duration = Duration::from_millis(1);
/// So long before a request is due the client polls the clock instead of sleeping.
const AWAKE: Duration = Duration::from_micros(80);
/// Untimed requests before a run.
const WARM_UP: usize = 200;

/// A way there and back.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    Floor,
    Socket,
    Lane,
    Service,
    Grpc,
}

const WAYS: [(Way, &str); 5] = [
    (Way::Floor, "shared atomics (floor)"),
    (Way::Socket, "Unix socket"),
    (Way::Lane, "lane"),
    (Way::Service, "service"),
    (Way::Grpc, "gRPC, Unix socket"),
];

/// One line of the table.
struct Run {
    beside: &'static str,
    way: &'static str,
    rate: u32,
    times: Histogram<u64>,
}

/// Inverse dynamics: the packed inputs of some states, and the number of results.
pub(crate) struct Inputs {
    pub(crate) all: Vec<Vec<f64>>,
    pub(crate) n_out: usize,
}

impl Inputs {
    pub(crate) fn new(robot: &Robot) -> Outcome<Inputs> {
        let plan =
            Plan::new(&robot.variants[0].compiled.model, &Question::InverseDynamics.query())?;
        let all = robot.states.iter().map(|state| packed(&plan, state, 0)).collect();
        Ok(Inputs { all, n_out: plan.want().len() })
    }

    pub(crate) fn of(&self, k: usize) -> &[f64] {
        &self.all[k % self.all.len()]
    }
}

/// A client with inverse dynamics prepared.
pub(crate) struct Asking {
    client: Client,
    plan: sarrus_client::PlanId,
    output: Vec<f64>,
}

impl Asking {
    pub(crate) fn new(
        domain: &Domain,
        transport: Transport,
        wait_strategy: WaitStrategy,
        n_out: usize,
    ) -> Outcome<Asking> {
        // longer than a busy machine keeps a process waiting
        let timeout = Duration::from_secs(10);
        let options =
            ConnectOptions { transport, wait_strategy, timeout, ..ConnectOptions::default() };
        let mut client = Client::connect_in(domain.clone(), ROBOT, options)?;
        let plan = client.prepare(&Question::InverseDynamics.query())?;
        Ok(Asking { client, plan, output: vec![0.0; n_out] })
    }

    pub(crate) fn trip(&mut self, input: &[f64]) -> Outcome {
        match self.client.ask(self.plan, input, &mut self.output)?.status {
            Status::Ok => Ok(()),
            status => Err(format!("a request ends with {status}").into()),
        }
    }
}

/// Up to an hour, three digits.
pub(crate) fn histogram() -> Outcome<Histogram<u64>> {
    Ok(Histogram::new_with_bounds(1, 3_600_000_000_000, 3)?)
}

/// A request each period, its latency from the time at which it is due.
pub(crate) fn open_loop(
    first: Instant,
    period: Duration,
    count: usize,
    mut trip: impl FnMut(usize) -> Outcome,
) -> Outcome<Histogram<u64>> {
    let mut times = histogram()?;
    for k in 0..count {
        let due = first + period * k as u32;
        if let Some(rest) = due.checked_duration_since(Instant::now() + AWAKE) {
            thread::sleep(rest);
        }
        while Instant::now() < due {
            spin_loop();
        }
        trip(k)?;
        times.saturating_record(due.elapsed().as_nanos() as u64);
    }
    Ok(times)
}

/// A loop on the processor of the server and one on that of the client; they end when this is
/// dropped.
struct Busy {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Busy {
    fn start(cores: &Cores) -> Busy {
        let stop = Arc::new(AtomicBool::new(false));
        // a thread inherits the client's processor
        let places = [None, Some(cores.of_server()[0])];
        let begin = |place: Option<usize>| {
            let stop = stop.clone();
            thread::spawn(move || {
                place.into_iter().for_each(pin);
                let mut x = 1.0_f64;
                while !stop.load(Relaxed) {
                    x = black_box(x.sqrt() + 1.0);
                }
            })
        };
        let threads = places.map(begin).into();
        Busy { stop, threads }
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}

/// Measures every way at every rate, idle and loaded.
pub(crate) fn measure(
    robot: &Robot,
    cores: &Cores,
    domain: &Domain,
    time: Duration,
) -> Outcome<(Table, Value)> {
    let inputs = Inputs::new(robot)?;
    let mut runs = Vec::new();
    for beside in ["nothing", "busy loops"] {
        for (way, name) in WAYS {
            if way == Way::Grpc {
                let _busy = (beside != "nothing").then(|| Busy::start(cores));
                for (rate, times) in of_grpc(&inputs, cores, domain, time)? {
                    runs.push(Run { beside, way: name, rate, times });
                }
                continue;
            }
            let busy = || (beside != "nothing").then(|| Busy::start(cores));
            let mut at_rates = |trip: &mut dyn FnMut(usize) -> Outcome| {
                (0..WARM_UP).try_for_each(&mut *trip)?;
                let _busy = busy();
                for rate in RATES {
                    let count = (time.as_secs_f64() * f64::from(rate)) as usize;
                    let first = Instant::now() + LEAD;
                    let times = open_loop(first, Duration::from_secs(1) / rate, count, &mut *trip)?;
                    runs.push(Run { beside, way: name, rate, times });
                }
                Outcome::Ok(())
            };
            match way {
                Way::Floor => {
                    let mut near = floor::Near::start(domain, cores)?;
                    at_rates(&mut |k| near.trip(inputs.of(k), inputs.n_out))?;
                    near.stop()?;
                }
                Way::Socket => {
                    let mut near = socket::Near::start(domain, cores)?;
                    at_rates(&mut |k| near.trip(inputs.of(k), inputs.n_out))?;
                    near.stop()?;
                }
                Way::Lane | Way::Service | Way::Grpc => {
                    let server = Child::start(Role::Server, domain, cores, None)?;
                    let transport =
                        if way == Way::Lane { Transport::Lane } else { Transport::Service };
                    let mut asking =
                        Asking::new(domain, transport, WaitStrategy::Busy, inputs.n_out)?;
                    at_rates(&mut |k| asking.trip(inputs.of(k)))?;
                    drop(asking);
                    server.stop()?;
                }
            }
        }
    }
    Ok((table(&runs), runs.iter().map(Run::value).collect()))
}

/// The program of `benches/peers/` that measures gRPC.
fn grpc() -> PathBuf {
    let folder = std::env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    folder.join("peers/grpc")
}

/// Rates and times of gRPC; none where its program is not built.
fn of_grpc(
    inputs: &Inputs,
    cores: &Cores,
    domain: &Domain,
    time: Duration,
) -> Outcome<Vec<(u32, Histogram<u64>)>> {
    if !grpc().is_file() {
        return Ok(Vec::new());
    }
    let numbers = [inputs.of(0).len(), inputs.n_out, cores.of_server()[0]];
    let mut command = Command::new(grpc());
    command.arg(domain.root().join("grpc.sock"));
    command.args(numbers.map(|n| n.to_string())).arg(time.as_secs_f64().to_string());
    let output = command.args(RATES.map(|rate| rate.to_string())).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).trim().to_owned().into());
    }
    let mut all = Vec::new();
    for line in String::from_utf8(output.stdout)?.lines().skip(1) {
        let mut words = line.split(' ');
        let rate = words.next().ok_or("gRPC: a line without a rate")?.parse()?;
        let mut times = histogram()?;
        for word in words {
            times.saturating_record(word.parse()?);
        }
        all.push((rate, times));
    }
    Ok(all)
}

impl Run {
    fn value(&self) -> Value {
        let mut value = quantiles(&self.times);
        value["beside"] = json!(self.beside);
        value["way"] = json!(self.way);
        value["rate_hz"] = json!(self.rate);
        value
    }
}

/// The quantiles of a histogram as numbers.
pub(crate) fn quantiles(times: &Histogram<u64>) -> Value {
    let at = |quantile| times.value_at_quantile(quantile);
    json!({
        "count": times.len(),
        "p10_ns": at(0.1), "p50_ns": at(0.5), "p90_ns": at(0.9), "p99_ns": at(0.99),
        "p99_9_ns": at(0.999),
        "max_ns": times.max(),
    })
}

/// The quantiles of a histogram as cells: p10, p50, p99, p99.9.
pub(crate) fn cells(times: &Histogram<u64>) -> [String; 4] {
    let at = |quantile| ns(times.value_at_quantile(quantile) as f64);
    [0.1, 0.5, 0.99, 0.999].map(at)
}

fn table(runs: &[Run]) -> Table {
    let row = |run: &Run| {
        let words = [run.way.to_owned(), run.beside.to_owned(), run.rate.to_string()];
        words.into_iter().chain(cells(&run.times)).collect()
    };
    let is_run = runs.iter().any(|run| run.way.starts_with("gRPC"));
    let grpc = if is_run {
        "gRPC: its synchronous C++ client and server, which compute nothing;"
    } else {
        "gRPC: not run, benches/peers/build.sh grpc builds its program;"
    };
    let notes = [
        grpc,
        "ns from the time at which a request is due, also where the one before is late;",
        "floor and socket carry the bytes of inverse dynamics and compute nothing; server, floor \
        and their client poll, both ends of the socket wait in the kernel;",
        "busy loops: one on the processor of the server, one on that of the client",
    ];
    Table {
        title: "Inverse dynamics of the upper body at fixed rates".to_owned(),
        columns: vec!["way", "beside", "rate in Hz", "p10", "p50", "p99", "p99.9"],
        n_text: 2,
        rows: runs.iter().map(row).collect(),
        notes: notes.map(str::to_owned).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_that_become_due_during_a_stall_are_late_too() {
        let stall = Duration::from_millis(20);
        let period = Duration::from_millis(1);
        let trip = |k| {
            if k == 5 {
                thread::sleep(stall);
            }
            Ok(())
        };
        let times = open_loop(Instant::now() + LEAD, period, 40, trip).unwrap();
        assert_eq!(times.len(), 40);
        // those of the next 14 ms wait for 6 ms and more
        let late = times.iter_recorded().filter(|of| of.value_iterated_to() > 5_900_000);
        let late: u64 = late.map(|of| of.count_at_value()).sum();
        assert!(late >= 15, "{late}");
    }
}
