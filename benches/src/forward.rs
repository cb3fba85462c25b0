//! Forward dynamics by each method: what the cost model predicts beside what is measured (`--forward`).
//!
//! The bundled robots and chains of 10, 100 and 1000 lambdas, by recursion and by projection, in batches that take turns. Closures are the
//! the same for both; what differs is shown by the column `less`, the time without what both have in common (the same request with inverse
//! dynamics). `kkt` is measured where the robot is small.

use std::hint::black_box;
use std::time::Instant;

use sarrus_dynamics::{Field, FieldSet, Method, Model, Plan, Request, Status, Wanted, Workspace};
use sarrus_models::{Options, Source, load};

use crate::Outcome;
use crate::cases::BUNDLED;
use crate::chain::chain_of_lambdas;
use crate::table::{Table, ns};

/// Lambdas in a chain.
const CHAINS: [usize; 3] = [10, 100, 1000];
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
    fn new(model: &Model<f64>, method: Method) -> Outcome<Run> {
        let wanted = Wanted::new(Request::ForwardDynamics, FieldSet::of(&[Field::Y, Field::Yd, Field::TauU]), FieldSet::of(&[Field::Ydd]));
        let plan = Plan::with_method(model, &wanted, method)?;
        let workspace = Workspace::for_plans(model, [&plan]);
        let mut input = vec![0.0; plan.given().len()];
        for slot in plan.given().slots().iter().filter(|slot| slot.field != Field::Y) {
            input[slot.range()].iter_mut().enumerate().for_each(|(k, x)| *x = 0.3 + 0.1 * (k % 7) as f64);
        }
        let output = vec![0.0; plan.want().len()];
        let mut run = Run { model: model.clone(), plan, workspace, input, output, calls: 1, ns: Vec::new() };
        let status = run.plan.run(&run.model, &mut run.workspace, &run.input, &mut run.output).status;
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
            self.plan.run(&self.model, &mut self.workspace, black_box(&self.input), &mut self.output);
            black_box(&self.output);
        }
        self.ns.push(start.elapsed().as_nanos() as f64 / self.calls as f64);
    }

    /// The lower quartile: what else the machine does only adds.
    fn time(&mut self) -> f64 {
        self.ns.sort_unstable_by(f64::total_cmp);
        self.ns[self.ns.len() / 4]
    }
}

/// Prints the table; fails where the chosen method is more than 15 % slower than the other on a bundled robot.
pub(crate) fn run() -> Outcome {
    let mut models = Vec::new();
    for name in BUNDLED {
        models.push(load(&Source::Bundled(name.to_owned()), &Options::default())?.compiled.model);
    }
    for n in CHAINS {
        models.push(Model::compile(&chain_of_lambdas(n))?.model);
    }
    let (mut rows, mut slow) = (Vec::new(), Vec::new());
    for model in &models {
        let mut runs = vec![Run::new(model, Method::Recursion)?, Run::new(model, Method::Projection)?];
        if model.sizes().n_v <= 100 {
            runs.push(Run::new(model, Method::Kkt)?);
        }
        for _ in 0..ROUNDS {
            runs.iter_mut().for_each(Run::batch);
        }
        let times: Vec<f64> = runs.iter_mut().map(Run::time).collect();
        let predicted = [Method::Recursion, Method::Projection].map(|method| model.predicted_cost(method).unwrap_or(f64::NAN));
        let chosen = model.forward_method();
        let (mine, other) = if chosen == Method::Recursion { (times[0], times[1]) } else { (times[1], times[0]) };
        if mine > 1.15 * other && BUNDLED.contains(&model.name()) {
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
        notes: vec!["predicted: from M_y ÿ = b on; measured: the whole request, closures and Newton-Euler included".to_owned()],
    };
    print!("{}", table.text());
    if slow.is_empty() { Ok(()) } else { Err(format!("the chosen method is the slower one by more than 15 %: {}", slow.join(", ")).into()) }
}
