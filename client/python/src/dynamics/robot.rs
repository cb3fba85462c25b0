//! A robot as Python sees it: the questions that loops ask, by the shortest way. `sarrus.Robot`
//! adds names and everything else.

use std::ffi::CString;
use std::num::NonZero;
use std::sync::{Arc, OnceLock};

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use sarrus_client::{Axes, Field, Request, Status, TaskParts, Warnings};
use sarrus_identify::Log;
use sarrus_show::Settings;

use super::arrays::zeros;
use super::asked::{Answered, Asked, BatchOptions, Marked};
use super::errors::state_error;
use super::options::{progress, threads};
use super::origin::PyOrigin;
use super::query::PyQuery;
use super::shared::Shared;
use super::simulation::{self, Inputs, Simulated};

/// A robot, in this process or connected.
#[pyclass(name = "Robot", module = "sarrus._native", subclass, frozen)]
pub(crate) struct PyRobot {
    origin: Py<PyOrigin>,
    shared: Arc<Shared>,
    fingerprint: u64,
    inverse: OnceLock<Asked>,
    forward: OnceLock<Asked>,
}

#[pymethods]
impl PyRobot {
    #[new]
    fn new(py: Python<'_>, origin: Py<PyOrigin>) -> PyResult<PyRobot> {
        let robot = origin.get().open(py)?;
        let fingerprint = robot.model().fingerprint;
        let shared = Arc::new(Shared::new(robot));
        let inverse = OnceLock::new();
        let forward = OnceLock::new();
        Ok(PyRobot { origin, shared, fingerprint, inverse, forward })
    }

    /// Actuator forces for a motion: τ_u = G_u⁻ᵀ (M_y ÿ + C_y).
    ///
    /// `y` [m, rad] (n_qy), `yd` and `ydd` (n_vy), zero by default; gives `tau_u` [N, N m] (n_u).
    /// With rows of each (n, …) the states are answered on `threads` threads, with the same bits,
    /// and `progress` gets how many are done and how many there are; Ctrl-C ends it. A connected
    /// robot has one thread.
    ///
    /// One state without an answer raises `StateError`. Rows without one are NaN; a `StateWarning`
    /// tells of them, and of answers with warnings such as `limits_exceeded`. With `return_status`
    /// the statuses come beside the forces, and nothing is raised or warned of. `out` is written in
    /// place: float64, contiguous, of the right shape.
    #[pyo3(signature = (
        y, yd = None, ydd = None, *, out = None, threads = None, progress = None,
        return_status = false
    ))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        y: Bound<'py, PyAny>,
        yd: Option<Bound<'py, PyAny>>,
        ydd: Option<Bound<'py, PyAny>>,
        out: Option<Bound<'py, PyAny>>,
        #[pyo3(from_py_with = threads)] threads: Option<NonZero<usize>>,
        #[pyo3(from_py_with = progress)] progress: Option<Py<PyAny>>,
        return_status: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        const GIVEN: [Field; 3] = [Field::Y, Field::Yd, Field::Ydd];
        let request = Request::InverseDynamics;
        let asked = self.direct(py, &self.inverse, request, GIVEN, Field::TauU)?;
        let options = BatchOptions { threads, progress };
        let [yd, ydd] = [(Field::Yd, yd), (Field::Ydd, ydd)]
            .map(|(field, given)| given.map_or_else(|| at_rest(asked, field, &y), Ok));
        one_field(py, asked, [y, yd?, ydd?], out, &options, return_status)
    }

    /// Motion under actuator forces: ÿ = M_y⁻¹ (G_uᵀ τ_u − C_y).
    ///
    /// `y` [m, rad] (n_qy), `yd` (n_vy), `tau_u` [N, N m] (n_u); gives `ydd` (n_vy). All else is as
    /// in `inverse_dynamics`.
    #[pyo3(signature = (
        y, yd, tau_u, *, out = None, threads = None, progress = None, return_status = false
    ))]
    fn forward_dynamics<'py>(
        &self,
        py: Python<'py>,
        y: Bound<'py, PyAny>,
        yd: Bound<'py, PyAny>,
        tau_u: Bound<'py, PyAny>,
        out: Option<Bound<'py, PyAny>>,
        #[pyo3(from_py_with = threads)] threads: Option<NonZero<usize>>,
        #[pyo3(from_py_with = progress)] progress: Option<Py<PyAny>>,
        return_status: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        const GIVEN: [Field; 3] = [Field::Y, Field::Yd, Field::TauU];
        let request = Request::ForwardDynamics;
        let asked = self.direct(py, &self.forward, request, GIVEN, Field::Ydd)?;
        let options = BatchOptions { threads, progress };
        one_field(py, asked, [y, yd, tau_u], out, &options, return_status)
    }

    /// Prepares a query by the words of `sarrus ask`; every name that stands for nothing is in the
    /// exception.
    #[pyo3(name = "_prepare", signature = (
        request, given, want = None, frames = vec![], joints = None, wrenches = vec![],
        checksum = false, search = false, loop_tolerance = None, projection_tolerance = None,
        axes = "mixed", relative_to = None, directions = 0, friction = false,
        tasks = None
    ))]
    fn prepare(
        &self,
        py: Python<'_>,
        request: &str,
        given: Vec<String>,
        want: Option<Vec<String>>,
        frames: Vec<String>,
        joints: Option<Vec<String>>,
        wrenches: Vec<String>,
        checksum: bool,
        search: bool,
        loop_tolerance: Option<f64>,
        projection_tolerance: Option<f64>,
        axes: &str,
        relative_to: Option<String>,
        directions: usize,
        friction: bool,
        tasks: Option<Vec<u8>>,
    ) -> PyResult<PyQuery> {
        let known = Request::ALL.iter().copied().find(|known| known.name() == request);
        let known = known.ok_or_else(|| {
            let names: Vec<_> = Request::ALL.iter().map(|known| known.name()).collect();
            let names = names.join(", ");
            PyValueError::new_err(format!("no request `{request}`, expected one of {names}"))
        })?;
        let known_axes = Axes::ALL.iter().copied().find(|known| known.name() == axes);
        let axes = known_axes.ok_or_else(|| {
            PyValueError::new_err(format!("no axes `{axes}`, expected mixed, world or local"))
        })?;
        let asked = Asked::new(py, &self.shared, known, move |mut query| {
            query = query.given(given).axes(axes);
            if let Some(link) = relative_to {
                query = query.relative_to(link);
            }
            if let Some(want) = want {
                query = query.want(want);
            }
            if let Some(parts) = tasks.filter(|parts| !parts.is_empty()) {
                query = query.tasks(frames.into_iter().zip(parts.into_iter().map(TaskParts)));
            } else if !frames.is_empty() {
                query = query.frames(frames);
            }
            if let Some(joints) = joints {
                query = query.joints(joints);
            }
            if directions > 0 {
                query = query.directions(directions);
            }
            if !wrenches.is_empty() {
                query = query.wrenches(wrenches);
            }
            if checksum {
                query = query.checksum();
            }
            if friction {
                query = query.friction();
            }
            if search {
                query = query.search();
            }
            if let Some(tolerance) = loop_tolerance {
                query = query.loop_tolerance(tolerance);
            }
            match projection_tolerance {
                Some(tolerance) => query.projection_tolerance(tolerance),
                None => query,
            }
        })?;
        Ok(PyQuery(asked))
    }

    /// Where the robot comes from.
    #[getter]
    fn origin(&self, py: Python<'_>) -> Py<PyOrigin> {
        self.origin.clone_ref(py)
    }

    /// A number that differs whenever any name, order or constant differs.
    #[getter]
    fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Names, orders, sizes and limits, as JSON.
    #[pyo3(name = "_information_json")]
    fn information_json<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let json = self.shared.with(py, |robot| Ok(robot.model().to_json()))?;
        Ok(PyBytes::new(py, &json))
    }

    /// Maps of the capability of the motors, as lines of JSON and as a page; see
    /// `sarrus.capability`.
    #[pyo3(name = "_capability")]
    fn capability(
        &self,
        py: Python<'_>,
        joints: Vec<String>,
        grid: Option<usize>,
        at: Option<Vec<f64>>,
        page: bool,
    ) -> PyResult<(String, String)> {
        let loaded = self.origin.get().load(py)?;
        let choices = sarrus_show::Choices { joints, grid, at };
        let maps = py.detach(|| sarrus_show::capability(&loaded, &choices, &mut |_| {}));
        let maps = maps.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let text = maps.iter().map(|map| map.to_json().to_string() + "\n").collect();
        let name = loaded.compiled.model.name();
        let html = if page { sarrus_show::capability_page(name, &maps) } else { String::new() };
        Ok((text, html))
    }

    /// Estimates as JSON, and the URDF with the new inertias; see `sarrus.identify`.
    #[pyo3(name = "_identify")]
    fn identify(
        &self,
        py: Python<'_>,
        heads: Vec<String>,
        rows: Vec<Vec<f64>>,
    ) -> PyResult<(String, String)> {
        let loaded = self.origin.get().load(py)?;
        let (source, ..) = self.origin.get().source()?;
        if rows.iter().any(|row| row.len() != heads.len()) {
            return Err(PyValueError::new_err("rows and names of columns differ in number"));
        }
        let found = py.detach(|| {
            let model = &loaded.compiled.model;
            let log = Log::of_table(model, &heads, &rows).map_err(|error| error.to_string())?;
            let found = sarrus_identify::identify(&loaded.description, model, &log)
                .map_err(|error| error.to_string())?;
            let (urdf, _) = sarrus_models::texts(source).map_err(|error| error.to_string())?;
            let urdf = String::from_utf8(urdf).map_err(|error| error.to_string())?;
            let links: Vec<_> =
                found.links.iter().map(|link| (link.name.as_str(), link.inertial)).collect();
            let urdf = sarrus_models::with_inertials(&urdf, &links)?;
            Ok((found.to_json().to_string(), urdf))
        });
        found.map_err(|error: String| PyValueError::new_err(error))
    }

    /// The robot as a page; see `sarrus.Robot.save_page`.
    #[pyo3(name = "_page")]
    fn page(&self, py: Python<'_>, swing: bool) -> PyResult<String> {
        let loaded = self.origin.get().load(py)?;
        let (source, options, _) = self.origin.get().source()?;
        let settings = Settings::new(source, options, swing);
        let page = py.detach(|| sarrus_show::page(&loaded, &settings));
        page.map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// The links, joints and shapes of the page, as JSON.
    #[pyo3(name = "_scene")]
    fn scene(&self, py: Python<'_>) -> PyResult<String> {
        let loaded = self.origin.get().load(py)?;
        let (source, options, _) = self.origin.get().source()?;
        Ok(sarrus_show::description(&loaded, &Settings::new(source, options, false)))
    }

    /// Answers that came after the deadline; 0 in process.
    #[getter]
    fn late(&self, py: Python<'_>) -> PyResult<u64> {
        self.shared.with(py, |robot| Ok(robot.late()))
    }

    /// The robot in time; see `sarrus.Robot.simulate`.
    #[pyo3(name = "_run_simulation", signature = (y, yd, inputs, settings, progress = None))]
    fn run_simulation<'py>(
        &self,
        py: Python<'py>,
        y: Vec<f64>,
        yd: Vec<f64>,
        inputs: Inputs,
        settings: simulation::Parts,
        #[pyo3(from_py_with = progress)] progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyDict>, Simulated)> {
        let loaded = self.origin.get().load(py)?;
        let found = loaded.compiled.model.fingerprint();
        if found != self.fingerprint {
            return Err(PyValueError::new_err(format!(
                "the robot's files now hold the model {found:016x}, expected {:016x}; load the \
                 robot anew",
                self.fingerprint
            )));
        }
        simulation::run(py, &loaded, (y, yd), inputs, settings, progress.as_ref())
    }
}

impl PyRobot {
    /// The plan of a question, prepared with its first call.
    fn direct<'a>(
        &'a self,
        py: Python<'_>,
        place: &'a OnceLock<Asked>,
        request: Request,
        given: [Field; 3],
        want: Field,
    ) -> PyResult<&'a Asked> {
        if let Some(asked) = place.get() {
            return Ok(asked);
        }
        let asked =
            Asked::new(py, &self.shared, request, move |query| query.given(given).want([want]))?;
        // of two threads one is first; the other's plan is released
        let _ = place.set(asked);
        place.get().ok_or_else(|| PyValueError::new_err("the plan was not kept"))
    }
}

/// Rates of zero for a state, or for each row of y.
fn at_rest<'py>(asked: &Asked, field: Field, y: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = y.py().import("numpy")?;
    let mut shape: Vec<usize> = numpy.call_method1("shape", (y,))?.extract()?;
    shape.pop();
    shape.push(asked.given.slot(field).map_or(0, |slot| slot.range().len()));
    zeros::<f64>(y.py(), &shape)
}

/// Asks for a single field: one state raises, rows without an answer are NaN and counted.
fn one_field<'py>(
    py: Python<'py>,
    asked: &Asked,
    given: [Bound<'py, PyAny>; 3],
    out: Option<Bound<'py, PyAny>>,
    options: &BatchOptions,
    return_status: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let out = [out];
    let (field, status) = match asked.ask(py, &given, &out, options)? {
        Answered::State { numbers, answer } => {
            let field = asked.field(py, 0, &numbers, &out)?;
            if answer.status != Status::Ok && !return_status {
                return Err(state_error(answer.status));
            }
            if answer.warnings != Warnings::NONE && !return_status {
                warn(py, &format!("the answer has a warning: {}", names(answer.warnings.0)))?;
            }
            (field, (answer.status as u32).into_pyobject(py)?.into_any())
        }
        Answered::Rows { fields, statuses, failed, warned, .. } => {
            let field = fields.into_iter().next();
            let field = field.ok_or_else(|| PyValueError::new_err("nothing comes out"))?;
            if !return_status {
                warn_of(py, failed, warned, statuses.len()?)?;
            }
            (field, statuses.into_any())
        }
    };
    if !return_status {
        return Ok(field);
    }
    Ok(PyTuple::new(py, [field, status])?.into_any())
}

/// Warns of rows without an answer, and of rows with warnings.
fn warn_of(py: Python<'_>, failed: Marked, warned: Marked, rows: usize) -> PyResult<()> {
    if let Some((row, status)) = failed.first {
        let name = Status::of_answer(status).name();
        warn(
            py,
            &format!(
                "{} of {rows} states have no answer and are NaN, the first in row {row}: {name}; \
                 `return_status=True` gives all statuses",
                failed.count,
            ),
        )?;
    }
    let Some((row, warnings)) = warned.first else { return Ok(()) };
    let of = format!("{} of {rows} answers have warnings, the first in row {row}", warned.count);
    warn(py, &format!("{of}: {}", names(warnings)))
}

fn names(warnings: u32) -> String {
    Warnings(warnings).names().collect::<Vec<_>>().join(", ")
}

/// A `StateWarning` at the caller's line.
fn warn(py: Python<'_>, words: &str) -> PyResult<()> {
    static WARNING: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let category = WARNING.import(py, "sarrus.errors", "StateWarning")?;
    let words = CString::new(words).unwrap_or_default();
    PyErr::warn(py, category.as_any(), &words, 1)
}
