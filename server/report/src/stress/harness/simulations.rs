//! Settings, starts and references of simulated cases.

use sarrus_simulation::{Input, Method, Run, Settings, Start, simulate};

use super::case::{At, Cases};
use super::robot::Robot;
use super::runs::{Trial, setup};
use crate::Outcome;

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
pub(crate) fn reference_run(
    robot: &Robot,
    inputs: &[Input],
    start: &Start,
    like: Settings,
) -> Outcome<Run> {
    let exact = Settings { rtol: 1e-13, atol: 1e-15, most_steps: 1_000_000, ..like };
    let run = simulate(&setup(robot, inputs), start, &exact, &mut |_| ())?;
    if run.end.is_finished() {
        Ok(run)
    } else {
        Err(format!("the reference ended as {}", run.end.name()).into())
    }
}

pub(crate) fn from(y: &[f64], yd: &[f64]) -> Start {
    Start::Independent { y: y.to_vec(), yd: yd.to_vec(), guess: None }
}

impl Trial<'_> {
    /// Simulates one second by every method with its usual settings.
    pub(crate) fn every_method(&self, cases: &mut Cases, value: f64) -> Outcome {
        for method in Method::ALL {
            self.run(cases, At { value, method: method.name() }, &settings(method, 1.0))?;
        }
        Ok(())
    }
}
