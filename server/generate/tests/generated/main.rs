//! Generated code against the generic kernels: every bit, in C as the compiler here makes it.
#![allow(clippy::unwrap_used, clippy::panic)]

mod device;
mod header;
mod js;

use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use sarrus_dynamics::description::{Inertial, SubmechanismKind};
use sarrus_dynamics::{
    DescriptionBuilder, Field, FieldSet, LinkId, Model, Plan, Query, Request, Status, Warnings,
    Workspace,
};
use sarrus_generate::{
    Cancel, Compiler, FLAGS, GenerateError, Kernel, Outcome, RandomInputs, Source,
};
use sarrus_models::{Options, load};

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"];
/// The bundled robots with closed forms alone.
const ROBOTS: [&str; 7] =
    ["lambda", "torso", "ankle", "parallelogram", "stewart", "r3_lambda_r", "rh5v2_upper_body"];
/// The others: with closures by Newton's method, or a floating base.
const OTHERS: [&str; 18] = [
    "wrist",
    "delta",
    "active_ankle",
    "five_bar",
    "four_bars_2",
    "squeezer",
    "bricard",
    "stewart_floating",
    "rh5v2_full",
    "g1_ankle",
    "jansen",
    "three_rrr",
    "gripper",
    "bennett",
    "agile_eye",
    "wheel_leg",
    "delta_balls",
    "cassie_leg",
];
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

/// The [`queries`] with a guess for Newton's method: that of the state with its velocity.
fn warm_queries() -> [(&'static str, Query); 3] {
    queries().map(|(name, mut query)| {
        let guess = if name == "state" {
            FieldSet::of(&[Field::QGuess, Field::QdGuess])
        } else {
            FieldSet::of(&[Field::QGuess])
        };
        query.given = FieldSet(query.given.0 | guess.0);
        (name, query)
    })
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

    /// The input of the code, with the results of closures by Newton's method, if they can be
    /// closed.
    fn closed(&mut self, input: &[f64]) -> Option<Vec<f64>> {
        self.plan.close(self.model, &mut self.workspace, input).map(<[f64]>::to_vec)
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
fn states<'a>(
    model: &'a Model<f64>,
    plan: &'a Plan,
    range: Range<u64>,
) -> impl Iterator<Item = Vec<f64>> + 'a {
    let mut inputs = RandomInputs::new(model, plan);
    range.map(move |k| {
        let mut input = inputs.input(FRESH + k);
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

/// Answers of traced code for these states, each with the kernels' bits.
fn evaluated(model: &Model<f64>, plan: &Plan, inputs: impl Iterator<Item = Vec<f64>>) -> Compared {
    let kernel = Kernel::trace(model, plan).unwrap();
    let mut comparison = Comparison::new(model, plan);
    let mut output = vec![0.0; plan.want().len()];
    for input in inputs {
        let outcome = match comparison.closed(&input) {
            Some(closed) => kernel.evaluate(&closed, &mut output),
            None => {
                output.fill(f64::NAN);
                Outcome::NotAnswered
            }
        };
        comparison.compare(&input, outcome, &output);
    }
    comparison.compared
}

/// The folder of a test's files.
fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Answers of a test program for states, one by one (`states`) or several at once (`rows`).
fn answers(
    mut command: Command,
    how: &str,
    states: &[Vec<f64>],
    outputs: usize,
) -> Vec<(Outcome, Vec<f64>)> {
    let bytes: Vec<u8> = states.iter().flatten().flat_map(|x| x.to_ne_bytes()).collect();
    command.arg(how).stdin(Stdio::piped()).stdout(Stdio::piped());
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
    queries_compared_in_c(&model(robot), robot, &queries(), count, flags);
}

fn queries_compared_in_c(
    model: &Model<f64>,
    robot: &str,
    queries: &[(&str, Query)],
    count: u64,
    flags: &[&str],
) {
    let Some(compiler) = Compiler::found() else {
        println!("not run: no C compiler");
        return;
    };
    for (name, query) in queries {
        let plan = Plan::new(model, query).unwrap();
        let kernel = Kernel::trace(model, &plan).unwrap();
        let source = Source::new(&kernel, model, &format!("{robot}_{name}"));
        let folder = folder(&format!("c{}", flags.len()));
        Compiler::write(&source, &folder).unwrap();
        let start = Instant::now();
        let built = compiler
            .build(&source, &folder, &[&WARNINGS, flags].concat(), &Cancel::default())
            .unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let words = built.test(&Cancel::default()).unwrap();
        let mut comparison = Comparison::new(model, &plan);
        let mut unclosed = 0;
        let mut early = 0;
        for first in (0..count).step_by(CHUNK) {
            let here = first..count.min(first + CHUNK as u64);
            let states = states(model, &plan, here);
            let of = |input: Vec<f64>| (comparison.closed(&input), input);
            let states: Vec<(Option<Vec<f64>>, Vec<f64>)> = states.map(of).collect();
            let closed: Vec<Vec<f64>> = states.iter().filter_map(|x| x.0.clone()).collect();
            unclosed += states.len() - closed.len();
            let [answers, abreast] = ["states", "rows"]
                .map(|how| answers(Command::new(&built.test), how, &closed, plan.want().len()));
            let inputs = states.iter().filter(|x| x.0.is_some()).map(|x| &x.1);
            for ((input, (outcome, output)), row) in inputs.zip(answers).zip(abreast) {
                comparison.compare(input, outcome, &output);
                // combined checks leave a row early
                let is_answered = row.0 != Outcome::NotAnswered;
                early += u64::from(!is_answered && outcome != Outcome::NotAnswered);
                assert!(outcome == row.0 || !is_answered, "{input:?}");
                let mut pairs = output.iter().zip(&row.1);
                let is_same = pairs.all(|(a, b)| a.to_bits() == b.to_bits());
                assert!(is_same || !is_answered, "{:?} for {output:?} at {input:?}", row.1);
            }
        }
        let Compared { answered, left } = comparison.compared;
        assert!(early * 50 <= answered, "{early} rows of {answered} are left");
        println!(
            "{robot} {name}: {} operations, {} checks, built in {seconds:.1} s, {} bytes; \
             {answered} of {count} answered, {unclosed} not closed, {left} left to the kernel; \
             {words}",
            kernel.operations(),
            kernel.checks(),
            std::fs::metadata(&built.library).unwrap().len(),
        );
        let closed = count - unclosed as u64;
        assert!(answered > closed / 2 && answered > count / 10, "{answered} {unclosed}");
        assert!(left < count / 20, "{left}");
    }
}

#[test]
fn c_has_the_bits_of_the_kernels() {
    for robot in ["lambda", "torso", "parallelogram", "r3_lambda_r"] {
        compared_in_c(robot, 10_000, &[]);
    }
}

#[test]
fn c_around_newtons_method_has_the_bits_of_the_plans_with_and_without_a_guess() {
    let model = model("wrist");
    queries_compared_in_c(&model, "wrist", &queries(), 10_000, &[]);
    queries_compared_in_c(&model, "wrist_warm", &warm_queries(), 10_000, &[]);
}

/// Builds the test of a source with a compiler of this name, and runs it; `None` where there is no
/// such compiler.
fn tested_by(compiler: &str, source: &Source, folder: &Path, flags: &[&str]) -> Option<String> {
    Command::new(compiler).arg("--version").stdout(Stdio::null()).status().ok()?;
    Compiler::write(source, folder).unwrap();
    let file = |ending: &str| folder.join(format!("{}{ending}", source.name));
    let program = file("_test");
    let mut command = Command::new(compiler);
    command
        .args(FLAGS)
        .arg("-DSARRUS_ROWS")
        .args(WARNINGS)
        .args(flags)
        .args([file(".c"), file("_test.c")]);
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
            let mut inputs = RandomInputs::new(&model, &plan);
            let moving: Vec<Vec<f64>> = (0..200).map(|k| inputs.input(FRESH + k % 100)).collect();
            let at_rest = moving.iter().cloned().enumerate().map(|(k, mut input)| {
                input[rates.clone()].fill(if k < 100 { 0.0 } else { -0.0 });
                input
            });
            let Compared { answered, left } = evaluated(&model, &plan, at_rest);
            println!("{robot} {name}: {answered} at rest answered, {left} left to the kernel");
            // some poses are left in motion too, as where an actuator has hardly any lever
            let most = evaluated(&model, &plan, moving.into_iter()).left;
            assert!(answered > 100 && left <= most && most < 10, "{answered} {left} {most}");
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
fn c_of_every_robot_has_the_bits_of_the_kernels_on_a_million_states() {
    for robot in ROBOTS.into_iter().chain(OTHERS) {
        compared_in_c(robot, 1_000_000, &[]);
    }
}

#[test]
fn sanitizers_find_nothing() {
    let sanitizers = ["-fsanitize=undefined,address", "-fno-sanitize-recover=all"];
    // an empty program shows whether the compiler has them
    let text = "int main(void) { return 0; }\n".to_owned();
    let empty = Source {
        name: "empty".to_owned(),
        header: String::new(),
        function: "extern int nothing;\nint nothing;\n".to_owned(),
        test: text,
        launcher: None,
    };
    let folder = folder("empty");
    Compiler::write(&empty, &folder).unwrap();
    match Compiler::found() {
        Some(compiler)
            if compiler.build(&empty, &folder, &sanitizers, &Cancel::default()).is_ok() =>
        {
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
            assert!(answered > 1_000 && left < answered / 4);
        }
    }
}

#[test]
fn traced_code_around_newtons_method_has_the_bits_of_the_plans() {
    for robot in OTHERS {
        let model = model(robot);
        for (kind, queries) in [("cold", queries()), ("warm", warm_queries())] {
            for (name, query) in queries {
                let plan = Plan::new(&model, &query).unwrap();
                let inputs = states(&model, &plan, 0..1_000);
                let Compared { answered, left } = evaluated(&model, &plan, inputs);
                println!("{robot} {kind} {name}: {answered} answered, {left} left to the plan");
                assert!(answered > 0);
            }
        }
    }
}

#[test]
fn floating_bases_and_ball_joints_have_the_bits_of_the_plans() {
    let mut robot = DescriptionBuilder::new("balls");
    let bob = Inertial::new(1.0, [0.1, 0.0, 0.2], [0.02, 0.0, 0.0, 0.03, 0.0, 0.04]);
    let body = robot.floating("base", LinkId::BASE).inertial(bob).link();
    let arm = robot.spherical("ball", body).origin([0.1, 0.2, 0.3]).inertial(bob).link();
    robot.revolute("elbow", arm, [0.0, 1.0, 0.0]).origin([0.0, 0.0, 0.4]).inertial(bob);
    let model = robot.compile().unwrap().model;
    let torque =
        Query { given: FieldSet::of(&[Field::Y, Field::Yd, Field::TauY]), ..queries()[2].1 };
    let forces = Query { want: FieldSet::of(&[Field::TauY]), ..queries()[1].1 };
    for query in [queries()[0].1, forces, torque] {
        let plan = Plan::new(&model, &query).unwrap();
        let inputs = states(&model, &plan, 0..2_000).map(|mut input| {
            // not quite of unit length
            let scale = if input[0] > 0.0 { 1.0 + 1e-7 } else { 1.0 };
            input[3..7].iter_mut().for_each(|x| *x *= scale);
            input
        });
        let Compared { answered, left } = evaluated(&model, &plan, inputs);
        println!("{:?}: {answered} answered, {left} left to the plan", query.want);
        assert!(answered > 1_500 && left < 20, "{answered} {left}");
    }
}

/// Lambdas in a row, each on the rocker of the one before and turned against it.
fn chain_of_lambdas(n: usize) -> Model<f64> {
    let inertial = |y: f64, mass: f64| {
        Inertial::new(mass, [0.0, y, 0.01], [0.004, 0.0, 0.0, 0.002, 0.0, 0.005])
    };
    let x = [1.0, 0.0, 0.0];
    let y = [0.0, 1.0, 0.0];
    let mut robot = DescriptionBuilder::new(format!("{n} lambdas"));
    let mut on = LinkId::BASE;
    for k in 0..n {
        robot.submechanism(format!("lambda{k}"), SubmechanismKind::Rrpr);
        let rocker = robot.revolute(format!("rocker{k}"), on, x).origin([0.0, 0.2, 0.05]);
        let rocker = rocker.rpy([0.8, 0.0, 0.2]).limits(-0.3, 0.3).inertial(inertial(0.1, 1.2));
        let rocker = rocker.link();
        let stator = robot.revolute(format!("stator{k}"), on, x).rpy([1.08, 0.0, 0.2]);
        let pivot = [-0.114 * 0.2_f64.sin(), 0.2 + 0.114 * 0.2_f64.cos(), 0.05];
        let stator = stator.origin(pivot).inertial(inertial(0.1, 0.5)).link();
        let slider = robot.prismatic(format!("slider{k}"), stator, y).origin([0.0, 0.3, 0.0]);
        let slider = slider.inertial(inertial(-0.1, 0.4)).link();
        let pin = robot.cut(format!("pin{k}"), rocker, slider).at_frame_of(slider);
        pin.row("y", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]).row("z", [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        robot.independent([rocker]).active([slider]);
        on = rocker;
    }
    robot.compile().unwrap().model
}

#[test]
fn a_long_function_is_divided_and_has_the_bits_of_the_plan() {
    let model = chain_of_lambdas(20);
    let forward = [queries()[2]];
    let plan = Plan::new(&model, &forward[0].1).unwrap();
    let source = Source::new(&Kernel::trace(&model, &plan).unwrap(), &model, "chain");
    assert!(source.function.contains("void chain_1(struct chain_shared *all)"));
    queries_compared_in_c(&model, "chain", &forward, 2_000, &[]);
}

#[test]
#[ignore = "compiles large functions"]
fn what_compilers_take_grows_with_the_length_of_a_chain() {
    for n in [14, 28, 50] {
        let model = chain_of_lambdas(n);
        queries_compared_in_c(&model, &format!("chain_{n}"), &queries()[1..], 1_000, &[]);
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
    assert!(matches!(error, GenerateError::TooLarge(_)), "{error}");
}
