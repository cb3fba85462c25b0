//! Energy over many steps.

use sarrus_simulation::{Method, Settings};

use super::problems::{Problem, own};
use crate::Outcome;
use crate::measure::Effort;
use crate::page::{Axis, Figure, Point, Series, exponent};

/// Steps of a full and of a quick report, and the length of each `[s]`.
const STEPS: [u32; 2] = [1_000_000, 20_000];
const STEP: f64 = 1e-3;
/// Samples of each run.
const SAMPLES: u32 = 200;

/// The lambda swings freely under gravity, without dissipation: picture and sentence.
pub(super) fn energy(effort: &Effort) -> Outcome<(Figure, String)> {
    let steps = STEPS[usize::from(effort.quick)];
    let duration = f64::from(steps) * STEP;
    let mut lambda = Problem::new("energy", "Energy", &own("lambda"), [duration, STEP])?;
    lambda.y[0] = 0.3;
    let mut series = Vec::new();
    let mut reported = Vec::new();
    for method in Method::ALL.into_iter().filter(|method| !method.is_implicit_form()) {
        let step = method.is_fixed().then_some(STEP);
        let every = Some(duration / f64::from(SAMPLES));
        let run = lambda.run(&Settings { step, every, ..lambda.adaptive(method, 1e-11) })?;
        let Some(first) = run.samples.first() else { continue };
        let size = run.samples.iter().map(|sample| sample.energy.kinetic).fold(0.0, f64::max);
        let points = run.samples.iter().skip(1).map(|sample| Point {
            x: sample.time,
            y: (sample.balance() - first.balance()).abs() / size,
            label: String::new(),
        });
        reported.push(format!(
            "{} {} in {} steps",
            method.name(),
            exponent(run.drift()),
            run.counts.steps
        ));
        series.push(Series {
            name: method.name().into(),
            line: true,
            competes: false,
            points: points.collect(),
        });
    }
    let figure = Figure {
        id: "integration-energy".into(),
        title: format!("Energy of a lambda that swings freely, {steps} steps of 1 ms"),
        caption: "Change of the energy since the start as a share of the largest kinetic energy. \
            The methods with their own step have a tolerance of 1e-11."
            .into(),
        x: Axis::log("time simulated, s"),
        y: Axis::log("relative change of energy"),
        series,
    };
    Ok((
        figure,
        format!("Energy drift of a free lambda over {duration} s: {}", reported.join(", ")),
    ))
}
