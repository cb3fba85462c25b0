//! Forward dynamics by each method: predictions of the cost model beside measurements
//! (`--forward`).
//!
//! Every robot as it is given, in one state, by recursion and by projection, in batches that take
//! turns. Closures and bias forces are the same for both, so the predicted difference stands beside
//! the measured one. `kkt` is measured where the robot is small.
//!
//! The prediction is calibrated by times, not by instructions: on long robots the recursion takes
//! more time for each of its instructions than the projection.

use std::hint::black_box;
use std::time::Instant;

use sarrus_dynamics::{Method, Model, Plan, Status, Workspace};
use sarrus_report::Outcome;
use sarrus_report::robots::{Question, Robot, Subject, packed};

use crate::table::{Table, ns};

/// Rounds of batches, and how long a batch takes at least.
const ROUNDS: usize = 60;
const BATCH_NS: u128 = 200_000;

/// One robot by one method.
struct Run {
    model: Model<f64>,
    plan: Plan,
    workspace: Workspace<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
    calls: usize,
    ns: Vec<f64>,
}

impl Run {
    fn new(robot: &Robot, method: Method) -> Outcome<Run> {
        let model = &robot.variants[0].compiled.model;
        let plan = Plan::with_method(model, &Question::ForwardDynamics.query(), method)?;
        let workspace = Workspace::for_plans(model, [&plan]);
        let input = packed(&plan, &robot.states[0], 0);
        let output = vec![0.0; plan.want().len()];
        let mut run =
            Run { model: model.clone(), plan, workspace, input, output, calls: 1, ns: Vec::new() };
        let status =
            run.plan.run(&run.model, &mut run.workspace, &run.input, &mut run.output).status;
        if status != Status::Ok {
            return Err(format!("{}: {status}", run.model.name()).into());
        }
        let start = Instant::now();
        run.batch();
        run.calls = (BATCH_NS / start.elapsed().as_nanos().max(1)).max(1) as usize;
        Ok(run)
    }

    fn batch(&mut self) {
        let start = Instant::now();
        for _ in 0..self.calls {
            let _ = self.plan.run(
                &self.model,
                &mut self.workspace,
                black_box(&self.input),
                &mut self.output,
            );
            black_box(&self.output);
        }
        self.ns.push(start.elapsed().as_nanos() as f64 / self.calls as f64);
    }

    /// The lower quartile: other load on the machine only adds.
    fn time(&mut self) -> f64 {
        self.ns.sort_unstable_by(f64::total_cmp);
        self.ns[self.ns.len() / 4]
    }
}

/// Prints the table; fails where the chosen method is more than 15 % slower than the other on a
/// bundled robot.
///
/// # Errors
///
/// That, and robots that do not load.
pub fn run() -> Outcome {
    let mut robots = Vec::new();
    for what in Subject::all() {
        // as it is given, in one state
        robots.push(Robot::load(what, 1)?);
    }
    let mut rows = Vec::new();
    let mut slow = Vec::new();
    for robot in &robots {
        let model = &robot.variants[0].compiled.model;
        let mut runs =
            vec![Run::new(robot, Method::Recursion)?, Run::new(robot, Method::Projection)?];
        if model.sizes().n_v <= 100 {
            runs.push(Run::new(robot, Method::Kkt)?);
        }
        for _ in 0..ROUNDS {
            runs.iter_mut().for_each(Run::batch);
        }
        let times: Vec<f64> = runs.iter_mut().map(Run::time).collect();
        let predicted = [Method::Recursion, Method::Projection]
            .map(|method| model.predicted_cost(method).unwrap_or(f64::NAN));
        let chosen = model.forward_method();
        let (mine, other) =
            if chosen == Method::Recursion { (times[0], times[1]) } else { (times[1], times[0]) };
        if mine > 1.15 * other && !matches!(robot.subject, Subject::Chain(_)) {
            slow.push(model.name().to_owned());
        }
        rows.push(vec![
            model.name().to_owned(),
            chosen.name().to_owned(),
            ns(predicted[0]),
            ns(predicted[1]),
            ns(predicted[0] - predicted[1]),
            ns(times[0] - times[1]),
            ns(times[0]),
            ns(times[1]),
            times.get(2).map_or("-".to_owned(), |x| ns(*x)),
        ]);
    }
    let table = Table {
        title: "Forward dynamics, ns per call".to_owned(),
        columns: vec![
            "robot",
            "chosen",
            "predicted recursion",
            "predicted projection",
            "predicted difference",
            "measured difference",
            "recursion",
            "projection",
            "kkt",
        ],
        n_text: 2,
        rows,
        notes: vec![
            "predicted: from M_y ÿ = b on; measured: the whole request, closures and \
            Newton-Euler included"
                .to_owned(),
        ],
    };
    print!("{}", table.text());
    if slow.is_empty() {
        Ok(())
    } else {
        Err(format!("the chosen method is the slower one by more than 15 %: {}", slow.join(", "))
            .into())
    }
}
