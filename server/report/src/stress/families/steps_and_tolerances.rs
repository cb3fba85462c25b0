//! Steps from too long to short, tolerances from none to all.

use sarrus_simulation::{Method, Settings};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::harness::runs::{Comparison, apart, setup};
use crate::stress::harness::simulations::{from, reference_run, settings};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::rods;

/// Fixed steps from too long to short, tolerances from none to all.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    for name in ["pendulum", "lambda", "four_bars_2"] {
        let robot = Robot::new(name, if name == "pendulum" { rods(1)? } else { bundled(name)? })?;
        let start = from(&[0.3], &[1.0]);
        // compared at the end alone: samples on the way would shorten the steps
        let reference = reference_run(
            &setup(&robot),
            &start,
            Settings { every: Some(1.0), ..settings(Method::Radau5, 1.0) },
        )?;
        let comparison =
            Comparison { error: &|run| Ok(apart(run, &reference)), reference: "Radau at 1e-13" };
        cases.family("step", "s");
        for method in [Method::Euler, Method::RungeKutta] {
            for value in sweep(effort, -4, 0, 4) {
                let settings = Settings {
                    step: Some(value),
                    every: Some(1.0),
                    most_steps: 20_000,
                    ..settings(method, 1.0)
                };
                cases.simulation(
                    name,
                    At { value, method: method.name() },
                    &setup(&robot),
                    &start,
                    &settings,
                    &comparison,
                )?;
            }
        }
        cases.family("tolerance", "relative and absolute tolerance");
        for method in [Method::Dop853, Method::Radau5] {
            for value in sweep(effort, -13, -1, 4) {
                let settings = Settings {
                    rtol: value,
                    atol: value,
                    every: Some(1.0),
                    ..settings(method, 1.0)
                };
                cases.simulation(
                    name,
                    At { value, method: method.name() },
                    &setup(&robot),
                    &start,
                    &settings,
                    &comparison,
                )?;
            }
        }
    }
    Ok(())
}
