//! Generated code against the generic kernels: every bit, in C as the compiler here makes it.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::{
    DescriptionBuilder, Field, FieldSet, LinkId, Model, Plan, Query, Request, Status, Warnings,
    Workspace,
};
use sarrus_generate::{Compiler, FLAGS, GenerateError, Kernel, Outcome, Source, random_input};
use sarrus_models::{Options, load};

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"];
/// The bundled robots with closed forms alone.
const ROBOTS: [&str; 7] =
    ["lambda", "torso", "ankle", "parallelogram", "stewart", "r3_lambda_r", "rh5v2_upper_body"];
/// First of the states that nothing was traced or compared at.
const FRESH: u64 = 1_000_000;
/// States that go through a program at once.
const CHUNK: usize = 10_000;

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
struct Comparison<'a> {
    model: &'a Model<f64>,
    plan: &'a Plan,
    workspace: Workspace<f64>,
    output: Vec<f64>,
    compared: Compared,
}

impl<'a> Comparison<'a> {
    fn new(model: &'a Model<f64>, plan: &'a Plan) -> Comparison<'a> {
        let workspace = Workspace::for_plans(model, [plan]);
        let output = vec![0.0; plan.want().len()];
        Comparison { model, plan, workspace, output, compared: Compared::default() }
    }

    fn compare(&mut self, input: &[f64], outcome: Outcome, output: &[f64]) {
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
fn states(model: &Model<f64>, plan: &Plan, range: Range<u64>) -> impl Iterator<Item = Vec<f64>> {
    range.map(move |k| {
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

/// What traced code answers of these states, each with the kernels' bits.
fn evaluated(model: &Model<f64>, plan: &Plan, inputs: impl Iterator<Item = Vec<f64>>) -> Compared {
    let kernel = Kernel::trace(model, plan).unwrap();
    let mut comparison = Comparison::new(model, plan);
    let mut output = vec![0.0; plan.want().len()];
    for input in inputs {
        let outcome = kernel.evaluate(&input, &mut output);
        comparison.compare(&input, outcome, &output);
    }
    comparison.compared
}

/// The folder of a test's files.
fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// What a test program answers to states.
fn answers(program: &Path, states: &[Vec<f64>], outputs: usize) -> Vec<(Outcome, Vec<f64>)> {
    let bytes: Vec<u8> = states.iter().flatten().flat_map(|x| x.to_ne_bytes()).collect();
    let mut command = Command::new(program);
    command.arg("states").stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(&bytes).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    assert!(output.status.success());
    let number = |bytes: &[u8]| f64::from_ne_bytes(bytes.try_into().unwrap());
    let numbers: Vec<f64> = output.stdout.chunks_exact(8).map(number).collect();
    assert_eq!(numbers.len(), states.len() * (outputs + 1));
    let answer = |numbers: &[f64]| {
        let outcome = match numbers[0] {
            0.0 => Outcome::Ok,
            1.0 => Outcome::LimitsExceeded,
            _ => Outcome::NotAnswered,
        };
        (outcome, numbers[1..].to_vec())
    };
    numbers.chunks_exact(outputs + 1).map(answer).collect()
}

fn compared_in_c(robot: &str, count: u64, flags: &[&str]) {
    let Some(compiler) = Compiler::found() else {
        println!("not run: no C compiler");
        return;
    };
    let model = model(robot);
    for (name, query) in queries() {
        let plan = Plan::new(&model, &query).unwrap();
        let kernel = Kernel::trace(&model, &plan).unwrap();
        let source = Source::new(&kernel, &model, &format!("{robot}_{name}"));
        let folder = folder(&format!("c{}", flags.len()));
        Compiler::write(&source, &folder).unwrap();
        let start = Instant::now();
        let built = compiler.build(&source, &folder, &[&WARNINGS, flags].concat()).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let words = built.test().unwrap();
        let mut comparison = Comparison::new(&model, &plan);
        for first in (0..count).step_by(CHUNK) {
            let here = first..count.min(first + CHUNK as u64);
            let states: Vec<Vec<f64>> = states(&model, &plan, here).collect();
            let answers = answers(&built.test, &states, plan.want().len());
            for (input, (outcome, output)) in states.iter().zip(answers) {
                comparison.compare(input, outcome, &output);
            }
        }
        let Compared { answered, left } = comparison.compared;
        println!(
            "{robot} {name}: {} operations, {} checks, built in {seconds:.1} s, {} bytes; \
             {answered} of {count} answered, {left} left to the kernel; {words}",
            kernel.operations(),
            kernel.checks(),
            std::fs::metadata(&built.library).unwrap().len(),
        );
        assert!(answered > count / 2 && left < count / 20, "{answered} {left}");
    }
}

#[test]
fn c_has_the_bits_of_the_kernels() {
    for robot in ["lambda", "torso", "parallelogram", "r3_lambda_r"] {
        compared_in_c(robot, 10_000, &[]);
    }
}

/// Builds the test of a source with a compiler of this name, and runs it; `None` where there is no
/// such compiler.
fn tested_by(compiler: &str, source: &Source, folder: &Path, flags: &[&str]) -> Option<String> {
    Command::new(compiler).arg("--version").stdout(Stdio::null()).status().ok()?;
    Compiler::write(source, folder).unwrap();
    let file = |ending: &str| folder.join(format!("{}{ending}", source.name));
    let program = file("_test");
    let mut command = Command::new(compiler);
    command.args(FLAGS).args(WARNINGS).args(flags).args([file(".c"), file("_test.c")]);
    let output = command.arg("-o").arg(&program).arg("-lm").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new(&program).output().unwrap();
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{words}");
    Some(words)
}

#[test]
fn gcc_and_clang_give_the_bits_with_every_kind_of_pair() {
    for compiler in ["gcc", "clang"] {
        let model = model("torso");
        for (name, query) in queries() {
            let plan = Plan::new(&model, &query).unwrap();
            let kernel = Kernel::trace(&model, &plan).unwrap();
            let source = Source::new(&kernel, &model, &format!("torso_{name}"));
            let single = ["-DSARRUS_PORTABLE", "-DSARRUS_SINGLE"];
            for (folder, flags) in [("sse", &[][..]), ("gnu", &single[..1]), ("single", &single)] {
                let folder = self::folder(&format!("{compiler}_{folder}"));
                match tested_by(compiler, &source, &folder, flags) {
                    Some(words) => println!("{compiler} {flags:?}: {words}"),
                    None => println!("not run: no {compiler}"),
                }
            }
        }
    }
}

#[test]
fn a_robot_at_rest_is_answered() {
    for robot in ROBOTS {
        let model = model(robot);
        for (name, query) in queries() {
            let plan = Plan::new(&model, &query).unwrap();
            let rates = plan.given().slot(Field::Yd).unwrap().range();
            let at_rest = (0..200).map(|k| {
                let mut input = random_input(model.info(), plan.given(), FRESH + k % 100);
                input[rates.clone()].fill(if k < 100 { 0.0 } else { -0.0 });
                input
            });
            let Compared { answered, left } = evaluated(&model, &plan, at_rest);
            println!("{robot} {name}: {answered} at rest answered, {left} left to the kernel");
            assert!(answered > 100 && left == 0, "{answered} {left}");
        }
    }
}

#[test]
fn frames_and_jacobians_of_a_plane_robot_are_answered() {
    use Field::*;
    let model = model("parallelogram");
    let want = FieldSet::of(&[FramePose, FrameTwist, JacobianTree, JacobianIndependent]);
    let link = model.info().links.len() as u16 - 1;
    let query = Query::new(Request::Kinematics, FieldSet::of(&[Y, Yd]), want).with_frames(&[link]);
    let plan = Plan::new(&model, &query).unwrap();
    let Compared { answered, left } = evaluated(&model, &plan, states(&model, &plan, 0..2_000));
    assert!(answered > 1_000 && left == 0, "{answered} {left}");
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
    // an empty program says whether the compiler has them
    let text = "int main(void) { return 0; }\n".to_owned();
    let empty = Source {
        name: "empty".to_owned(),
        header: String::new(),
        function: "extern int nothing;\nint nothing;\n".to_owned(),
        test: text,
    };
    let folder = folder("empty");
    Compiler::write(&empty, &folder).unwrap();
    match Compiler::found() {
        Some(compiler) if compiler.build(&empty, &folder, &sanitizers).is_ok() => {
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
            let inputs = states(&model, &plan, 0..2_000);
            let Compared { answered, left } = evaluated(&model, &plan, inputs);
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

#[test]
fn what_is_too_large_for_a_compiler_is_refused() {
    let mut robot = DescriptionBuilder::new("chain");
    let mut link = LinkId::BASE;
    for k in 0..600 {
        let axis = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]][k % 2];
        let bob = Inertial::point(1.0, [0.1, 0.0, 0.2]);
        let joint = robot.revolute(format!("joint_{k}"), link, axis);
        link = joint.origin([0.05, 0.1, 0.02]).inertial(bob).link();
    }
    let model = robot.compile().unwrap().model;
    let [_, (_, inverse), _] = queries();
    let plan = Plan::new(&model, &inverse).unwrap();
    let error = Kernel::trace(&model, &plan).unwrap_err();
    assert!(matches!(error, GenerateError::TooLarge { .. }), "{error}");
}
