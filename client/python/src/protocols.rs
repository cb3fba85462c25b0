//! The motor protocols that the core knows.

use pyo3::prelude::*;
use pyo3::types::PyList;
use sarrus_can_core::protocol::PROTOCOLS;

/// All protocols: `[{name, about, modes, fd, keys: [{name, about, default}]}]`.
#[pyfunction]
pub(crate) fn protocols(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for protocol in PROTOCOLS {
        let keys = PyList::empty(py);
        for key in protocol.keys {
            keys.append(fields!(py, key => name, about, default))?;
        }
        let modes: Vec<&str> = protocol.modes.iter().map(|mode| mode.name()).collect();
        let entry = fields!(py, protocol => name, about);
        entry.set_item("modes", modes)?;
        entry.set_item("fd", protocol.fd)?;
        entry.set_item("keys", keys)?;
        list.append(entry)?;
    }
    Ok(list)
}
