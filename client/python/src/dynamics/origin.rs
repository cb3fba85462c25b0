//! Where a robot comes from, and how it is read.

use std::path::PathBuf;
use std::time::Duration;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sarrus_client::{ConnectOptions, Lock, Options, Robot, Source, Transport, WaitStrategy};
use sarrus_models::{Base, Loaded, import, load, texts};
use sarrus_serve::record::RecordedRobot;

use super::errors::{load_error, robot_error};
use super::options::fingerprint;
use super::signals::{is_main, waiting};

/// Options of a robot that is read: gravity, lenient, floating base, locks, links that are kept.
type Parts = ([f64; 3], bool, Option<String>, Vec<String>, Vec<String>);

/// Where a robot comes from.
#[pyclass(name = "Origin", module = "sarrus._native", frozen)]
pub(crate) struct PyOrigin(Origin);

enum Origin {
    Read { source: Source, options: Options, parts: Parts },
    Served { name: String, options: ConnectOptions },
}

#[pymethods]
impl PyOrigin {
    /// A bundled robot.
    #[staticmethod]
    fn bundled(name: String, parts: Parts) -> PyResult<PyOrigin> {
        PyOrigin::read(Source::Bundled(name), parts)
    }

    /// Files.
    #[staticmethod]
    fn files(urdf: PathBuf, submechanisms: Option<PathBuf>, parts: Parts) -> PyResult<PyOrigin> {
        PyOrigin::read(Source::Files { urdf, submechanisms }, parts)
    }

    /// The contents of files.
    #[staticmethod]
    fn text(urdf: Vec<u8>, submechanisms: Option<Vec<u8>>, parts: Parts) -> PyResult<PyOrigin> {
        PyOrigin::read(Source::Text { urdf, submechanisms }, parts)
    }

    /// A running server.
    #[staticmethod]
    fn served(
        name: String,
        timeout: f64,
        deadline: Option<f64>,
        transport: &str,
        wait: &str,
        #[pyo3(from_py_with = fingerprint)] fingerprint: Option<u64>,
    ) -> PyResult<PyOrigin> {
        let seconds = |what: &str, seconds: f64| {
            Duration::try_from_secs_f64(seconds).map_err(|_| {
                PyValueError::new_err(format!("{what} is {seconds}, expected seconds"))
            })
        };
        let transport = match transport {
            "lane" => Transport::Lane,
            "service" => Transport::Service,
            other => return Err(unknown("transport", other, "`lane` or `service`")),
        };
        let wait_strategy = match wait {
            "auto" => WaitStrategy::auto(),
            "busy" => WaitStrategy::Busy,
            "polite" => WaitStrategy::Polite,
            other => return Err(unknown("wait", other, "`auto`, `busy` or `polite`")),
        };
        let timeout = seconds("timeout", timeout)?;
        let deadline = deadline.map(|deadline| seconds("deadline", deadline)).transpose()?;
        let options = ConnectOptions { transport, timeout, wait_strategy, deadline, fingerprint };
        Ok(PyOrigin(Origin::Served { name, options }))
    }

    /// True for a running server.
    #[getter]
    fn is_served(&self) -> bool {
        matches!(self.0, Origin::Served { .. })
    }

    /// Name of the bundled robot, the file or the server.
    #[getter]
    fn name(&self) -> String {
        match &self.0 {
            Origin::Served { name, .. } => name.clone(),
            Origin::Read { source, .. } => match source {
                Source::Bundled(name) => name.clone(),
                Source::Files { urdf, .. } => urdf.display().to_string(),
                _ => "text".to_owned(),
            },
        }
    }

    /// Notes of its reader.
    fn notes(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.load(py)?.report.notes.iter().map(ToString::to_string).collect())
    }

    /// The arguments with which `text` reads the same robot again in another process: the current
    /// contents of its files, and its options.
    fn contents<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyBytes>, Option<Bound<'py, PyBytes>>, Parts)> {
        let (source, _, parts) = self.source()?;
        let (urdf, submechanisms) = texts(source).map_err(|error| load_error(py, error))?;
        let submechanisms = submechanisms.map(|bytes| PyBytes::new(py, &bytes));
        Ok((PyBytes::new(py, &urdf), submechanisms, parts.clone()))
    }
}

impl PyOrigin {
    /// The robot of a server's recording.
    pub(crate) fn recorded(of: &RecordedRobot) -> PyResult<PyOrigin> {
        let bytes = |text: &String| text.clone().into_bytes();
        let submechanisms = of.submechanisms.as_ref().map(bytes);
        let position = |lock: &Lock| lock.position.map(|x| format!("={x}")).unwrap_or_default();
        let locks = of.lock.iter().map(|lock| lock.joint.clone() + &position(lock)).collect();
        let parts = (of.gravity, of.lenient, of.floating_base.clone(), locks, of.only.clone());
        PyOrigin::read(Source::Text { urdf: bytes(&of.urdf), submechanisms }, parts)
    }

    fn read(source: Source, parts: Parts) -> PyResult<PyOrigin> {
        let (gravity, lenient, floating_base, lock, only) = parts.clone();
        let lock = lock
            .iter()
            .map(|text| text.parse::<Lock>().map_err(PyValueError::new_err))
            .collect::<PyResult<_>>()?;
        if gravity.iter().any(|number| !number.is_finite()) {
            return Err(PyValueError::new_err("gravity is not finite, expected three numbers"));
        }
        let base = Base::of_flag(floating_base.as_deref());
        let options = Options { gravity, lenient, base, lock, only };
        Ok(PyOrigin(Origin::Read { source, options, parts }))
    }

    pub(super) fn source(&self) -> PyResult<(&Source, &Options, &Parts)> {
        match &self.0 {
            Origin::Read { source, options, parts } => Ok((source, options, parts)),
            Origin::Served { name, .. } => Err(PyTypeError::new_err(format!(
                "this robot is connected to the server `{name}`, which has its files; connect \
                 anew where it is needed, by `Robot.connect`"
            ))),
        }
    }

    /// The robot; Python's other threads run meanwhile.
    pub(super) fn open(&self, py: Python<'_>) -> PyResult<Robot> {
        match &self.0 {
            Origin::Read { source, options, .. } => {
                let robot = py.detach(|| Robot::load(source, options));
                robot.map_err(|error| load_error(py, error))
            }
            Origin::Served { name, options } => {
                let is_main = is_main(py)?;
                let connect = || waiting(is_main, || Robot::connect_with(name, *options));
                py.detach(connect)?.map_err(|error| robot_error(error.into()))
            }
        }
    }

    /// The robot, read from its files.
    pub(super) fn load(&self, py: Python<'_>) -> PyResult<Loaded> {
        let (source, options, _) = self.source()?;
        py.detach(|| load(source, options)).map_err(|error| load_error(py, error))
    }
}

fn unknown(what: &str, found: &str, expected: &str) -> PyErr {
    PyValueError::new_err(format!("{what} is `{found}`, expected {expected}"))
}

/// URDF and submechanisms of a URDF with loops, with the independent joints that `sarrus import`
/// chooses, and notes.
#[pyfunction]
pub(crate) fn imported(
    py: Python<'_>,
    file: PathBuf,
    urdf: Vec<u8>,
    lenient: bool,
) -> PyResult<(Vec<u8>, Vec<u8>, Vec<String>)> {
    let options = Options { lenient, ..Options::default() };
    let found = py.detach(|| import(&file, Some(urdf), &[], &options));
    let found = found.map_err(|error| load_error(py, error))?;
    let notes = found.report.notes.iter().map(ToString::to_string);
    Ok((found.urdf, found.submechanisms, notes.collect()))
}

/// Names of the bundled robots, each with one line about it.
#[pyfunction]
pub(crate) fn bundled_names() -> Vec<(&'static str, &'static str)> {
    sarrus_models::bundled().collect()
}
