//! From a start through a span of time.
//!
//! Each file knows those before it: `events`, `output`, `limits`, `settings`, `setup`, `start`,
//! `switching`, then the two loops over steps, `simulator` in independent coordinates and
//! `tree_coordinates`.

pub(crate) mod events;
pub(crate) mod limits;
pub(crate) mod output;
pub(crate) mod settings;
pub(crate) mod setup;
mod simulator;
pub(crate) mod start;
mod switching;
mod tree_coordinates;

use self::output::{Run, Sample};
use self::settings::{Settings, Stops};
use self::setup::Setup;
use self::simulator::Simulator;
use self::start::Start;
use crate::coordinates::largest;
use crate::error::{Outcome, SimulationError};

/// Simulates. `progress` gets the time that has been reached, after each step. Allocates as
/// samples need it.
///
/// # Errors
/// Invalid starts, settings, inputs or springs. A state without an answer on the way is not an
/// error: the run ends there, reports it, and keeps the samples so far.
pub fn simulate(
    setup: &Setup<'_>,
    start: &Start,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Outcome<Run> {
    if setup.compiled.model.sizes().n_vy == 0 {
        return Err(SimulationError::Rigid);
    }
    settings.check()?;
    let once = |settings: &Settings, halved: bool, progress: &mut dyn FnMut(f64)| {
        let stops = Stops::new(halved);
        if settings.method.is_implicit_form() {
            tree_coordinates::run(setup, start, settings, stops, progress)
        } else {
            Simulator::new(setup, start, settings, stops)?.run(progress)
        }
    };
    let mut run = once(settings, false, progress)?;
    if settings.estimate {
        let (settings, factor) = settings.finer();
        let settings = Settings { duration: run.time.max(f64::MIN_POSITIVE), ..settings };
        let other = once(&settings, true, &mut |_| ())?;
        let gap = |f: fn(&Sample) -> &[f64]| match (run.last(), other.last()) {
            (Some(a), Some(b)) if a.time == b.time => {
                factor * largest(f(a).iter().zip(f(b)).map(|(a, b)| a - b))
            }
            _ => f64::NAN,
        };
        run.error_estimate = Some([gap(|x| &x.y), gap(|x| &x.yd)]);
    }
    Ok(run)
}
