//! Both transports of a server process, beside the floor.
//!
//! Server and floor take turns, each alone with the client: on two processors a third process that
//! polls would be measured too.

use std::path::PathBuf;
use std::time::Instant;

use sarrus_benches::cores::Cores;
use sarrus_client::{
    ConnectOptions, PlanId, QueryOptions, Robot as Client, Transport, WaitStrategy,
};
use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_proto::Domain;
use sarrus_report::Outcome;
use sarrus_report::measure::progress::Progress;
use sarrus_report::measure::timing::Samples;
use sarrus_report::robots::Robot;
use sarrus_report::robots::{Question, packed};
use serde_json::{Value, json};

use crate::child::{Child, Role};
use crate::crowd::{Crowd, Numbers};
use crate::floor;

/// The robot that is served.
pub(crate) const ROBOT: &str = "rh5v2_upper_body";
/// States that the requests go through in turn.
pub(crate) const STATES: usize = 64;

/// How much a run repeats.
#[derive(Clone, Debug)]
pub(crate) struct Effort {
    /// Starts of the server, and of the floor beside it.
    segments: usize,
    /// Round trips of each kind in one segment.
    trips: usize,
    /// Where the server records.
    pub(crate) record: Option<PathBuf>,
    /// Who else is there.
    pub(crate) crowd: Numbers,
}

impl Effort {
    /// Few starts and trips, or many.
    pub(crate) fn new(quick: bool) -> Effort {
        let (segments, trips) = if quick { (6, 15_000) } else { (10, 100_000) };
        Effort { segments, trips, record: None, crowd: Numbers::default() }
    }
}

/// A request with its answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Payload {
    pub(crate) name: &'static str,
    query: fn() -> Query,
}

const PAYLOADS: [Payload; 3] = [
    Payload {
        name: "y_to_u",
        query: || {
            Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::U]))
        },
    },
    Payload { name: "ID", query: || Question::InverseDynamics.query() },
    Payload { name: "FD", query: || Question::ForwardDynamics.query() },
];

/// How it gets there and back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Route {
    Floor,
    Lane,
    /// The lane, with checksums.
    Checked,
    Requests,
}

impl Route {
    const ALL: [Route; 4] = [Route::Floor, Route::Lane, Route::Checked, Route::Requests];

    pub(crate) fn name(self) -> &'static str {
        ["floor", "lane", "checked", "requests"][self as usize]
    }
}

/// The names that `--only` sees.
pub(crate) fn names() -> impl Iterator<Item = String> {
    PAYLOADS.into_iter().flat_map(|payload| Route::ALL.map(|route| name(route, payload)))
}

fn name(route: Route, payload: Payload) -> String {
    format!("round_trip/{}/{}", route.name(), payload.name)
}

/// One row of the table.
pub(crate) struct Trip {
    pub(crate) payload: Payload,
    pub(crate) route: Route,
    pub(crate) n_in: usize,
    pub(crate) n_out: usize,
    pub(crate) samples: Samples,
    /// Median of the same plan in process; 0 for the floor.
    pub(crate) computation: f64,
    /// Median of the floor for the same bytes.
    floor: f64,
    /// The least and the largest median of one start of the processes: a virtual machine moves its
    /// processors now and then.
    pub(crate) starts: (f64, f64),
}

impl Trip {
    /// Time that the transport adds to shared memory and computation.
    pub(crate) fn over_floor(&self) -> f64 {
        self.samples.median() - self.computation - self.floor
    }

    pub(crate) fn value(&self) -> Value {
        let at = |quantile| self.samples.at(quantile);
        json!({
            "case": name(self.route, self.payload),
            "n_in": self.n_in,
            "n_out": self.n_out,
            "count": self.samples.count(),
            "p50_ns": at(0.5), "p90_ns": at(0.9), "p99_ns": at(0.99), "p99_9_ns": at(0.999),
            "computation_ns": self.computation,
            "floor_ns": self.floor,
            "medians_of_starts_ns": [self.starts.0, self.starts.1],
        })
    }
}

/// A plan, its inputs, its answers in process, and the times of every route so far.
struct Measured {
    payload: Payload,
    query: Query,
    inputs: Vec<Vec<f64>>,
    answers: Vec<Vec<f64>>,
    computation: Vec<f64>,
    ns: [Vec<f64>; 4],
    starts: [Vec<f64>; 4],
}

/// Measures all round trips whose name has `only` in it; nothing where server and client would
/// share a processor.
pub(crate) fn measure(
    robot: &Robot,
    cores: &Cores,
    effort: &Effort,
    only: &str,
    progress: &Progress,
) -> Outcome<Vec<Trip>> {
    if cores.is_one() {
        eprintln!("round trips not run: server and client poll, each needs a processor of its own");
        return Ok(Vec::new());
    }
    let mut measured = PAYLOADS
        .into_iter()
        .map(|payload| Measured::new(payload, robot))
        .collect::<Outcome<Vec<_>>>()?;
    let chosen = |route, measured: &Measured| {
        name(route, measured.payload).contains(only) || route == Route::Floor
    };
    let domain = Domain::at(
        &std::env::temp_dir().join(format!("sarrus-round-trip-{}", std::process::id())),
    )?;

    for segment in 0..effort.segments {
        progress.show("round trips", segment as f64 / effort.segments as f64);
        let mut floor = floor::Near::start(&domain, cores)?;
        for measured in &mut measured {
            let n_out = measured.answers[0].len();
            timed(measured, Route::Floor, effort.trips, |_, input| floor.trip(input, n_out))?;
        }
        floor.stop()?;

        let server = Child::start(Role::Server, &domain, cores, effort.record.as_deref())?;
        let dynamics = &measured[1];
        let state = &dynamics.inputs[0];
        let n_out = dynamics.answers[0].len();
        let crowd = Crowd::start(&domain, effort.crowd, &dynamics.query, state, n_out)?;
        let mut routes = [
            (Route::Lane, Transport::Lane, QueryOptions::NONE),
            (Route::Checked, Transport::Lane, QueryOptions::CHECKSUM),
            (Route::Requests, Transport::Service, QueryOptions::NONE),
        ];
        // neither of the first two is always the one that finds the caches as the other left them
        if segment % 2 == 1 {
            routes.swap(0, 1);
        }
        for (route, transport, asked) in routes {
            let options = ConnectOptions {
                transport,
                wait_strategy: WaitStrategy::Busy,
                ..ConnectOptions::default()
            };
            let mut client = Client::connect_in(domain.clone(), ROBOT, options)?;
            for measured in measured.iter_mut().filter(|measured| chosen(route, measured)) {
                let plan = client.prepare(&measured.query.with_options(asked))?;
                served(measured, route, effort.trips, &mut client, plan)?;
                measured.compute(robot)?;
            }
        }
        drop(crowd);
        server.stop()?;
    }
    domain.tidy();
    Ok(measured.iter().flat_map(Measured::trips).filter(|trip| trip.samples.count() > 0).collect())
}

/// Round trips through a transport; every answer's status is looked at, and the bits of a first
/// pass through the states.
fn served(
    measured: &mut Measured,
    route: Route,
    count: usize,
    client: &mut Client,
    plan: PlanId,
) -> Outcome {
    let mut output = vec![0.0; measured.answers[0].len()];
    for (input, answer) in measured.inputs.iter().zip(&measured.answers) {
        let _ = client.ask(plan, input, &mut output)?;
        if output.iter().zip(answer).any(|(a, b)| a.to_bits() != b.to_bits()) {
            return Err(format!(
                "{}: the answer has other bits than in process",
                name(route, measured.payload)
            )
            .into());
        }
    }
    timed(measured, route, count, |_, input| match client.ask(plan, input, &mut output)?.status {
        Status::Ok => Ok(()),
        status => Err(format!("a request ends with {status}").into()),
    })
}

/// Times `count` calls after a tenth of them untimed.
fn timed(
    measured: &mut Measured,
    route: Route,
    count: usize,
    mut trip: impl FnMut(usize, &[f64]) -> Outcome,
) -> Outcome {
    for k in 0..count / 10 {
        trip(k, &measured.inputs[k % STATES])?;
    }
    let ns = &mut measured.ns[route as usize];
    ns.reserve(count);
    for k in 0..count {
        let start = Instant::now();
        trip(k, &measured.inputs[k % STATES])?;
        ns.push(start.elapsed().as_nanos() as f64);
    }
    let median = Samples::new(ns[ns.len() - count..].to_vec()).median();
    measured.starts[route as usize].push(median);
    Ok(())
}

impl Measured {
    fn new(payload: Payload, robot: &Robot) -> Outcome<Measured> {
        let query = (payload.query)();
        let plan = Plan::new(&robot.variants[0].compiled.model, &query)?;
        let inputs =
            robot.states.iter().take(STATES).map(|state| packed(&plan, state, 0)).collect();
        let answers = vec![vec![0.0; plan.want().len()]; STATES];
        let mut measured = Measured {
            payload,
            query,
            inputs,
            answers,
            computation: Vec::new(),
            ns: Default::default(),
            starts: Default::default(),
        };
        measured.compute(robot)?;
        measured.computation.clear();
        Ok(measured)
    }

    /// Times the plan in process, in batches, and keeps its answers; done after each run of round
    /// trips, under the same conditions.
    fn compute(&mut self, robot: &Robot) -> Outcome {
        let model = &robot.variants[0].compiled.model;
        let plan = Plan::new(model, &self.query)?;
        let mut workspace = Workspace::new(model);
        for _ in 0..200 {
            let start = Instant::now();
            for (input, answer) in self.inputs.iter().zip(&mut self.answers) {
                let _ = std::hint::black_box(plan.run(
                    model,
                    &mut workspace,
                    std::hint::black_box(input),
                    answer,
                ));
            }
            self.computation.push(start.elapsed().as_nanos() as f64 / STATES as f64);
        }
        Ok(())
    }

    fn trips(&self) -> impl Iterator<Item = Trip> {
        let computation = Samples::new(self.computation.clone()).median();
        let floor = Samples::new(self.ns[Route::Floor as usize].clone()).median();
        Route::ALL.into_iter().map(move |route| Trip {
            payload: self.payload,
            route,
            n_in: self.inputs[0].len(),
            n_out: self.answers[0].len(),
            samples: Samples::new(self.ns[route as usize].clone()),
            computation: if route == Route::Floor { 0.0 } else { computation },
            floor,
            starts: {
                let medians = Samples::new(self.starts[route as usize].clone());
                (medians.at(0.0), medians.at(1.0))
            },
        })
    }
}
