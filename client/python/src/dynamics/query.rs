//! A prepared query as Python sees it; `sarrus.Query` gives its fields their names.

use std::num::NonZero;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sarrus_client::Layout;

use super::arrays::shape;
use super::asked::{Answered, Asked, BatchOptions};
use super::options::{progress, threads};

/// Fields that come out, the status and the warnings of an answer: numbers for one state, arrays
/// for rows.
type Answer<'py> = (Bound<'py, PyTuple>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// A query that was prepared with a robot.
#[pyclass(name = "Query", module = "sarrus._native", frozen)]
pub(crate) struct PyQuery(pub(super) Asked);

#[pymethods]
impl PyQuery {
    /// Names and shapes of the fields that go in, in their order.
    #[getter]
    fn given(&self) -> Vec<(&'static str, Vec<usize>)> {
        fields(&self.0.given)
    }

    /// Names and shapes of the fields that come out, in their order.
    #[getter]
    fn want(&self) -> Vec<(&'static str, Vec<usize>)> {
        fields(&self.0.want)
    }

    /// Asks with one array for each field. A state without an answer is a status, no exception.
    #[pyo3(signature = (given, out = None, threads = None, progress = None))]
    fn ask<'py>(
        &self,
        py: Python<'py>,
        given: Vec<Bound<'py, PyAny>>,
        out: Option<Vec<Option<Bound<'py, PyAny>>>>,
        #[pyo3(from_py_with = threads)] threads: Option<NonZero<usize>>,
        #[pyo3(from_py_with = progress)] progress: Option<Py<PyAny>>,
    ) -> PyResult<Answer<'py>> {
        let asked = &self.0;
        let out = out.unwrap_or_default();
        for (found, expected, what) in [
            (given.len(), asked.given.slots().len(), "go in"),
            (out.len(), asked.want.slots().len(), "come out"),
        ] {
            // without `out` all arrays are made
            if found != expected && !(what == "come out" && found == 0) {
                return Err(PyValueError::new_err(format!(
                    "found {found} arrays where {expected} {what}"
                )));
            }
        }
        match asked.ask(py, &given, &out, &BatchOptions { threads, progress })? {
            Answered::State { numbers, answer } => Ok((
                PyTuple::new(py, asked.fields(py, &numbers, &out)?)?,
                (answer.status as u32).into_pyobject(py)?.into_any(),
                answer.warnings.0.into_pyobject(py)?.into_any(),
            )),
            Answered::Rows { fields, statuses, warnings, .. } => {
                Ok((PyTuple::new(py, fields)?, statuses.into_any(), warnings.into_any()))
            }
        }
    }
}

fn fields(layout: &Layout) -> Vec<(&'static str, Vec<usize>)> {
    layout.slots().iter().map(|slot| (slot.field.name(), shape(slot))).collect()
}
