//! Generated code of bundled and random robots has the bits of their plans.

use std::path::PathBuf;
use std::sync::Arc;

use sarrus_dynamics::{
    Answer, BatchWorkspace, Field, FieldSet, Model, Plan, Query, Request, Status, Warnings,
    Workspace,
};
use sarrus_generate::{
    Cache, Cancel, Compiler, GenerateError, Kernel, MakeError, NativeKernel, Outcome, RandomInputs,
};
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::random::random_robot;
use sarrus_tests::reference::ROBOTS;
use sarrus_tests::seed::Seeded;

/// Index of the first state that was neither traced nor compared before.
const FRESH: u64 = 3_000_000;
/// States of each query in the long run for a bundled and for a random robot, and the count of
/// random robots.
const OF_BUNDLED: u64 = 1_000_000;
const OF_RANDOM: u64 = 50_000;
const RANDOM: u64 = 100;
/// Rows of a batch: several full calls of the code for rows, and a remainder.
const ROWS: usize = 61;

/// State, inverse and forward dynamics, without a guess and with one.
fn queries() -> [(&'static str, Query); 6] {
    use Field::*;
    let query = |request, given: &[Field], want: &[Field]| {
        Query::new(request, FieldSet::of(given), FieldSet::of(want))
    };
    let state = [Q, Qd, Qdd];
    [
        ("state", query(Request::Kinematics, &[Y, Yd, Ydd], &state)),
        ("inverse", query(Request::InverseDynamics, &[Y, Yd, Ydd], &[TauY])),
        ("forward", query(Request::ForwardDynamics, &[Y, Yd, TauY], &[Ydd])),
        ("warm state", query(Request::Kinematics, &[Y, Yd, Ydd, QGuess, QdGuess], &state)),
        ("warm inverse", query(Request::InverseDynamics, &[Y, Yd, Ydd, QGuess], &[TauY])),
        ("warm forward", query(Request::ForwardDynamics, &[Y, Yd, TauY, QGuess], &[Ydd])),
    ]
}

/// States of a plan: its robot's states and random ones in turn, some of them unreachable.
struct States<'a> {
    case: &'a Case,
    plan: &'a Plan,
    inputs: RandomInputs<'a>,
    seeded: Seeded,
}

impl<'a> States<'a> {
    fn new(case: &'a Case, plan: &'a Plan) -> States<'a> {
        let inputs = RandomInputs::new(&case.compiled.model, plan);
        States { case, plan, inputs, seeded: Seeded::new(case.seed + 77) }
    }

    fn state(&mut self, k: u64) -> Vec<f64> {
        let mut input = self.inputs.input(FRESH + k);
        if k.is_multiple_of(2) {
            // a guess in the input then belongs to other independents, which is allowed
            let state = self.case.state::<f64>(k);
            let parts = [(Field::Y, state.y), (Field::Yd, state.yd), (Field::Ydd, state.ydd)];
            for (field, numbers) in parts {
                if let Some(slot) = self.plan.given().slot(field) {
                    input[slot.range()].copy_from_slice(&numbers);
                }
            }
        }
        match self.seeded.below(40) {
            0 => input.iter_mut().for_each(|x| *x *= 7.0),
            1 => input.iter_mut().for_each(|x| *x *= 1e3),
            2 if !input.is_empty() => {
                let at = self.seeded.below(input.len());
                input[at] = [f64::NAN, f64::INFINITY, 1e300, 1e17][self.seeded.below(4)];
            }
            3 => input.fill(0.0),
            4 => input.iter_mut().step_by(3).for_each(|x| *x = -0.0),
            _ => {}
        }
        input
    }
}

/// Counts of states that the code answered, that the plan answers without a warning, and in all.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    answered: u64,
    sure: u64,
    asked: u64,
}

/// Compares the answers of `code` and the plan bit by bit.
fn compare(
    what: &str,
    (case, plan): (&Case, &Plan),
    range: std::ops::Range<u64>,
    mut code: impl FnMut(&mut Workspace<f64>, &[f64], &mut [f64]) -> Option<Warnings>,
) -> Count {
    let model = &case.compiled.model;
    let mut workspace = Workspace::for_plans(model, [plan]);
    let [mut found, mut expected] = [(); 2].map(|()| vec![0.0; plan.want().len()]);
    let mut states = States::new(case, plan);
    let mut count = Count::default();
    for k in range {
        let input = states.state(k);
        let warnings = code(&mut workspace, &input, &mut found);
        let right = plan.run(model, &mut workspace, &input, &mut expected);
        count.asked += 1;
        let is_sure =
            right.status == Status::Ok && Warnings::LIMITS_EXCEEDED.contains(right.warnings);
        count.sure += u64::from(is_sure);
        let Some(warnings) = warnings else { continue };
        count.answered += 1;
        assert_eq!((Status::Ok, warnings), (right.status, right.warnings), "{what}: {input:?}");
        for (a, b) in found.iter().zip(&expected) {
            assert_eq!(a.to_bits(), b.to_bits(), "{what}: {a:e} for {b:e} at {input:?}");
        }
    }
    count
}

/// Compares batches of the code and the plan bit by bit.
fn compare_rows(
    what: &str,
    (case, plan): (&Case, &Plan),
    range: std::ops::Range<u64>,
    native: &NativeKernel,
) -> Count {
    let model = &case.compiled.model;
    let n_in = plan.given().len();
    let n_out = plan.want().len();
    let mut scratch = BatchWorkspace::new(&Arc::new(model.clone()), n_in, n_out);
    let mut workspace = Workspace::for_plans(model, [plan]);
    let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
    let mut found = vec![0.0; ROWS * n_out];
    let mut answers = [unknown; ROWS];
    let mut expected = vec![0.0; n_out];
    let mut states = States::new(case, plan);
    let mut count = Count::default();
    for first in range.step_by(ROWS) {
        let input: Vec<f64> = (first..).take(ROWS).flat_map(|k| states.state(k)).collect();
        let (_, by_code) = native.answer_rows(plan, &mut scratch, &input, &mut found, &mut answers);
        count.answered += by_code as u64;
        for (row, answer) in answers.iter().enumerate() {
            let input = &input[row * n_in..][..n_in];
            let right = plan.run(model, &mut workspace, input, &mut expected);
            count.asked += 1;
            assert_eq!(*answer, right, "{what}, row {row}: {input:?}");
            for (a, b) in found[row * n_out..][..n_out].iter().zip(&expected) {
                assert_eq!(a.to_bits(), b.to_bits(), "{what}: {a:e} for {b:e} at {input:?}");
            }
        }
    }
    count
}

/// True for errors that a random robot may have.
fn is_excused(error: &GenerateError) -> bool {
    use GenerateError::*;
    matches!(error, NoState { .. } | Unserved { .. } | TooLarge { .. } | NotStraight)
}

#[test]
fn traced_code_of_bundled_and_random_robots_has_the_bits_of_their_plans() {
    let mut traced = 0;
    let mut refused = 0;
    let mut all = Count::default();
    for case in robots().iter().take(22).chain(robots().iter().skip(24).step_by(12)) {
        let model = &case.compiled.model;
        for (name, query) in queries() {
            let plan = Plan::new(model, &query).unwrap();
            let what = format!("{} {name}", case.name);
            let kernel = match Kernel::trace(model, &plan) {
                Ok(kernel) => kernel,
                Err(error) => {
                    println!("{what}: {error}");
                    assert!(is_excused(&error), "{what}: {error}");
                    refused += 1;
                    continue;
                }
            };
            traced += 1;
            let count = compare(&what, (case, &plan), 0..100, |workspace, input, output| {
                let closed = plan.close(model, workspace, input)?.to_vec();
                match kernel.evaluate(&closed, output) {
                    Outcome::Ok => Some(Warnings::NONE),
                    Outcome::LimitsExceeded => Some(Warnings::LIMITS_EXCEEDED),
                    Outcome::NotAnswered => None,
                }
            });
            all.answered += count.answered;
            all.sure += count.sure;
        }
    }
    println!("{traced} traced, {refused} refused; {all:?}");
    assert!(refused * 4 < traced, "{refused} of {traced}");
    assert!(all.answered * 10 > all.sure * 7, "{all:?}");
}

#[test]
#[ignore = "compiles hundreds of functions, and runs each on a million states"]
fn compiled_code_of_bundled_robots_has_the_bits_of_their_plans_on_a_million_states() {
    compiled_code_has_the_bits(ROBOTS.iter().map(|name| (Case::bundled(name), OF_BUNDLED)));
}

#[test]
#[ignore = "compiles hundreds of functions, and runs each on thousands of states"]
fn compiled_code_of_random_robots_has_the_bits_of_their_plans_on_thousands_of_states() {
    let of_seed = |seed| Case::of_text(&random_robot(seed), seed, &Default::default()).ok();
    let random = (5_000..5_000 + RANDOM).filter_map(of_seed);
    compiled_code_has_the_bits(random.map(|case| (case, OF_RANDOM)));
}

fn compiled_code_has_the_bits(cases: impl Iterator<Item = (Case, u64)>) {
    let Some(compiler) = Compiler::found() else { return println!("not run: no C compiler") };
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("generated");
    let cache = Cache::at(folder.join("kernels"));
    let kernel = |model: &Model<f64>, plan: &Plan| -> Result<NativeKernel, MakeError> {
        Ok(cache.kernel(model, plan, &compiler, &Cancel::default())?.kernel)
    };
    let mut all = Count::default();
    let mut in_rows = Count::default();
    for (case, states) in cases {
        let model = &case.compiled.model;
        for (name, query) in queries() {
            let plan = Plan::new(model, &query).unwrap();
            // a guess makes another plan only if the closures read it
            if query.given.has(Field::QGuess) && !plan.closes_apart() {
                continue;
            }
            let what = format!("{} {name}", case.name);
            match kernel(model, &plan) {
                Ok(native) => {
                    let of = (model, &plan);
                    let count =
                        compare(&what, (&case, &plan), 0..states, |workspace, input, output| {
                            let answer = native.answer(of, workspace, input, output)?;
                            Some(answer.warnings)
                        });
                    all.answered += count.answered;
                    all.sure += count.sure;
                    all.asked += count.asked;
                    // other states than the single ones
                    let rows = compare_rows(&what, (&case, &plan), states..2 * states, &native);
                    in_rows.answered += rows.answered;
                    in_rows.asked += rows.asked;
                    println!("{what}: {count:?}, in rows {rows:?}; all: {all:?}, {in_rows:?}");
                }
                Err(MakeError::Generate(error)) if is_excused(&error) => {
                    println!("{what}: {error}");
                }
                Err(error) => panic!("{what}: {error}"),
            }
        }
    }
    // both sets of states are of the same kind
    let share = |count: Count| count.answered as f64 / count.asked as f64;
    assert!((share(all) - share(in_rows)).abs() < 0.02, "{all:?}, in rows {in_rows:?}");
    assert!(all.answered * 10 > all.sure * 7, "{all:?}");
}
