//! A robot in time, as arrays.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_models::Loaded;
use sarrus_simulation::{
    EventKind, Input, Method, Run, Sample, Settings, Setup, Source, Space, Start, simulate,
};

use super::arrays::zeros;

/// Between two looks for signals.
const LOOK: Duration = Duration::from_millis(50);

/// The forces on the joints: constants, tables and gains, each with true where it acts on
/// actuators.
pub(super) type Inputs = (
    Vec<(bool, Vec<f64>)>,
    Vec<(bool, Vec<f64>, Vec<Vec<f64>>)>,
    Vec<(bool, Vec<f64>, Vec<f64>, Vec<f64>)>,
);

/// Method, duration, step, time between samples, tolerances, friction, limits, stops.
pub(super) type Parts = (String, f64, Option<f64>, Option<f64>, f64, f64, bool, bool, Option<f64>);

/// The end of a simulation, its time, the drift of its energy, the independents at the end, and the
/// events.
pub(super) type Simulated = (&'static str, f64, f64, Vec<String>, Vec<(f64, String)>);

/// An exception of Python on its way through the integrator, whose callback cannot stop it.
struct Interrupted(PyErr);

/// Simulates; Python's other threads run meanwhile.
pub(super) fn run<'py>(
    py: Python<'py>,
    loaded: &Loaded,
    (y, yd): (Vec<f64>, Vec<f64>),
    inputs: Inputs,
    (method, duration, step, every, rtol, atol, friction, limited, stops): Parts,
    progress: Option<&Py<PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Simulated)> {
    let known = Method::ALL.into_iter().find(|known| known.name() == method);
    let method = known.ok_or_else(|| {
        let names = Method::ALL.map(Method::name).join(", ");
        PyValueError::new_err(format!("no method `{method}`, expected one of {names}"))
    })?;
    let usual = Settings::new(method, duration);
    let settings = Settings { step, every, rtol, atol, friction, limited, stops, ..usual };
    let start = Start::Independent { y, yd, guess: None };
    let inputs = inputs_of(inputs);
    let Loaded { description, compiled, .. } = loaded;
    let setup = Setup { description, compiled, springs: &[], inputs: &inputs };

    // signals and the callback now and then; their exceptions unwind the integrator
    let mut last = Instant::now();
    let mut look = |time: f64| {
        if last.elapsed() < LOOK {
            return;
        }
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            progress.map_or(Ok(()), |progress| progress.call1(py, (time, duration)).map(drop))
        });
        last = Instant::now();
        if let Err(error) = outcome {
            resume_unwind(Box::new(Interrupted(error)));
        }
    };
    let run = py.detach(|| {
        catch_unwind(AssertUnwindSafe(|| simulate(&setup, &start, &settings, &mut look)))
    });
    let run = match run {
        Ok(run) => run.map_err(|error| PyValueError::new_err(error.to_string()))?,
        Err(payload) => match payload.downcast::<Interrupted>() {
            Ok(interrupted) => return Err(interrupted.0),
            Err(other) => resume_unwind(other),
        },
    };
    let beyond = run.exceeded(compiled.model.info());
    let beyond = beyond.iter().map(|of| (of.since, format!("{} of {}", of.what, of.name)));
    let beyond = beyond.map(|(since, what)| (since, format!("limits_exceeded: {what}")));
    let events = run.events.iter().map(|event| (event.time, word(&event.kind).to_owned()));
    let mut events: Vec<_> = events.chain(beyond).collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let simulated = (run.end.name(), run.time, run.drift(), run.independents.clone(), events);
    Ok((arrays(py, &run)?, simulated))
}

fn inputs_of((constants, tables, gains): Inputs) -> Vec<Input> {
    let space = |actuators| if actuators { Space::Actuator } else { Space::Independent };
    let mut inputs = Vec::new();
    for (actuators, forces) in constants {
        inputs.push(Input { space: space(actuators), source: Source::Constant(forces) });
    }
    for (actuators, times, forces) in tables {
        inputs.push(Input { space: space(actuators), source: Source::Table { times, forces } });
    }
    for (actuators, stiffness, damping, target) in gains {
        let source = Source::Gains { stiffness, damping, target };
        inputs.push(Input { space: space(actuators), source });
    }
    inputs
}

fn word(kind: &EventKind) -> &'static str {
    match kind {
        EventKind::Switched { .. } => "switched",
        EventKind::NotSwitched { .. } => "not_switched",
        EventKind::Shortened(_) => "shortened",
        EventKind::NearSingular(_) => "near_singular",
        EventKind::Limited(_) => "limited",
        EventKind::Stopped(_) => "stopped",
        EventKind::Stiff => "stiff",
        _ => "other",
    }
}

/// The samples, a row each.
fn arrays<'py>(py: Python<'py>, run: &Run) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let samples = &run.samples;
    for (name, number) in Sample::FIGURES {
        let array = zeros::<f64>(py, &[samples.len()])?.cast_into::<PyArray1<f64>>()?;
        for (place, sample) in array.try_readwrite()?.as_slice_mut()?.iter_mut().zip(samples) {
            *place = number(sample);
        }
        dict.set_item(name, array)?;
    }
    for (name, field) in Sample::STATES {
        let width = samples.first().map_or(0, |sample| field(sample).len());
        let array = zeros::<f64>(py, &[samples.len(), width])?.cast_into::<PyArray2<f64>>()?;
        let numbers = samples.iter().flat_map(field);
        for (place, number) in array.try_readwrite()?.as_slice_mut()?.iter_mut().zip(numbers) {
            *place = *number;
        }
        dict.set_item(name, array)?;
    }
    Ok(dict)
}
