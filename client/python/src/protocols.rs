//! The motor protocols that the core knows.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sarrus_can_core::protocol::PROTOCOLS;

/// All protocols: `[{name, about, modes, fd, keys: [{name, about, default}]}]`.
#[pyfunction]
pub(crate) fn protocols(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for protocol in PROTOCOLS {
        let keys = PyList::empty(py);
        for key in protocol.keys {
            let entry = PyDict::new(py);
            entry.set_item("name", key.name)?;
            entry.set_item("about", key.about)?;
            entry.set_item("default", key.default)?;
            keys.append(entry)?;
        }
        let modes: Vec<&str> = protocol.modes.iter().map(|mode| mode.name()).collect();
        let entry = PyDict::new(py);
        entry.set_item("name", protocol.name)?;
        entry.set_item("about", protocol.about)?;
        entry.set_item("modes", modes)?;
        entry.set_item("fd", protocol.fd)?;
        entry.set_item("keys", keys)?;
        list.append(entry)?;
    }
    Ok(list)
}
