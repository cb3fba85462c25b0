//! Many states at once beside one state after the other (`--batches`).
//!
//! Every robot as it is given: nanoseconds and lanes of [`Batch`] on one thread and on two, in
//! batches that take turns with [`sarrus_dynamics::Plan::run`] on the same states.

use std::hint::black_box;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use sarrus_dynamics::{Answer, Batch, Model, Plan, Status, Warnings, Workspace};
use sarrus_report::Outcome;
use sarrus_report::measure::timing::Timed;
use sarrus_report::robots::{Question, Robot, Subject, packed};

use crate::table::{Table, ns};

/// States of a call, and of one on two threads, where a start of a thread must not count.
const STATES: usize = 64;
const LONG: usize = 4096;
/// Rounds of batches, and how long a batch takes at least.
const ROUNDS: usize = 40;
const BATCH: Duration = Duration::from_micros(200);

/// One question to one robot.
pub(crate) struct Many {
    model: Arc<Model<f64>>,
    plan: Plan,
    workspace: Workspace<f64>,
    batch: Batch,
    input: Vec<f64>,
    output: Vec<f64>,
    answers: Vec<Answer>,
}

impl Many {
    /// The states of a robot, over and over up to this number.
    pub(crate) fn new(robot: &Robot, question: Question, states: usize) -> Outcome<Many> {
        let model = Arc::new(robot.variants[0].compiled.model.clone());
        let plan = Plan::new(&model, &question.query())?;
        let some: Vec<_> = robot.states.iter().map(|state| packed(&plan, state, 0)).collect();
        Ok(Many::of(&model, plan, some.iter().cycle().take(states)))
    }

    /// A plan on these inputs.
    pub(crate) fn of<'a>(
        model: &Arc<Model<f64>>,
        plan: Plan,
        inputs: impl Iterator<Item = &'a Vec<f64>>,
    ) -> Many {
        let inputs: Vec<_> = inputs.collect();
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        Many {
            workspace: Workspace::for_plans(model, [&plan]),
            batch: Batch::new(model, &plan),
            output: vec![0.0; inputs.len() * plan.want().len()],
            answers: vec![unknown; inputs.len()],
            input: inputs.into_iter().flatten().copied().collect(),
            model: Arc::clone(model),
            plan,
        }
    }

    /// One state after the other.
    fn alone(&mut self) {
        let n_in = self.plan.given().len();
        let n_out = self.plan.want().len();
        for (row, answer) in self.answers.iter_mut().enumerate() {
            *answer = self.plan.run(
                &self.model,
                &mut self.workspace,
                black_box(&self.input[row * n_in..][..n_in]),
                &mut self.output[row * n_out..][..n_out],
            );
        }
        black_box(&self.output);
    }

    /// All at once.
    pub(crate) fn abreast(&mut self) {
        self.batch.run(black_box(&self.input), &mut self.output, &mut self.answers);
        black_box(&self.output);
    }

    /// Every state has an answer.
    pub(crate) fn check(&self) -> Outcome {
        match self.answers.iter().find(|answer| answer.status != Status::Ok) {
            None => Ok(()),
            Some(answer) => Err(format!("{}: {}", self.model.name(), answer.status).into()),
        }
    }
}

/// A batch is one state: a call answers all of its rows.
impl Timed for Many {
    fn name(&self) -> String {
        format!("a batch of {}", self.model.name())
    }

    fn states(&self) -> usize {
        1
    }

    fn call(&mut self, _state: usize) -> Status {
        self.abreast();
        if self.check().is_ok() { Status::Ok } else { Status::UnknownRequest }
    }
}

/// Nanoseconds per state of a call, repeated for as long as a batch takes.
fn time(states: usize, mut call: impl FnMut()) -> f64 {
    let start = Instant::now();
    let mut calls = 0;
    while start.elapsed() < BATCH {
        call();
        calls += 1;
    }
    start.elapsed().as_nanos() as f64 / (calls * states) as f64
}

/// The lower quartile: other load on the machine only adds.
fn quartile(ns: &mut [f64]) -> f64 {
    ns.sort_unstable_by(f64::total_cmp);
    ns[ns.len() / 4]
}

/// Prints the table.
///
/// # Errors
///
/// Robots that do not load or do not answer.
pub fn run(only: &str) -> Outcome {
    let mut rows = Vec::new();
    for what in Subject::all().filter(|what| what.name().contains(only)) {
        let robot = match Robot::load(what, what.states(STATES)) {
            Ok(robot) => robot,
            Err(error) => {
                eprintln!("not measured: {error}");
                continue;
            }
        };
        for question in Question::CHOSEN {
            let mut many = Many::new(&robot, question, STATES)?;
            let mut halves =
                [Many::new(&robot, question, LONG / 2)?, Many::new(&robot, question, LONG / 2)?];
            let mut times = [const { Vec::new() }; 4];
            for _ in 0..ROUNDS {
                times[0].push(time(STATES, || many.alone()));
                times[1].push(time(STATES, || many.abreast()));
                let [first, second] = &mut halves;
                times[2].push(time(LONG, || {
                    first.abreast();
                    second.abreast();
                }));
                times[3].push(time(LONG, || {
                    thread::scope(|scope| {
                        scope.spawn(|| second.abreast());
                        first.abreast();
                    });
                }));
            }
            many.check()?;
            let [alone, abreast, one, two] = times.each_mut().map(|times| quartile(times));
            rows.push(vec![
                robot.name.to_owned(),
                question.name().to_owned(),
                many.batch.lanes().to_string(),
                ns(alone),
                ns(abreast),
                format!("{:.2}", abreast / alone),
                format!("{:.2}", one / two),
            ]);
        }
    }
    let table = Table {
        title: "Many states: ns per state".to_owned(),
        columns: vec!["robot", "asked", "lanes", "alone", "in a batch", "ratio", "two threads"],
        n_text: 2,
        rows,
        notes: vec![
            format!("in a batch of {STATES} states on one thread; ratio: against alone;"),
            format!("two threads: how many times as fast two are, {LONG} states, starts counted"),
        ],
    };
    print!("{}", table.text());
    Ok(())
}
