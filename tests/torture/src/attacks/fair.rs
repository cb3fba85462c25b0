//! Clients of the costliest states beside one of 1 kHz, compared with clients of good states.

use std::cmp::Reverse;
use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::Args;
use fastrand::Rng;
use sarrus_client::{
    Answer, ConnectOptions, Field, Options, Query, Request, Robot, Source, Status, Warnings,
};
use sarrus_proto::Domain;

use crate::Settings;
use crate::patience::LIMIT;
use crate::report::{Clock, Report, Verdict, percentiles};
use crate::sandbox::{NAME, Sandbox, words};

/// Robots whose loops Newton's method closes, and the largest one.
const ROBOTS: [&str; 3] = ["delta", "active_ankle", "rh5v2_full"];
/// Random states, of which the good ones and the costliest are asked.
const STATES: usize = 2000;
/// States of each kind.
const CHOSEN: usize = 64;
/// Rows of a batch.
const ROWS: usize = 1024;
/// The honest client's pause between two requests.
const PAUSE: Duration = Duration::from_millis(1);
/// The honest client may wait this many times longer beside bad states than beside good ones.
const RATIO: f64 = 2.0;

#[derive(Args, Clone)]
pub(crate) struct Fair {
    /// Clients beside the honest one.
    #[arg(long, default_value_t = 12)]
    clients: usize,
}

impl Default for Fair {
    fn default() -> Fair {
        Fair { clients: 12 }
    }
}

impl Fair {
    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        let mut report = Report::new(settings);
        let robots = match &settings.robot {
            Some(robot) => vec![robot.as_str()],
            None => ROBOTS.to_vec(),
        };
        let seconds = settings.seconds / (4 * robots.len()) as f64;
        for robot in robots {
            let (query, [good, bad]) = states(robot, settings.seed)?;
            for rows in [1, ROWS] {
                let mut beside = |states: &[Vec<f64>]| -> Result<[Duration; 3], String> {
                    let sandbox = Sandbox::new(settings)?;
                    // one process has all but an eighth of them
                    let lanes = ((self.clients + 2).div_ceil(7) * 8).to_string();
                    let mut server = sandbox.serve(robot, &["--lanes", &lanes])?;
                    let domain = sandbox.domain();
                    let times = self.beside(domain, &query, &good, states, rows, seconds);
                    if let Some(status) = server.ended() {
                        report.fault(format!("the server ended with {status}"));
                    }
                    server.stop()?;
                    times
                };
                let [easy, hard] = [beside(&good)?, beside(&bad)?];
                let ratio = hard[1].as_secs_f64() / easy[1].as_secs_f64().max(1e-9);
                let line = format!(
                    "{robot}, {} clients of {rows} rows: p50, p95, worst {easy:.1?} beside good \
                     states, {hard:.1?} beside the costliest, p95 {ratio:.2} times as long",
                    self.clients
                );
                if settings.strict {
                    report.require(ratio <= RATIO, || line.clone());
                }
                report.count(line);
            }
        }
        Ok(Verdict::Done(report))
    }

    /// The times of an honest client of good states, p50, p95 and the longest, beside clients of
    /// others.
    fn beside(
        &self,
        domain: &Domain,
        query: &Query,
        good: &[Vec<f64>],
        others: &[Vec<f64>],
        rows: usize,
        seconds: f64,
    ) -> Result<[Duration; 3], String> {
        let stop = AtomicBool::new(false);
        let done = AtomicU64::new(0);
        std::thread::scope(|scope| {
            let clients: Vec<_> = (0..self.clients)
                .map(|number| {
                    let (stop, done) = (&stop, &done);
                    scope.spawn(move || {
                        let asked = ask_until(domain, query, others, number, rows, stop, done);
                        // the honest client does not wait for one that failed
                        stop.fetch_or(asked.is_err(), Relaxed);
                        asked
                    })
                })
                .collect();
            let times = honest(domain, query, good, seconds, &stop, &done);
            stop.store(true, Relaxed);
            for client in clients {
                client.join().map_err(|_| "a client ended")??;
            }
            Ok(percentiles(&mut times?, [50, 95, 100]))
        })
    }
}

/// Asks good states at 1 kHz once every other client has an answer; the times of the answers.
fn honest(
    domain: &Domain,
    query: &Query,
    good: &[Vec<f64>],
    seconds: f64,
    stop: &AtomicBool,
    done: &AtomicU64,
) -> Result<Vec<Duration>, String> {
    let mut robot = connect(domain)?;
    let plan = robot.prepare(query).map_err(words)?;
    let mut output = vec![0.0; robot.plan(plan).map_or(0, |plan| plan.want().len())];
    let start = Instant::now();
    while done.load(Relaxed) == 0 && start.elapsed() < LIMIT && !stop.load(Relaxed) {
        std::thread::sleep(PAUSE);
    }
    let mut times = Vec::new();
    let mut clock = Clock::new("fair", seconds);
    for state in good.iter().cycle() {
        if stop.load(Relaxed) || !clock.runs(|| format!("{} answers", times.len())) {
            break;
        }
        let start = Instant::now();
        let answer = robot.ask(plan, state, &mut output).map_err(words)?;
        times.push(start.elapsed());
        if answer.status != Status::Ok {
            return Err(format!("a good state is {}", answer.status));
        }
        std::thread::sleep(PAUSE);
    }
    match times.is_empty() {
        true => Err("the honest client had no answer".to_owned()),
        false => Ok(times),
    }
}

/// Asks states one after another, alone or in batches, until `stop`.
fn ask_until(
    domain: &Domain,
    query: &Query,
    states: &[Vec<f64>],
    number: usize,
    rows: usize,
    stop: &AtomicBool,
    done: &AtomicU64,
) -> Result<(), String> {
    let mut robot = connect(domain)?;
    let plan = robot.prepare(query).map_err(words)?;
    let n_out = robot.plan(plan).map_or(0, |plan| plan.want().len());
    let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
    let mut answers = vec![unknown; rows];
    let mut output = vec![0.0; rows * n_out];
    let mut states = states.iter().cycle().skip(number);
    while !stop.load(Relaxed) {
        let input: Vec<f64> = states.by_ref().take(rows).flatten().copied().collect();
        if rows == 1 {
            let _ = robot.ask(plan, &input, &mut output).map_err(words)?;
        } else {
            let threads = NonZero::<usize>::MIN;
            robot.batch(plan, threads, &input, &mut output, &mut answers).map_err(words)?;
        }
        done.fetch_add(1, Relaxed);
    }
    Ok(())
}

fn connect(domain: &Domain) -> Result<Robot, String> {
    let options = ConnectOptions { timeout: LIMIT, ..ConnectOptions::default() };
    Robot::connect_in(domain.clone(), NAME, options).map_err(words)
}

/// Random states of a robot: good ones, and those whose answers take longest.
fn states(robot: &str, seed: u64) -> Result<(Query, [Vec<Vec<f64>>; 2]), String> {
    let source = Source::Bundled(robot.to_owned());
    let mut robot = Robot::load(&source, &Options::default()).map_err(words)?;
    let query = Query::new(Request::Kinematics, Field::Y.into(), Field::Q.into());
    let plan = robot.prepare(&query).map_err(words)?;
    let sizes = robot.model().sizes;
    let mut output = vec![0.0; sizes.n_q];
    let mut random = Rng::with_seed(seed);
    let mut good = Vec::new();
    let mut all = Vec::new();
    for k in 0..STATES {
        let scale = [0.2, 1.0, 3.0][k % 3];
        let y: Vec<f64> = (0..sizes.n_qy).map(|_| scale * (2.0 * random.f64() - 1.0)).collect();
        let start = Instant::now();
        let answer = robot.ask(plan, &y, &mut output).map_err(words)?;
        all.push((start.elapsed(), y.clone()));
        if answer.status == Status::Ok {
            good.push(y);
        }
    }
    good.truncate(CHOSEN);
    all.sort_by_key(|(took, _)| Reverse(*took));
    all.truncate(CHOSEN);
    match good.is_empty() {
        true => Err("no random state is good".to_owned()),
        false => Ok((query, [good, all.into_iter().map(|(_, y)| y).collect()])),
    }
}
