//! Lines of slcan, read and written by the core.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sarrus_can_core::slcan::{self, Line, Lines, MAX_LINE};

use crate::frames::PyFrame;

/// Cuts bytes of a serial adapter into lines as they come.
#[pyclass(name = "SlcanReader", module = "sarrus.can")]
pub(crate) struct PySlcanReader {
    lines: Lines,
}

#[pymethods]
impl PySlcanReader {
    #[new]
    fn new() -> PySlcanReader {
        PySlcanReader { lines: Lines::default() }
    }

    /// Frames, and events as `(name, count)`, of the lines that end in these bytes; `dropped` is a
    /// refusal.
    fn take(&mut self, py: Python<'_>, data: &[u8]) -> PyResult<Vec<Py<PyAny>>> {
        let mut heard = Vec::new();
        for line in data.iter().filter_map(|byte| self.lines.take(*byte)) {
            if let Line::Frame(frame) = line {
                heard.push(PyFrame(frame).into_pyobject(py)?.into_any().unbind());
            } else if let Some(event) = line.event() {
                let event = (event.name(), event.count().unwrap_or(1));
                heard.push(event.into_pyobject(py)?.into_any().unbind());
            }
        }
        Ok(heard)
    }
}

/// A frame as a line of slcan, with its end.
#[pyfunction]
pub(crate) fn slcan_line<'py>(py: Python<'py>, frame: &PyFrame) -> Bound<'py, PyBytes> {
    let mut line = [0; MAX_LINE];
    let used = slcan::write(&frame.0, &mut line);
    PyBytes::new(py, line.get(..used).unwrap_or_default())
}
