//! One simulation as a case.

use sarrus_simulation::{EventKind, Run, Settings, Setup, Start, simulate};

use super::assess::HELD;
use super::case::{At, Case, Cases};
use super::robot::Robot;
use crate::Outcome;
use crate::page::Assessment;

/// Least ratio of estimate to error at which an estimate counts as a report of the error.
const TELLS: f64 = 0.1;

/// The reference of a simulation.
pub(crate) struct Comparison<'a> {
    /// The largest error by size over all samples.
    pub(crate) error: &'a dyn Fn(&Run) -> Outcome<f64>,
    /// Where the reference comes from.
    pub(crate) reference: &'static str,
}

/// A robot with nothing on it but its own springs and dampers.
pub(crate) fn setup(robot: &Robot) -> Setup<'_> {
    Setup { description: &robot.description, compiled: &robot.compiled, springs: &[], inputs: &[] }
}

/// The largest difference of y over the samples of two runs that sample at the same times, by size.
pub(crate) fn apart(run: &Run, reference: &Run) -> f64 {
    let mut worst: f64 = 0.0;
    let mut size: f64 = f64::MIN_POSITIVE;
    for (a, b) in run.samples.iter().zip(&reference.samples) {
        for (x, reference) in a.y.iter().zip(&b.y) {
            let off = (x - reference).abs();
            worst = if off.is_nan() { f64::INFINITY } else { worst.max(off) };
            size = size.max(reference.abs());
        }
    }
    if run.samples.len() < reference.samples.len() { f64::INFINITY } else { worst / size }
}

impl Cases {
    /// Simulates with an estimate of the error and assesses. Held: like any answer. Degraded,
    /// reported: the run's own estimate or its energy has the size of the error. Failed, reported:
    /// the run stops with a status or does not start.
    pub(crate) fn simulation(
        &mut self,
        name: &str,
        at: At<'_>,
        setup: &Setup<'_>,
        start: &Start,
        settings: &Settings,
        by: &Comparison<'_>,
    ) -> Outcome {
        let settings = Settings { estimate: true, ..*settings };
        let run = match simulate(setup, start, &settings, &mut |_| ()) {
            Ok(run) => run,
            Err(error) => {
                let status = "refused at start".to_owned();
                let reported = error.to_string();
                let case = Case {
                    status,
                    reported,
                    assessment: Assessment::Failed,
                    reference: "-",
                    ..self.blank(name, at, "simulation")
                };
                self.all.push(case);
                return Ok(());
            }
        };
        let finished = run.end.is_finished();
        let error = if finished { Some((by.error)(&run)?) } else { None };
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
        reported.extend(
            run.events
                .iter()
                .any(|event| event.kind == EventKind::Stiff)
                .then(|| "the problem is stiff for this method".to_owned()),
        );
        if !finished {
            reported.push(format!("at {:.3e} of {:.3e} s", run.time, settings.duration));
        }
        let case = Case {
            status: run.end.name().to_owned(),
            error,
            reference: by.reference,
            reported: reported.join(", "),
            assessment,
            ..self.blank(name, at, "simulation")
        };
        self.all.push(case);
        Ok(())
    }
}

/// True where a run's estimate is about as large as its error or as the answer, or is not finite.
fn tells(figure: f64, error: Option<f64>) -> bool {
    error.is_some_and(|error| !figure.is_finite() || figure >= (TELLS * error).min(1.0))
}
