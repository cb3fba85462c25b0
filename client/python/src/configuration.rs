//! Configurations of buses and motors.

use std::path::PathBuf;
use std::sync::Mutex;

use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_can_core::config::{Configuration, ConfigurationError};

use crate::locked;

/// One robot's buses and motors, checked. A bridge or a commissioning takes ownership of it: it can
/// be used only once.
#[pyclass(name = "Configuration", module = "sarrus.can", frozen)]
pub(crate) struct PyConfiguration {
    configuration: Mutex<Option<Configuration>>,
}

#[pymethods]
impl PyConfiguration {
    /// Reads the configuration of a file. A file that cannot be opened is an `OSError`, faulty
    /// content a `ValueError` with every fault.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<PyConfiguration> {
        match Configuration::load(&path) {
            Ok(configuration) => {
                Ok(PyConfiguration { configuration: Mutex::new(Some(configuration)) })
            }
            Err(ConfigurationError::Faults(report)) => {
                Err(PyValueError::new_err(report.to_string()))
            }
            Err(other) => Err(PyOSError::new_err(other.to_string())),
        }
    }

    /// Warnings about the configuration, a line each.
    #[getter]
    fn warnings(&self) -> PyResult<Vec<String>> {
        self.with(|configuration| configuration.warnings.iter().map(ToString::to_string).collect())
    }

    /// Name of the robot, or `None` without a model.
    #[getter]
    fn robot(&self) -> PyResult<Option<String>> {
        self.with(|configuration| configuration.robot.clone())
    }

    /// Fingerprint of the robot's model, 0 without one.
    #[getter]
    fn fingerprint(&self) -> PyResult<u64> {
        self.with(|configuration| configuration.fingerprint)
    }

    /// Names of the actuators, in the order of commands.
    #[getter]
    fn actuators(&self) -> PyResult<Vec<String>> {
        self.with(|configuration| configuration.actuators.clone())
    }

    /// Time between two cycles, in nanoseconds.
    #[getter]
    fn period_ns(&self) -> PyResult<u64> {
        self.with(Configuration::period_ns)
    }

    /// Times after which a silent motor has failed and arming has failed, in seconds: `{feedback,
    /// arming}`.
    #[getter]
    fn timeouts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.with(|configuration| {
            let timeouts = PyDict::new(py);
            timeouts.set_item("feedback", configuration.timeouts.feedback_ns as f64 * 1e-9)?;
            timeouts.set_item("arming", configuration.timeouts.arming_ns as f64 * 1e-9)?;
            Ok(timeouts)
        })?
    }

    /// The buses: `[{name, interface, channel, bitrate, data_bitrate}]`.
    #[getter]
    fn buses<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.with(|configuration| {
            let entry = |bus: &sarrus_can_core::config::BusConfig| {
                Ok(fields!(py, bus => name, interface, channel, bitrate, data_bitrate))
            };
            configuration.buses.iter().map(entry).collect()
        })?
    }

    /// The motors: `[{actuator, bus, protocol, variant, id, identifiers, sign, gear, offset,
    /// torque_constant, limits}]`; `bus` is the bus's place, `variant` is empty and `id` is `None`
    /// for a protocol without, `offset` is `None` for a motor that is not calibrated, `limits` are
    /// the actuator's `{lower, upper, velocity, effort}`, infinite where there is none.
    #[getter]
    fn motors<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.with(|configuration| {
            let entry = |motor: &sarrus_can_core::config::MotorConfig| {
                let entry = PyDict::new(py);
                let identifiers: Vec<u32> =
                    motor.drive.identifiers().into_iter().map(|id| id.number()).collect();
                entry.set_item("actuator", configuration.actuators.get(motor.actuator))?;
                entry.set_item("bus", motor.bus)?;
                entry.set_item("protocol", motor.protocol.name)?;
                let word = ["variant", "model"].map(|key| motor.settings.text(key)).concat();
                entry.set_item("variant", word)?;
                let key = ["id", "node"].into_iter().find(|key| motor.settings.has(key));
                entry.set_item("id", key.map(|key| motor.settings.integer(key)))?;
                entry.set_item("identifiers", identifiers)?;
                entry.set_item("sign", motor.mapping.sign)?;
                entry.set_item("gear", motor.mapping.gear)?;
                entry.set_item("offset", motor.is_calibrated.then_some(motor.mapping.offset))?;
                entry.set_item("torque_constant", motor.mapping.torque_constant)?;
                let limits = fields!(py, motor.limits => lower, upper, velocity, effort);
                entry.set_item("limits", limits)?;
                Ok(entry)
            };
            configuration.motors.iter().map(entry).collect()
        })?
    }
}

impl PyConfiguration {
    fn with<T>(&self, f: impl FnOnce(&Configuration) -> T) -> PyResult<T> {
        locked(&self.configuration).as_ref().map(f).ok_or_else(taken)
    }

    /// The configuration itself; it can be taken once.
    pub(crate) fn take(&self) -> PyResult<Configuration> {
        locked(&self.configuration).take().ok_or_else(taken)
    }
}

fn taken() -> PyErr {
    PyRuntimeError::new_err(
        "this configuration is in use by a bridge or a commissioning; load it again",
    )
}
