//! The extension module of `sarrus` for Python: robots with numpy arrays, in `dynamics`; the core
//! of the CAN bridge as Python classes, without bus or clock; and, in `run`, its loop over Python
//! buses.

use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;

/// A dict of a structure's fields by their names.
macro_rules! fields {
    ($py:expr, $of:expr => $($field:ident),*) => {{
        let dict = pyo3::types::PyDict::new($py);
        $(dict.set_item(stringify!($field), &$of.$field)?;)*
        dict
    }};
}

mod bridge;
mod candidates;
mod configuration;
mod drives;
mod dynamics;
mod entry;
mod frames;
mod interface;
mod protocols;
mod recording;
mod run;
mod service;
mod slcan;

/// Locks; a panic under a lock of this extension leaves no half-changed value.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The native part of sarrus. The package around it is the public Python API; `entry` loads it as
/// `sarrus._native`.
#[pymodule(name = "_checked", gil_used = true)]
mod native {
    #[pymodule_export]
    use crate::{
        bridge::PyBridge,
        candidates::{PyCandidate, candidates},
        configuration::PyConfiguration,
        drives::PyDrives,
        dynamics::{
            PyOrigin, PyQuery, PyRobot, bundled_names, forked, imported, refuse_masked,
            status_help, statuses, warning_bits,
        },
        frames::PyFrame,
        interface::{check_interface, events_of_error_frame, interface_advice, interface_question},
        protocols::protocols,
        recording::recording,
        run::run_bridge,
        service::{PyController, PyService},
        slcan::{PySlcanReader, slcan_line},
    };

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
