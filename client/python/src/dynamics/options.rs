//! Words of a call that Python checks before anything is done.

use std::num::NonZero;

use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

/// The number of threads; `None` if not given.
pub(super) fn threads(object: &Bound<'_, PyAny>) -> PyResult<Option<NonZero<usize>>> {
    if object.is_none() {
        return Ok(None);
    }
    match within(object)?.and_then(NonZero::new) {
        Some(threads) => Ok(Some(threads)),
        None => Err(wrong("threads", object, "1 or more")),
    }
}

/// The fingerprint of a model; `None` where any will do.
pub(super) fn fingerprint(object: &Bound<'_, PyAny>) -> PyResult<Option<u64>> {
    if object.is_none() {
        return Ok(None);
    }
    match within(object)? {
        Some(fingerprint) => Ok(Some(fingerprint)),
        None => {
            Err(wrong("fingerprint", object, "a number of 64 bits such as `Robot.fingerprint`"))
        }
    }
}

/// The callback for progress; `None` if not given.
pub(super) fn progress(object: &Bound<'_, PyAny>) -> PyResult<Option<Py<PyAny>>> {
    if object.is_none() {
        return Ok(None);
    }
    if !object.is_callable() {
        let words = format!("`progress` is {}, expected a function", object.repr()?);
        return Err(PyTypeError::new_err(words));
    }
    Ok(Some(object.clone().unbind()))
}

/// A whole number; `None` where it is beyond its type.
fn within<'py, T: FromPyObjectOwned<'py, Error = PyErr>>(
    object: &Bound<'py, PyAny>,
) -> PyResult<Option<T>> {
    match object.extract::<T>() {
        Ok(number) => Ok(Some(number)),
        Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => Ok(None),
        Err(error) => Err(error),
    }
}

fn wrong(name: &str, found: &Bound<'_, PyAny>, expected: &str) -> PyErr {
    PyValueError::new_err(format!("`{name}` is {found}, expected {expected}"))
}
