//! CAN frames as Python values.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sarrus_can_core::frame::{Frame, FrameKind, Id};

/// Data of a frame without any.
const NO_DATA: &[u8] = &[];

/// One data frame: a value that cannot change. Its text is that of `candump -L`.
#[pyclass(name = "Frame", module = "sarrus.can", frozen, eq, hash, str, from_py_object)]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct PyFrame(pub(crate) Frame);

impl std::fmt::Display for PyFrame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

#[pymethods]
impl PyFrame {
    #[new]
    #[pyo3(signature = (
        id, data = NO_DATA, *, extended = false, fd = false, bit_rate_switch = false
    ))]
    fn new(
        id: u32,
        data: &[u8],
        extended: bool,
        fd: bool,
        bit_rate_switch: bool,
    ) -> PyResult<PyFrame> {
        let of = |id: Option<Id>| match fd {
            true => Frame::fd(id?, bit_rate_switch, data),
            false => Frame::classic(id?, data),
        };
        let made = of(if extended { Id::extended(id) } else { Id::standard(id) });
        made.map(PyFrame).ok_or_else(|| {
            PyValueError::new_err(format!(
                "no frame has the identifier 0x{id:X} (extended: {extended}) and {} bytes (FD: \
                    {fd})",
                data.len()
            ))
        })
    }

    /// Identifier.
    #[getter]
    fn id(&self) -> u32 {
        self.0.id.number()
    }

    /// Whether the identifier has 29 bits.
    #[getter]
    fn extended(&self) -> bool {
        matches!(self.0.id, Id::Extended(_))
    }

    /// Whether it is a CAN FD frame.
    #[getter]
    fn fd(&self) -> bool {
        self.0.is_fd()
    }

    /// Whether its data go at the faster bit rate.
    #[getter]
    fn bit_rate_switch(&self) -> bool {
        self.0.kind == FrameKind::Fd { bit_rate_switch: true }
    }

    /// The data bytes.
    #[getter]
    fn data<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, self.0.data())
    }

    fn __repr__(&self) -> String {
        format!("<Frame {}>", self.0)
    }
}

/// Frames as a list.
pub(crate) fn list(frames: &[Frame]) -> Vec<PyFrame> {
    frames.iter().copied().map(PyFrame).collect()
}
