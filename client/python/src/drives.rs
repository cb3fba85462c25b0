//! The motors of a configuration one by one, for commissioning: no state machine, no commands of a
//! robot.

use std::sync::Mutex;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_can_core::config::{Configuration, MotorConfig};
use sarrus_can_core::drive::{DriveCommand, DriveState, Measurement, Receipt, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::mapping::ActuatorSetpoint;
use sarrus_proto::actuators::Reason;

use crate::configuration::PyConfiguration;
use crate::frames::{PyFrame, list};
use crate::locked;

/// Room for the frames of one motor.
const FRAMES: usize = 32;

/// The motors of a configuration, each by its place.
#[pyclass(name = "Drives", module = "sarrus.can", frozen)]
pub(crate) struct PyDrives {
    configuration: Mutex<Configuration>,
}

#[pymethods]
impl PyDrives {
    #[new]
    fn new(configuration: &PyConfiguration) -> PyResult<PyDrives> {
        Ok(PyDrives { configuration: Mutex::new(configuration.take()?) })
    }

    /// Frames that ask for a heartbeat without giving power or changing anything.
    fn probe(&self, motor: usize) -> PyResult<Vec<PyFrame>> {
        self.frames(motor, |motor, out| motor.drive.probe(out))
    }

    /// Frames that take the motor's power away.
    fn disable(&self, motor: usize) -> PyResult<Vec<PyFrame>> {
        self.frames(motor, |motor, out| motor.drive.disable(out))
    }

    /// Frames of one cycle without power; the motor reports its position and gets its watchdog.
    fn off(&self, motor: usize, now_ns: u64) -> PyResult<Vec<PyFrame>> {
        self.frames(motor, |motor, out| cycle(motor, now_ns, DriveCommand::Off, out))
    }

    /// Frames of one cycle towards a set-point of the actuator `[SI]`, limited to the motor's own
    /// limits.
    fn on(&self, motor: usize, now_ns: u64, setpoint: [f64; 5]) -> PyResult<Vec<PyFrame>> {
        if !setpoint.iter().all(|number| number.is_finite()) {
            return Err(PyValueError::new_err("a set-point that is not finite"));
        }
        let [position, velocity, effort, stiffness, damping] = setpoint;
        self.frames(motor, |motor, out| {
            let limits = motor.limits;
            let setpoint = ActuatorSetpoint {
                // limits of a motor that has none are infinite, so these are never empty ranges
                position: position.max(limits.lower).min(limits.upper),
                velocity: velocity.max(-limits.velocity).min(limits.velocity),
                effort: effort.max(-limits.effort).min(limits.effort),
                stiffness: stiffness.max(0.0),
                damping: damping.max(0.0),
            };
            cycle(motor, now_ns, DriveCommand::On(motor.mapping.to_motor(&setpoint)), out);
        })
    }

    /// Frames that make the present position the motor's zero; `None` where the protocol has no
    /// such command.
    fn set_zero(&self, motor: usize) -> PyResult<Option<Vec<PyFrame>>> {
        self.frames_if(motor, |motor, out| motor.drive.set_zero(out))
    }

    /// Frames that store the zero that was set; `None` where the protocol has no such command.
    fn save_zero(&self, motor: usize) -> PyResult<Option<Vec<PyFrame>>> {
        self.frames_if(motor, |motor, out| motor.drive.save_zero(out))
    }

    /// Frames that give the motor another identifier and store it; `None` where the protocol has no
    /// such command, or no such identifier.
    fn set_id(&self, motor: usize, id: u32) -> PyResult<Option<Vec<PyFrame>>> {
        self.frames_if(motor, |motor, out| motor.drive.set_id(id, out))
    }

    /// Parameters that can be read: `[(name, unit)]`.
    fn parameters(&self, motor: usize) -> PyResult<Vec<(&'static str, &'static str)>> {
        self.motor(motor, |motor| {
            let parameters = motor.drive.parameters().iter();
            parameters.map(|parameter| (parameter.name, parameter.unit)).collect()
        })
    }

    /// Frames that ask for a parameter by its place.
    fn read_parameter(&self, motor: usize, parameter: usize) -> PyResult<Vec<PyFrame>> {
        self.frames(motor, |motor, out| motor.drive.read_parameter(parameter, out))
    }

    /// Gives a frame to the motors of its bus: `[(motor, kind, value)]` of its senders.
    /// `kind` is `"malformed"`, `"noted"`, `"measured"` with a dict of the actuator's `position`,
    /// `velocity`, `effort`, the motor's `motor_position` and `temperature`, or `"parameter"` with
    /// its place and value.
    fn receive<'py>(
        &self,
        py: Python<'py>,
        now_ns: u64,
        bus: usize,
        frame: &PyFrame,
    ) -> PyResult<Vec<(usize, &'static str, Py<PyAny>)>> {
        let mut heard = Vec::new();
        let mut configuration = locked(&self.configuration);
        let motors = configuration.motors.iter_mut().enumerate();
        for (place, motor) in motors.filter(|(_, motor)| motor.bus == bus) {
            let (kind, value) = match motor.drive.receive(now_ns, &frame.0) {
                Receipt::NotMine => continue,
                Receipt::Malformed => ("malformed", py.None()),
                Receipt::Foreign => ("foreign", py.None()),
                Receipt::Noted => ("noted", py.None()),
                Receipt::Measured(measured) => {
                    ("measured", values(py, motor, &measured)?.into_any().unbind())
                }
                Receipt::Parameter(parameter, value) => {
                    ("parameter", (parameter, value).into_pyobject(py)?.into_any().unbind())
                }
            };
            heard.push((place, kind, value));
        }
        Ok(heard)
    }

    /// The state of a motor: `power` (`unknown`, `off`, `starting`, `on`), `fault` (its own code, 0
    /// without one), `watchdog` (`unknown`, `off`, `unreadable`, or milliseconds).
    fn state<'py>(&self, py: Python<'py>, motor: usize) -> PyResult<Bound<'py, PyDict>> {
        let DriveState { power, fault, watchdog } =
            self.motor(motor, |motor| motor.drive.state())?;
        let state = PyDict::new(py);
        state.set_item("power", power.name())?;
        state.set_item("fault", fault)?;
        match watchdog {
            Watchdog::Unknown => state.set_item("watchdog", "unknown")?,
            Watchdog::Off => state.set_item("watchdog", "off")?,
            Watchdog::Unreadable => state.set_item("watchdog", "unreadable")?,
            Watchdog::Set(ms) => state.set_item("watchdog", ms)?,
        }
        Ok(state)
    }

    /// The fault of a motor's watchdog, for which the motor must get no power; `None` without one.
    fn unguarded(&self, motor: usize) -> PyResult<Option<&'static str>> {
        self.motor(motor, |motor| motor.missing_watchdog().map(Reason::name))
    }
}

impl PyDrives {
    fn motor<T>(&self, motor: usize, f: impl FnOnce(&mut MotorConfig) -> T) -> PyResult<T> {
        locked(&self.configuration)
            .motors
            .get_mut(motor)
            .map(f)
            .ok_or_else(|| PyIndexError::new_err(format!("there is no motor {motor}")))
    }

    fn frames(
        &self,
        motor: usize,
        f: impl FnOnce(&mut MotorConfig, &mut FrameQueue),
    ) -> PyResult<Vec<PyFrame>> {
        let frames = self.frames_if(motor, |motor, out| {
            f(motor, out);
            true
        });
        frames.map(Option::unwrap_or_default)
    }

    /// The frames of a motor whose protocol has the command.
    fn frames_if(
        &self,
        motor: usize,
        f: impl FnOnce(&mut MotorConfig, &mut FrameQueue) -> bool,
    ) -> PyResult<Option<Vec<PyFrame>>> {
        let mut out = FrameQueue::new(FRAMES);
        let known = self.motor(motor, |motor| f(motor, &mut out))?;
        Ok(known.then(|| list(out.frames())))
    }
}

/// One cycle of one motor, with the frame that ends a cycle where its protocol has one.
fn cycle(motor: &mut MotorConfig, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
    motor.drive.cycle(now_ns, command, out);
    out.push_some(motor.drive.sync());
}

fn values<'py>(
    py: Python<'py>,
    motor: &MotorConfig,
    measured: &Measurement,
) -> PyResult<Bound<'py, PyDict>> {
    let of_actuator = motor.mapping.to_actuator(measured);
    let values = fields!(py, of_actuator => position, velocity, effort, temperature);
    values.set_item("motor_position", measured.position)?;
    Ok(values)
}
