//! Rows of states have the bits, statuses and warnings of each state alone.

use std::num::NonZero;
use std::ops::Range;
use std::sync::Arc;

use sarrus_client::{Error, Options, PlanId, Request, Robot as Client, Source};
use sarrus_dynamics::scalar::LANES;
use sarrus_dynamics::{
    Answer, Batch, BatchWorkspace, Field, FieldSet, Layout, Plan, Query, Status, Warnings,
    Workspace,
};
use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT};
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::plans::{every_plan, has_turn, input, motion};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use crate::allocation::calls;

const UNKNOWN: Answer = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };

/// True where lanes round like single doubles; on other targets every state is computed alone.
const FUSED: bool = cfg!(any(
    all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"),
    target_arch = "aarch64"
));

/// Bits of a number; every NaN counts as the same.
fn bits(x: &f64) -> u64 {
    if x.is_nan() { u64::MAX } else { x.to_bits() }
}

/// Rows and answers must be equal bit by bit.
fn compare(what: &str, found: (&[f64], &[Answer]), expected: (&[f64], &[Answer])) {
    assert_eq!(found.1, expected.1, "{what}");
    let n = expected.0.len() / expected.1.len().max(1);
    for row in 0..expected.1.len() {
        let of = |numbers: &[f64]| numbers[row * n..][..n].iter().map(bits).collect::<Vec<_>>();
        assert_eq!(of(found.0), of(expected.0), "{what}, row {row}");
    }
}

/// The rows of each field separately, with the field's count of numbers per row.
fn apart(layout: &Layout, rows: &[f64]) -> Vec<(Vec<f64>, usize)> {
    let rows = || rows.chunks(layout.len().max(1));
    let field = |range: Range<usize>| rows().flat_map(|row| row[range.clone()].to_vec()).collect();
    layout.slots().iter().map(|slot| (field(slot.range()), slot.range().len())).collect()
}

/// The motions of the first states of a robot.
fn motions(case: &Case, n: usize) -> Vec<Fields<f64>> {
    let mut robot = Robot::new(case.compiled.model.clone());
    (0..n).map(|k| motion(&mut robot, &case.state(k as u64))).collect()
}

/// A row for each motion; if `astray`, some are far away, unreachable or NaN.
fn rows(
    case: &Case,
    plan: &Plan,
    motions: &[Fields<f64>],
    astray: bool,
    seeded: &mut Seeded,
) -> Vec<f64> {
    let mut rows = Vec::new();
    for motion in motions {
        let mut row = input(case, plan, motion, seeded);
        match seeded.below(12) {
            0 if astray => row.iter_mut().for_each(|x| *x *= 7.0),
            1 if astray => row.iter_mut().for_each(|x| *x *= 1e3),
            2 if astray && !row.is_empty() => {
                let k = seeded.below(row.len());
                row[k] = [f64::NAN, f64::INFINITY, 1e300, 1e17][seeded.below(4)];
            }
            3 if astray => row.fill(0.0),
            _ => {}
        }
        rows.append(&mut row);
    }
    rows
}

/// Answers each row alone.
fn alone(case: &Case, plan: &Plan, input: &[f64], n: usize) -> (Vec<f64>, Vec<Answer>) {
    let model = &case.compiled.model;
    let mut workspace = Workspace::for_plans(model, [plan]);
    let n_in = plan.given().len();
    let n_out = plan.want().len();
    let mut output = vec![0.1; n * n_out];
    let run = |row: usize| {
        let output = &mut output[row * n_out..][..n_out];
        plan.run(model, &mut workspace, &input[row * n_in..][..n_in], output)
    };
    let answers = (0..n).map(run).collect();
    (output, answers)
}

#[test]
fn states_abreast_have_the_bits_that_each_has_alone() {
    let mut abreast = 0;
    let n = 3 * LANES + 1;
    let cases = robots().iter().take(24).chain(robots().iter().skip(24).step_by(12));
    for (turn, case) in cases.enumerate() {
        let model = Arc::new(case.compiled.model.clone());
        let mut seeded = Seeded::new(case.seed + 9);
        let motions = motions(case, n);
        // one workspace for every plan, as in a server
        let mut any = BatchWorkspace::new(&model, MAX_NUMBERS_IN, MAX_NUMBERS_OUT);
        for (k, plan) in every_plan(&*model, &mut seeded).into_iter().enumerate() {
            if !has_turn(&plan, k + turn, 8) {
                continue;
            }
            let mut batch = Batch::new(&model, &plan);
            // plans without lanes are covered by a few of them
            if batch.lanes() == 1 && seeded.below(20) > 0 {
                continue;
            }
            abreast += usize::from(batch.lanes() > 1);
            let given = rows(case, &plan, &motions, true, &mut seeded);
            let (expected, answers) = alone(case, &plan, &given, n);
            let mut output = vec![0.2; expected.len()];
            let mut found = vec![UNKNOWN; n];
            let before = calls();
            batch.run(&given, &mut output, &mut found);
            assert_eq!(calls(), before, "{}: {:?}", case.name, plan.query());
            let what = format!("{}, seed {}: {:?}", case.name, case.seed, plan.query());
            compare(&what, (&output, &found), (&expected, &answers));
            if plan.want().len() <= MAX_NUMBERS_OUT {
                found.fill(UNKNOWN);
                let before = calls();
                any.run(&plan, &given, &mut output, &mut found);
                assert_eq!(calls(), before, "{what}");
                compare(&what, (&output, &found), (&expected, &answers));
            }
            // fields in separate arrays
            let given_apart = apart(plan.given(), &given);
            let mut want_apart = apart(plan.want(), &vec![0.2; expected.len()]);
            let given_apart: Vec<_> = given_apart.iter().map(|(x, n)| (&x[..], *n)).collect();
            let mut want: Vec<_> = want_apart.iter_mut().map(|(x, n)| (&mut x[..], *n)).collect();
            found.fill(UNKNOWN);
            let before = calls();
            batch.run_fields(&given_apart, &mut want, &mut found);
            assert_eq!(calls(), before, "{what}");
            assert_eq!(found, answers, "{what}, apart");
            for (found, expected) in want_apart.iter().zip(apart(plan.want(), &expected)) {
                let of = |numbers: &[f64]| numbers.iter().map(bits).collect::<Vec<_>>();
                assert_eq!(of(&found.0), of(&expected.0), "{what}, apart");
            }
            // no answer has a negative zero, failed ones included
            let negative = |x: &f64| x.to_bits() == (-0.0_f64).to_bits();
            assert!(!expected.iter().any(negative), "{what}: {expected:?}");
            // the same workspace again: a tile with a NaN, then the rows in reverse order
            let n_in = plan.given().len();
            let n_out = plan.want().len();
            let order: Vec<usize> = (0..n).rev().collect();
            let mut again = vec![f64::NAN; LANES * n_in];
            order.iter().for_each(|row| again.extend(&given[row * n_in..][..n_in]));
            let mut output = vec![0.2; (LANES + n) * n_out];
            let mut found = vec![UNKNOWN; LANES + n];
            batch.run(&again, &mut output, &mut found);
            let in_order = |row: &usize| expected[row * n_out..][..n_out].to_vec();
            let expected: Vec<f64> = order.iter().flat_map(in_order).collect();
            let answers: Vec<Answer> = order.iter().map(|row| answers[*row]).collect();
            compare(&what, (&output[LANES * n_out..], &found[LANES..]), (&expected, &answers));
        }
    }
    assert!(!FUSED || abreast > 1000, "{abreast} plans only");
}

#[test]
fn most_states_of_bundled_robots_are_answered_abreast() {
    // the last three have closures by Newton's method
    let robots = ["lambda", "torso", "ankle", "stewart", "rh5v2_upper_body"];
    for name in robots.into_iter().chain(["wrist", "delta", "rh5v2_full"]) {
        let case = Case::bundled(name);
        let model = Arc::new(case.compiled.model.clone());
        let mut seeded = Seeded::new(case.seed);
        let motion = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
        let forces = FieldSet::of(&[Field::TauU]);
        let query = Query::new(Request::InverseDynamics, motion, forces);
        let plan = Plan::new(&model, &query).unwrap();
        let mut batch = Batch::new(&model, &plan);
        assert_eq!(batch.lanes(), if FUSED { LANES } else { 1 }, "{name}");
        let n = 64 * LANES;
        let given = rows(&case, &plan, &motions(&case, n), false, &mut seeded);
        let mut output = vec![0.0; n * plan.want().len()];
        let mut found = vec![UNKNOWN; n];
        batch.run(&given, &mut output, &mut found);
        assert!(!FUSED || batch.alone() < n as u64 / 4, "{name}: {} of {n} alone", batch.alone());
    }
}

#[test]
fn a_plan_of_another_model_is_refused_row_by_row() {
    let [large, small] = ["rh5v2_upper_body", "lambda"].map(Case::bundled);
    for (of, other) in [(&large, &small), (&small, &large)] {
        let model = Arc::new(other.compiled.model.clone());
        for plan in every_plan(&of.compiled.model, &mut Seeded::new(3)) {
            let mut batch = Batch::new(&model, &plan);
            let n = LANES + 1;
            let mut output = vec![0.2; n * plan.want().len()];
            let mut found = vec![UNKNOWN; n];
            batch.run(&vec![0.1; n * plan.given().len()], &mut output, &mut found);
            assert!(found.iter().all(|answer| answer.status == Status::WrongModel));
            assert!(output.iter().all(|x| x.is_nan()));
        }
    }
}

#[test]
fn rows_of_the_wrong_size_are_refused() {
    let case = Case::bundled("lambda");
    let model = Arc::new(case.compiled.model.clone());
    let plan = every_plan(&*model, &mut Seeded::new(1)).swap_remove(0);
    let mut batch = Batch::new(&model, &plan);
    let mut output = vec![0.0; 3 * plan.want().len()];
    let mut found = vec![UNKNOWN; 3];
    batch.run(&vec![0.0; 3 * plan.given().len() + 1], &mut output, &mut found);
    assert!(found.iter().all(|answer| answer.status == Status::WrongSize));
    assert!(output.iter().all(|x| x.is_nan()));
    // separate fields: one lacks a number, one has another field's length
    let n_in = plan.given().len();
    let n_out = plan.want().len();
    let numbers = vec![0.0; 3 * (n_in + 1)];
    for given in [(&numbers[..3 * n_in - 1], n_in), (&numbers[..], n_in + 1)] {
        (output, found) = (vec![0.0; 3 * n_out], vec![UNKNOWN; 3]);
        batch.run_fields(&[given], &mut [(&mut output[..], n_out)], &mut found);
        assert!(found.iter().all(|answer| answer.status == Status::WrongSize));
        assert!(output.iter().all(|x| x.is_nan()));
    }
}

#[test]
fn batches_of_a_robot_depend_on_no_thread() {
    for name in ["rh5v2_upper_body", "wrist"] {
        let case = Case::bundled(name);
        let options = Options::default();
        let mut robot = Client::load(&Source::Bundled(name.into()), &options).unwrap();
        let query = robot.query(Request::InverseDynamics).given(["y", "yd", "ydd"]);
        let id: PlanId = query.want(["tau_u", "q"]).prepare().unwrap();
        let prepared = robot.plan(id).unwrap().clone();
        let plan = Plan::new(&case.compiled.model, prepared.query()).unwrap();
        let n = 1100;
        let motions = motions(&case, n);
        let given = rows(&case, &plan, &motions, true, &mut Seeded::new(case.seed));
        let (expected, answers) = alone(&case, &plan, &given, n);
        for threads in [1, 2, 3, 2] {
            let mut output = vec![0.2; expected.len()];
            let mut found = vec![UNKNOWN; n];
            let threads = NonZero::new(threads).unwrap();
            robot.batch(id, threads, &given, &mut output, &mut found).unwrap();
            compare(name, (&output, &found), (&expected, &answers));
        }
        robot.release(id).unwrap();
        let mut output = vec![0.2; expected.len()];
        let mut found = vec![UNKNOWN; n];
        let outcome = robot.batch(id, NonZero::<usize>::MIN, &given, &mut output, &mut found);
        assert!(matches!(outcome, Err(Error::ReleasedPlan | Error::UnknownPlan)));
        assert!(output.iter().all(|x| x.is_nan()));
    }
}
