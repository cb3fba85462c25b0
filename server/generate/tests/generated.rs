//! Generated code against the generic kernels: every bit, in C as the compiler here makes it.
#![allow(clippy::unwrap_used, clippy::panic)]

mod compiler;

use compiler::{Compiled, compiler};
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Status, Warnings, Workspace};
use sarrus_generate::{GenerateError, Kernel, Outcome, Source, random_input};
use sarrus_models::{Options, load};

/// The bundled robots with closed forms alone.
const ROBOTS: [&str; 7] =
    ["lambda", "torso", "ankle", "parallelogram", "stewart", "r3_lambda_r", "rh5v2_upper_body"];
/// First of the states that nothing was traced or compared at.
const FRESH: u64 = 1_000_000;

fn model(robot: &str) -> Model<f64> {
    let source = sarrus_models::Source::Bundled(robot.to_owned());
    load(&source, &Options::default()).unwrap().compiled.model
}

fn queries() -> [(&'static str, Query); 3] {
    use Field::*;
    let query = |request, given: &[Field], want: &[Field]| {
        Query::new(request, FieldSet::of(given), FieldSet::of(want))
    };
    [
        ("state", query(Request::Kinematics, &[Y, Yd, Ydd], &[Q, Qd, Qdd])),
        ("inverse", query(Request::InverseDynamics, &[Y, Yd, Ydd], &[TauU])),
        ("forward", query(Request::ForwardDynamics, &[Y, Yd, TauU], &[Ydd])),
    ]
}

/// Answers of both on many states.
#[derive(Default)]
struct Compared {
    answered: u64,
    /// The generic kernel answers without doubt, the code does not.
    left: u64,
}

/// One answer of the code against the generic one.
struct Judge<'a> {
    model: &'a Model<f64>,
    plan: &'a Plan,
    workspace: Workspace<f64>,
    output: Vec<f64>,
    compared: Compared,
}

impl<'a> Judge<'a> {
    fn new(model: &'a Model<f64>, plan: &'a Plan) -> Judge<'a> {
        let workspace = Workspace::for_plans(model, [plan]);
        let output = vec![0.0; plan.want().len()];
        Judge { model, plan, workspace, output, compared: Compared::default() }
    }

    fn see(&mut self, input: &[f64], outcome: Outcome, output: &[f64]) {
        let answer = self.plan.run(self.model, &mut self.workspace, input, &mut self.output);
        let sure =
            answer.status == Status::Ok && Warnings::LIMITS_EXCEEDED.contains(answer.warnings);
        let warnings = match outcome {
            Outcome::NotAnswered => {
                self.compared.left += u64::from(sure);
                assert!(output.iter().all(|x| x.is_nan()));
                return;
            }
            Outcome::Ok => Warnings::NONE,
            Outcome::LimitsExceeded => Warnings::LIMITS_EXCEEDED,
        };
        assert_eq!((answer.status, answer.warnings), (Status::Ok, warnings), "{input:?}");
        for (a, b) in output.iter().zip(&self.output) {
            assert_eq!(a.to_bits(), b.to_bits(), "{a:e} for {b:e} at {input:?}");
        }
        self.compared.answered += 1;
    }
}

/// States of every kind: random ones, at rest, with zeros among them, out of range, no numbers.
fn states(model: &Model<f64>, plan: &Plan, count: u64) -> impl Iterator<Item = Vec<f64>> {
    (0..count).map(move |k| {
        let mut input = random_input(model.info(), plan.given(), FRESH + k);
        let n = input.len();
        match k % 64 {
            0 => input.iter_mut().skip(n / 3).for_each(|x| *x = 0.0),
            1 => input.iter_mut().for_each(|x| *x = if *x > 0.0 { 0.0 } else { -0.0 }),
            2 => input[(k as usize / 64) % n] = f64::NAN,
            3 => input[(k as usize / 64) % n] = f64::INFINITY,
            4 => input.iter_mut().for_each(|x| *x *= 1e3),
            5 => input.iter_mut().skip(n / 3).for_each(|x| *x *= 1e170),
            6 => input.iter_mut().step_by(3).for_each(|x| *x = 0.0),
            _ => {}
        }
        input
    })
}

fn compared_in_c(robot: &str, count: u64, flags: &[&str]) {
    let Some(cc) = compiler() else {
        println!("not run: no C compiler");
        return;
    };
    let model = model(robot);
    for (name, query) in queries() {
        let plan = Plan::new(&model, &query).unwrap();
        let kernel = Kernel::trace(&model, &plan).unwrap();
        let source = Source::new(&kernel, &model, &format!("{robot}_{name}"));
        let compiled = Compiled::new(&cc, &source, flags);
        let words = compiled.test();
        let mut judge = Judge::new(&model, &plan);
        let states: Vec<Vec<f64>> = states(&model, &plan, count).collect();
        let answers = compiled.answers(&states, plan.want().len());
        for (input, (outcome, output)) in states.iter().zip(&answers) {
            judge.see(input, *outcome, output);
        }
        let Compared { answered, left } = judge.compared;
        println!(
            "{robot} {name}: {} operations, {} checks, compiled in {:.1} s, {} bytes; {answered} \
             of {count} answered, {left} left to the kernel; {words}",
            kernel.operations(),
            kernel.checks(),
            compiled.seconds,
            compiled.bytes,
        );
        assert!(answered > count / 4 && left < count / 20, "{answered} {left}");
    }
}

#[test]
fn c_has_the_bits_of_the_kernels() {
    for robot in ["lambda", "torso", "parallelogram", "r3_lambda_r"] {
        compared_in_c(robot, 10_000, &[]);
    }
}

#[test]
#[ignore = "compiles large functions"]
fn c_of_every_analytic_robot_has_the_bits_of_the_kernels_on_a_million_states() {
    for robot in ROBOTS {
        compared_in_c(robot, 1_000_000, &[]);
    }
}

#[test]
fn sanitizers_find_nothing() {
    let sanitizers = ["-fsanitize=undefined,address", "-fno-sanitize-recover=all"];
    match compiler() {
        Some(cc) if compiler::takes(&cc, &sanitizers) => {
            compared_in_c("lambda", 1_000, &sanitizers);
        }
        _ => println!("not run: no C compiler with sanitizers"),
    }
}

#[test]
fn traced_code_has_the_bits_of_the_kernels() {
    for robot in ROBOTS {
        let model = model(robot);
        for (name, query) in queries() {
            let plan = Plan::new(&model, &query).unwrap();
            let kernel = Kernel::trace(&model, &plan).unwrap();
            let mut judge = Judge::new(&model, &plan);
            let mut output = vec![0.0; plan.want().len()];
            for input in states(&model, &plan, 2_000) {
                let outcome = kernel.evaluate(&input, &mut output);
                judge.see(&input, outcome, &output);
            }
            let Compared { answered, left } = judge.compared;
            println!("{robot} {name}: {answered} answered, {left} left to the kernel");
        }
    }
}

#[test]
fn numerical_closures_are_refused_by_name() {
    let model = model("wrist");
    for (_, query) in queries() {
        let plan = Plan::new(&model, &query).unwrap();
        let error = Kernel::trace(&model, &plan).unwrap_err();
        assert!(matches!(error, GenerateError::Numerical { .. }), "{error}");
    }
}
