//! The state and statistics that a bridge publishes to its observers.

use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_can_core::telemetry::{CycleTimes, Telemetry};
use sarrus_proto::watch::BridgeStatistics;

use crate::bridge::PyBridge;

/// Distributions of a bridge's times since its start, in a fixed amount of memory. Times are
/// nanoseconds.
#[pyclass(name = "Telemetry", module = "sarrus.can")]
pub(crate) struct PyTelemetry {
    telemetry: Telemetry,
}

#[pymethods]
impl PyTelemetry {
    /// Nothing measured yet, by this process since the monotonic time `started_ns`.
    #[new]
    fn new(bridge: &PyBridge, started_ns: u64) -> PyResult<PyTelemetry> {
        let process = std::process::id();
        let telemetry = Telemetry::new(&bridge.lock(), &bridge.loads, process, started_ns);
        let absent = || PyMemoryError::new_err("no memory for histograms");
        Ok(PyTelemetry { telemetry: telemetry.ok_or_else(absent)? })
    }

    /// Takes a cycle that has just ended: from its deadline to its begin, and from there to its
    /// last frame.
    fn cycle(&mut self, bridge: &PyBridge, wake_ns: u64, work_ns: u64) {
        self.telemetry.cycle(&bridge.lock(), CycleTimes { wake_ns, work_ns });
    }

    /// The distributions `wake`, `work`, `age` (of the command) and `reply` (of motors): `{count,
    /// p50, p99, p999, max}` each.
    fn times<'py>(&self, py: Python<'py>, bridge: &PyBridge) -> PyResult<Bound<'py, PyDict>> {
        let statistics = self.telemetry.statistics(&bridge.lock(), 0);
        let dict = PyDict::new(py);
        for (name, times) in [
            ("wake", statistics.wake),
            ("work", statistics.work),
            ("age", statistics.age),
            ("reply", statistics.reply),
        ] {
            dict.set_item(name, fields!(py, times => count, p50, p99, p999, max))?;
        }
        Ok(dict)
    }
}

impl PyTelemetry {
    /// All statistics, if they are due.
    pub(crate) fn due(&mut self, bridge: &PyBridge, now_ns: u64) -> Option<BridgeStatistics> {
        self.telemetry.due(&bridge.lock(), now_ns)
    }
}
