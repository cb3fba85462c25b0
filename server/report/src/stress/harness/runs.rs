//! One simulation as a case: settings, starts, references.

use sarrus_simulation::{EventKind, Input, Method, Run, Settings, Setup, Start, simulate};

use super::assess::HELD;
use super::case::{At, Case, Cases};
use super::robot::Robot;
use crate::Outcome;
use crate::page::Assessment;
use crate::reference::by_size;

/// Samples of a run.
pub(crate) const SAMPLES: f64 = 100.0;

/// Settings of the methods: a fixed step, or tolerances, and a bound on the number of steps.
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

/// By the implicit method at its highest accuracy.
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

/// Least ratio of estimate to error at which an estimate counts as a report of the error.
const TELLS: f64 = 0.1;

/// A robot to simulate from a start, and its reference.
pub(crate) struct Trial<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) inputs: &'a [Input],
    pub(crate) start: Start,
    /// The largest error by size over all samples.
    pub(crate) error: &'a dyn Fn(&Run) -> Outcome<f64>,
    /// The source of the reference.
    pub(crate) reference: &'static str,
}

/// A robot with these inputs and its own springs and dampers.
fn setup<'a>(robot: &'a Robot, inputs: &'a [Input]) -> Setup<'a> {
    Setup { description: &robot.description, compiled: &robot.compiled, springs: &[], inputs }
}

/// The largest difference of y over the samples of two runs that sample at the same times, by size.
pub(crate) fn apart(run: &Run, reference: &Run) -> f64 {
    if run.samples.len() < reference.samples.len() {
        return f64::INFINITY;
    }
    let samples = run.samples.iter().zip(&reference.samples);
    let pairs = samples.flat_map(|(run, reference)| {
        run.y.iter().zip(&reference.y).map(|(x, reference)| (x - reference, *reference))
    });
    by_size(pairs, 0.0)
}

impl Trial<'_> {
    /// Simulates one second by every method with its usual settings.
    pub(crate) fn every_method(&self, cases: &mut Cases, value: f64) -> Outcome {
        for method in Method::ALL {
            self.run(cases, At { value, method: method.name() }, &settings(method, 1.0))?;
        }
        Ok(())
    }

    /// Simulates with an estimate of the error and assesses. Held: like any answer. Degraded,
    /// reported: the run's own estimate or its energy has the size of the error. Failed, reported:
    /// the run stops with a status or does not start.
    pub(crate) fn run(&self, cases: &mut Cases, at: At<'_>, settings: &Settings) -> Outcome {
        let settings = Settings { estimate: true, ..*settings };
        let setup = setup(self.robot, self.inputs);
        let run = match simulate(&setup, &self.start, &settings, &mut |_| ()) {
            Ok(run) => run,
            Err(error) => {
                let error = error.to_string();
                cases.refused(&self.robot.name, at, "simulation", "refused at start", error);
                return Ok(());
            }
        };
        let finished = run.end.is_finished();
        let error = if finished { Some((self.error)(&run)?) } else { None };
        let size = run
            .samples
            .iter()
            .flat_map(|sample| &sample.y)
            .fold(f64::MIN_POSITIVE, |size: f64, y| size.max(y.abs()));
        let estimate = run.error_estimate.map_or(0.0, |[y, _]| y / size);
        let warned = tells(estimate, error) || tells(run.drift(), error);
        let assessment = match error {
            None => Assessment::Failed,
            Some(error) if error <= HELD => Assessment::Held,
            Some(_) if warned => Assessment::Degraded,
            Some(_) => Assessment::FailedSilently,
        };
        let mut reported =
            vec![format!("error estimate {estimate:.1e}, energy drift {:.1e}", run.drift())];
        if run.correction[0] > 0.0 {
            reported.push(format!("start moved by {:.1e}", run.correction[0]));
        }
        if run.events.iter().any(|event| event.kind == EventKind::Stiff) {
            reported.push("the problem is stiff for this method".to_owned());
        }
        if !finished {
            reported.push(format!("at {:.3e} of {:.3e} s", run.time, settings.duration));
        }
        cases.all.push(Case {
            status: run.end.name().to_owned(),
            error,
            reference: self.reference,
            reported: reported.join(", "),
            assessment,
            ..cases.blank(&self.robot.name, at, "simulation")
        });
        Ok(())
    }
}

/// True if a run's estimate is about as large as its error or as the answer, or is not finite.
fn tells(figure: f64, error: Option<f64>) -> bool {
    error.is_some_and(|error| !figure.is_finite() || figure >= (TELLS * error).min(1.0))
}
