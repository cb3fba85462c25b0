//! The kernel's description of a CAN interface, parsed by the core.

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sarrus_can_core::netlink::{Interface, InterfaceError, error_events, question};

/// The question for an interface, to be sent over a route socket of Netlink.
#[pyfunction]
pub(crate) fn interface_question<'py>(py: Python<'py>, name: &str) -> Bound<'py, PyBytes> {
    PyBytes::new(py, &question(name))
}

/// Reads the answer and compares it with the bit rates of a bus; the event that describes its
/// controller, if it is not error-active.
///
/// `OSError` where the kernel knows no such interface, `ValueError` where it is not as it should
/// be.
#[pyfunction]
#[pyo3(signature = (answer, name, bitrate, data_bitrate=None))]
pub(crate) fn check_interface(
    answer: &[u8],
    name: &str,
    bitrate: Option<u32>,
    data_bitrate: Option<u32>,
) -> PyResult<Option<(&'static str, u32)>> {
    let checked =
        Interface::read(answer).and_then(|interface| interface.check(name, bitrate, data_bitrate));
    match checked {
        Ok(event) => Ok(event.map(|event| (event.name(), event.count().unwrap_or(1)))),
        Err(InterfaceError::Refused(number)) => {
            Err(PyOSError::new_err((number, std::io::Error::from_raw_os_error(number).to_string())))
        }
        Err(other) => Err(PyValueError::new_err(other.to_string())),
    }
}

/// Advice on an interface that is usable as it is; `None` without advice or without an answer.
#[pyfunction]
pub(crate) fn interface_advice(answer: &[u8], name: &str) -> Option<String> {
    Interface::read(answer).ok()?.advice(name)
}

/// Events of a SocketCAN error frame, from its class and its data.
#[pyfunction]
pub(crate) fn events_of_error_frame(error_class: u32, data: &[u8]) -> Vec<(&'static str, u32)> {
    error_events(error_class, data)
        .into_iter()
        .flatten()
        .map(|event| (event.name(), event.count().unwrap_or(1)))
        .collect()
}
