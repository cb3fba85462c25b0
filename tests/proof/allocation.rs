//! Nothing allocates after set-up: the allocator itself counts calls per thread.
#![allow(unsafe_code, reason = "a global allocator is unsafe by its trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Compiled, Field, Model, PlanScalar, Status, Workspace};
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::plans::{every_plan, has_turn, input, motion};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

thread_local! {
    // a constant initial value and no destructor, so that the counter does not allocate
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Counts the calls of the thread that makes them.
struct Counting;

// SAFETY: every call goes to the system's allocator unchanged; the counter is a plain number of the
// calling thread.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.with(|calls| calls.set(calls.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        CALLS.with(|calls| calls.set(calls.get() + 1));
        // SAFETY: the block came from `System.alloc` with this layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Calls of the allocator by this thread.
pub(crate) fn calls() -> u64 {
    CALLS.with(Cell::get)
}

#[test]
fn the_counter_counts() {
    let before = calls();
    drop(std::hint::black_box(vec![1.0; 10]));
    assert_eq!(calls() - before, 2);
}

/// Runs one in `share` of the plans of single fields, and of these one in three with bad inputs.
fn run_all<T: PlanScalar>(
    case: &Case,
    model: &Model<T>,
    (turn, share): (usize, usize),
) -> Vec<Status> {
    let mut seeded = Seeded::new(case.seed);
    let mut robot = Robot::new(model.clone());
    let mut workspace = Workspace::new(model);
    let state = case.state::<T>(0);
    let mut far = state.clone();
    far.y
        .iter_mut()
        .zip(model.independent_q_names())
        .filter(|(_, name)| !name.contains('/'))
        .for_each(|(y, _)| *y = T::from_f64(2.7));
    let motion = motion(&mut robot, &state);
    let mut seen = Vec::new();
    for (k, plan) in every_plan(model, &mut seeded).iter().enumerate() {
        if !has_turn(plan, k + turn, share) {
            continue;
        }
        let good = input(case, plan, &motion, &mut seeded);
        let mut inputs = vec![good.clone(), vec![]];
        let is_bad = has_turn(plan, (k + turn) / share, 3);
        if is_bad {
            inputs.push(good.iter().map(|x| *x * T::from_f64(40.0)).collect());
        }
        if is_bad && plan.given().slot(Field::Y).is_some() {
            let mut beyond = good.clone();
            beyond[plan.given().slot(Field::Y).unwrap().range()].copy_from_slice(&far.y);
            inputs.push(beyond);
        }
        if let Some(first) = good.first() {
            let mut broken = good.clone();
            broken[0] = *first + T::from_f64(f64::NAN);
            inputs.push(broken);
        }
        let mut output = vec![T::ZERO; plan.want().len()];
        for input in &inputs {
            let before = calls();
            let answer = plan.run(model, &mut workspace, input, &mut output);
            let after = calls();
            assert_eq!(after, before, "{} in {:?}: {:?}", answer.status, case.name, plan.query());
            seen.push(answer.status);
        }
    }
    seen
}

#[test]
fn no_request_allocates_whatever_it_asks_and_however_it_ends() {
    let mut seen = Vec::new();
    let cases = robots().iter().take(9).chain(robots().iter().skip(9).step_by(8));
    for (turn, case) in cases.enumerate() {
        let Compiled { model, exact, .. } = &case.compiled;
        seen.extend(run_all(case, model, (turn, 1)));
        if case.seed % 3 == 0 {
            seen.extend(run_all::<Dd>(case, exact, (turn, 6)));
        }
    }
    for status in Status::ALL {
        println!("{status}: {}", seen.iter().filter(|x| *x == status).count());
    }
    for status in [Status::Ok, Status::NonFiniteInput, Status::WrongSize, Status::BadRequest] {
        assert!(seen.contains(&status), "no request ended with {status}");
    }
}
