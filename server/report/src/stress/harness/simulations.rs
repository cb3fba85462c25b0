//! Settings, starts and references of simulated cases.

use sarrus_dynamics::description::Description;
use sarrus_simulation::{Input, Method, Run, Settings, Setup, Start, simulate};

use crate::Outcome;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::State;
use crate::stress::harness::robot::Robot;
use crate::stress::harness::runs::{Comparison, apart, setup};

/// Samples of a run.
pub(crate) const SAMPLES: f64 = 100.0;

/// Settings of the methods: a fixed step, or tolerances, and a bound on the steps that a user would
/// wait for.
pub(crate) fn settings(method: Method, duration: f64) -> Settings {
    let step = method.is_fixed().then_some(1e-3 * duration);
    Settings {
        step,
        rtol: 1e-12,
        atol: 1e-13,
        every: Some(duration / SAMPLES),
        most_steps: 5_000,
        ..Settings::new(method, duration)
    }
}

/// By the implicit method as exactly as it can.
pub(crate) fn reference_run(setup: &Setup<'_>, start: &Start, like: Settings) -> Outcome<Run> {
    let exact = Settings { rtol: 1e-13, atol: 1e-15, most_steps: 1_000_000, ..like };
    let run = simulate(setup, start, &exact, &mut |_| ())?;
    if run.end.is_finished() {
        Ok(run)
    } else {
        Err(format!("the reference ended as {}", run.end.name()).into())
    }
}

pub(crate) fn from(y: &[f64], yd: &[f64]) -> Start {
    Start::Independent { y: y.to_vec(), yd: yd.to_vec(), guess: None }
}

pub(crate) fn against_reference(
    cases: &mut Cases,
    name: &str,
    value: f64,
    of: Description,
    inputs: &[Input],
) -> Outcome {
    let robot = Robot::new(name, of)?;
    let setup = Setup { inputs, ..setup(&robot) };
    let state = State::of(&robot, 0.1)?;
    let start = from(&state.y, &vec![0.0; state.yd.len()]);
    let reference = reference_run(&setup, &start, settings(Method::Radau5, 1.0))?;
    let comparison =
        Comparison { error: &|run| Ok(apart(run, &reference)), reference: "Radau at 1e-13" };
    every_method(cases, name, value, &setup, &start, &comparison)
}

pub(crate) fn every_method(
    cases: &mut Cases,
    name: &str,
    value: f64,
    setup: &Setup<'_>,
    start: &Start,
    comparison: &Comparison<'_>,
) -> Outcome {
    for method in Method::ALL {
        cases.simulation(
            name,
            At { value, method: method.name() },
            setup,
            start,
            &settings(method, 1.0),
            comparison,
        )?;
    }
    Ok(())
}
