//! The answer to a request depends only on the model and the request.

use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Model, PlanScalar, Workspace};
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::plans::{every_plan, has_turn, input, motion};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

/// Bits of a number; every NaN counts as the same.
type Bits = (u64, u64);

/// Asks one in `share` of the plans of single fields, and every other plan.
fn check<T: PlanScalar>(
    case: &Case,
    model: &Model<T>,
    (turn, share): (usize, usize),
    bits: impl Fn(T) -> Bits,
) {
    let mut seeded = Seeded::new(case.seed + 5);
    let mut robot = Robot::new(model.clone());
    let motions = [0, 1].map(|k| motion(&mut robot, &case.state(k)));
    let plans = every_plan(model, &mut seeded).into_iter().enumerate();
    let plans: Vec<_> =
        plans.filter_map(|(k, plan)| has_turn(&plan, k + turn, share).then_some(plan)).collect();
    let jobs: Vec<(usize, Vec<T>)> = (0..plans.len())
        .flat_map(|p| (0..2).map(move |k| (p, k)))
        .map(|(p, k)| {
            let mut numbers = input(case, &plans[p], &motions[k], &mut seeded);
            // some inputs become unreachable or NaN
            match seeded.below(8) {
                0 => numbers.iter_mut().for_each(|x| *x *= T::from_f64(7.0)),
                1 if !numbers.is_empty() => numbers[0] = T::from_f64(f64::INFINITY),
                _ => {}
            }
            (p, numbers)
        })
        .collect();
    let answer = |(p, numbers): &(usize, Vec<T>), workspace: &mut Workspace<T>| {
        let mut output = vec![T::from_f64(0.1); plans[*p].want().len()];
        let status = plans[*p].run(model, workspace, numbers, &mut output);
        (status, output.into_iter().map(&bits).collect::<Vec<_>>())
    };
    let blank = |p: usize| Workspace::for_plans(model, [&plans[p]]);
    let fresh: Vec<_> = jobs.iter().map(|job| answer(job, &mut blank(job.0))).collect();
    let mut workspace = Workspace::new(model);
    for _ in 0..2 {
        for k in seeded.order(jobs.len()) {
            let again = answer(&jobs[k], &mut workspace);
            assert_eq!(again, fresh[k], "{}: {:?}", case.name, plans[jobs[k].0].query());
        }
    }
}

fn of_double(x: f64) -> u64 {
    if x.is_nan() { u64::MAX } else { x.to_bits() }
}

#[test]
fn the_same_request_gets_the_same_bits_whatever_was_asked_before() {
    let cases = robots().iter().take(9).chain(robots().iter().skip(9).step_by(6));
    for (turn, case) in cases.enumerate() {
        check::<f64>(case, &case.compiled.model, (turn, 3), |x| (of_double(x), 0));
        if case.seed % 4 == 0 {
            check::<Dd>(case, &case.compiled.exact, (turn, 6), |x| {
                (of_double(x.hi()), if x.hi().is_nan() { 0 } else { x.lo().to_bits() })
            });
        }
    }
}

#[test]
fn the_same_files_make_the_same_model() {
    for seed in [2, 15, 37, 61] {
        let text = sarrus_tests::random::random_robot(seed);
        let read = || text.load(&sarrus_models::Options::default()).unwrap().compiled;
        let a = read();
        let b = read();
        assert_eq!(a.model.fingerprint(), b.model.fingerprint(), "seed {seed}");
        assert_eq!(format!("{:?}", a.model), format!("{:?}", b.model), "seed {seed}");
    }
}
