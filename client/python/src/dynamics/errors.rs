//! Errors of robots as exceptions of `sarrus.errors`.

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_client::{Error, LoadError as NotLoaded, Status};
use sarrus_models::Diagnostic;

pyo3::import_exception!(sarrus.errors, ConnectError);
pyo3::import_exception!(sarrus.errors, LoadError);
pyo3::import_exception!(sarrus.errors, QueryError);
pyo3::import_exception!(sarrus.errors, StateError);

/// A state without an answer.
pub(super) fn state_error(status: Status) -> PyErr {
    let words = sarrus_client::FailedState { status }.to_string();
    StateError::new_err((words, status.name(), status as u32))
}

/// A robot that does not answer.
pub(super) fn robot_error(error: Error) -> PyErr {
    let words = error.to_string();
    match error {
        Error::Failed(failed) => state_error(failed.status),
        Error::WrongSize { .. } => PyValueError::new_err(words),
        Error::Connect(_) | Error::ServerGone(..) | Error::NoAnswer { .. } => {
            ConnectError::new_err(words)
        }
        _ => QueryError::new_err(words),
    }
}

/// Files that are no robot: an `OSError` where one cannot be opened, else every fault.
pub(crate) fn load_error(py: Python<'_>, error: NotLoaded) -> PyErr {
    let words = error.to_string();
    match error {
        NotLoaded::Open(file, reason) => not_opened(file, &reason, words),
        NotLoaded::Faults(report) => {
            let faults = report.errors.iter().map(|fault| diagnostic(py, fault).map(Bound::unbind));
            match faults.collect::<PyResult<Vec<_>>>() {
                Ok(faults) => LoadError::new_err((words, faults)),
                Err(error) => error,
            }
        }
        _ => LoadError::new_err((words, Vec::<Py<PyAny>>::new())),
    }
}

/// A file that cannot be opened: with the system's error number if there is one, from which Python
/// chooses `FileNotFoundError` and the like.
fn not_opened(file: String, reason: &str, words: String) -> PyErr {
    let system = reason.strip_suffix(')').and_then(|reason| reason.rsplit_once(" (os error "));
    match system.and_then(|(said, number)| Some((number.parse::<i32>().ok()?, said))) {
        Some((number, said)) => PyOSError::new_err((number, said.to_owned(), file)),
        None => PyOSError::new_err(words),
    }
}

/// A fault with the keys of `sarrus check`.
fn diagnostic<'py>(py: Python<'py>, fault: &Diagnostic) -> PyResult<Bound<'py, PyDict>> {
    Ok(fields!(py, fault => file, line, column, found, expected, help))
}
