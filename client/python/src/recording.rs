//! Recordings of servers, for Python: the robot, and the poses that clients asked about.

use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use sarrus_client::{Field, Layout, Request, Status};
use sarrus_serve::record::{Client, Entry, Recording, RecordingError, complete};

use crate::dynamics::{PyOrigin, load_error};

/// A request: seconds from the start of the recording, client, request, status, and the coordinates
/// that it is about, `y`, `u` or `q`.
type Asked = (f64, String, &'static str, &'static str, &'static str, Vec<f64>);

/// The robot of a recording, and its requests: every one without an answer, and of the others one
/// of each client in each `step` seconds. A file that cannot be read is an `OSError`, one that is
/// no recording a `ValueError`.
#[pyfunction]
pub(crate) fn recording(
    py: Python<'_>,
    path: PathBuf,
    step: f64,
) -> PyResult<(PyOrigin, Vec<Asked>)> {
    // the last records of a killed server, as far as they are there
    let _ = complete(&path);
    let unreadable = |error| failed(&path, error);
    let file = File::open(&path).map_err(|source| unreadable(source.into()))?;
    let mut recording = Recording::open(file).map_err(unreadable)?;
    let loaded = py.detach(|| recording.robot().load()).map_err(|error| load_error(py, error))?;
    let model = loaded.compiled.model.info();
    if model.fingerprint != recording.fingerprint() {
        let [found, expected] = [model.fingerprint, recording.fingerprint()];
        return Err(unreadable(RecordingError::WrongModel { found, expected }));
    }
    let coordinates = |entry: &Entry<'_>| {
        let query = entry.query?;
        let given = Layout::of_given(&query, &model.sizes);
        let slots =
            [Field::Y, Field::U, Field::Q].into_iter().filter_map(|field| given.slot(field));
        let slot = slots.into_iter().next()?;
        let request = Request::from_code(query.request)?.name();
        Some((request, slot.field, entry.input.get(slot.range())?.to_vec()))
    };
    let mut list = Vec::new();
    let mut kept: HashMap<Client, f64> = HashMap::new();
    let each = |entry: &Entry<'_>, _: f64| {
        let seconds = 1e-9 * entry.time_ns as f64;
        let next = kept.get(&entry.client).map_or(f64::NEG_INFINITY, |last| last + step);
        let status = entry.status();
        let Some((request, field, numbers)) = coordinates(entry) else { return };
        if status != Status::Ok || seconds >= next {
            kept.insert(entry.client, seconds);
            let client = entry.client.to_string();
            list.push((seconds, client, request, status.name(), field.name(), numbers));
        }
    };
    recording.read(each).map_err(unreadable)?;
    Ok((PyOrigin::recorded(recording.robot())?, list))
}

fn failed(path: &Path, error: RecordingError) -> PyErr {
    let words = format!("{}: {error}", path.display());
    match error {
        RecordingError::Read(_) => PyOSError::new_err(words),
        _ => PyValueError::new_err(words),
    }
}
