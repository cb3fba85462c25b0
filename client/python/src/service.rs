//! The bridge's services in shared memory, from its side and from a controller's.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_proto::actuators::OperatorRequest;
use sarrus_proto::bridge::{BridgeEnd, CommandsEnd, ControllerEnd, ObserverEnd, Place};
use sarrus_proto::heartbeat::monotonic_ns;
use sarrus_proto::service::ServiceError;

use crate::bridge::{PyBridge, command, command_fields, operation_of, state_fields};

/// A name under which controllers find a bridge. It is free again when this is closed or the
/// process ends.
#[pyclass(name = "Service", module = "sarrus.can")]
pub(crate) struct PyService(Place<BridgeEnd>);

#[pymethods]
impl PyService {
    /// Offers a bridge under a name. A name that is taken, or shared memory that cannot be used, is
    /// an `OSError`.
    #[new]
    fn new(name: &str) -> PyResult<PyService> {
        Ok(PyService(Place::enter(name, BridgeEnd::create).map_err(os_error)?))
    }

    /// Gives the bridge the operations since the last call in their order, and the newest command.
    /// The bridge's counters have the verdict on the command.
    fn take(&self, now_ns: u64, bridge: &PyBridge) {
        let Some(end) = self.0.end() else { return };
        let mut bridge = bridge.lock();
        while let Some(request) = end.operation() {
            bridge.request(now_ns, &request);
        }
        if let Some(command) = end.command() {
            bridge.command(now_ns, &command);
        }
    }

    /// Publishes the bridge's state to all observers; false if that failed.
    fn publish(&self, bridge: &PyBridge) -> bool {
        self.0.end().is_some_and(|end| end.publish(bridge.lock().state()))
    }

    /// Leaves the shared memory.
    fn close(&mut self) {
        self.0.close();
    }
}

/// A controller of a running bridge, or an observer that only watches and operates it; a bridge has
/// one controller.
#[pyclass(name = "Controller", module = "sarrus.can")]
pub(crate) struct PyController {
    place: Place<End>,
    /// Of the last command.
    sequence: AtomicU64,
    /// Of the robot that commands are computed with, and of the bridge's.
    fingerprint: Option<u64>,
    of_bridge: OnceLock<u64>,
}

enum End {
    Controller(ControllerEnd),
    Observer(ObserverEnd, CommandsEnd),
}

#[pymethods]
impl PyController {
    /// Opens the services of a bridge; with `watch` it can command nothing. `fingerprint` is that
    /// of the robot that commands are computed with, `robot.fingerprint`; a bridge with a robot
    /// refuses commands for another one. A bridge that does not run or has a controller is an
    /// `OSError`.
    #[new]
    #[pyo3(signature = (name = "default", *, fingerprint = None, watch = false))]
    fn new(name: &str, fingerprint: Option<u64>, watch: bool) -> PyResult<PyController> {
        let place = Place::enter(name, |node, name| match watch {
            true => {
                let commands = CommandsEnd::open(node, name)?;
                Ok(End::Observer(ObserverEnd::open(node, name)?, commands))
            }
            false => ControllerEnd::open(node, name).map(End::Controller),
        })
        .map_err(os_error)?;
        let sequence = AtomicU64::new(0);
        Ok(PyController { place, sequence, fingerprint, of_bridge: OnceLock::new() })
    }

    /// Sends a command for all actuators; false where it could not be sent.
    ///
    /// Defaults of the arguments: the next sequence, the monotonic time, the controller's
    /// fingerprint, and zeros, but for the position of a stiffness. `stamp_ns` is the time at which
    /// the command was computed. Without any fingerprint the command is for a bridge without a
    /// robot; for another one that is a `ValueError`.
    #[pyo3(signature = (
        sequence = None, stamp_ns = None, fingerprint = None, position = None, velocity = None,
        effort = None, stiffness = None, damping = None
    ))]
    fn command(
        &self,
        sequence: Option<u64>,
        stamp_ns: Option<u64>,
        fingerprint: Option<u64>,
        position: Option<Vec<f64>>,
        velocity: Option<Vec<f64>>,
        effort: Option<Vec<f64>>,
        stiffness: Option<Vec<f64>>,
        damping: Option<Vec<f64>>,
    ) -> PyResult<bool> {
        let given = [position, velocity, effort, stiffness, damping];
        let n = given.iter().flatten().next().map(Vec::len);
        let n = n.ok_or_else(|| PyValueError::new_err("a command without any numbers"))?;
        let [position, _, _, stiffness, _] = &given;
        if position.is_none() && stiffness.iter().flatten().any(|k| *k != 0.0) {
            return Err(PyValueError::new_err(
                "a stiffness pulls to a position: give both, such as the one of `state`",
            ));
        }
        let numbers = given.map(|numbers| numbers.unwrap_or_else(|| vec![0.0; n]));
        let sequence = sequence.unwrap_or_else(|| self.sequence.load(Relaxed) + 1);
        let stamp_ns = stamp_ns.unwrap_or_else(monotonic_ns);
        let fingerprint = match (fingerprint.or(self.fingerprint), self.of_bridge.get()) {
            (Some(fingerprint), _) => fingerprint,
            (None, Some(0)) => 0,
            (None, Some(robot)) => {
                return Err(PyValueError::new_err(format!(
                    "the bridge has the robot {robot:016x}: give the `fingerprint` of the robot \
                     that the command was computed with, such as `robot.fingerprint`"
                )));
            }
            (None, None) => {
                return Err(PyValueError::new_err(
                    "the fingerprint is not known before the first `state`; ask for that, or give \
                     it",
                ));
            }
        };
        let numbers = numbers.each_ref().map(Vec::as_slice);
        let command = command(sequence, stamp_ns, fingerprint, numbers)?;
        match self.place.end() {
            Some(End::Controller(end)) => {
                self.sequence.store(sequence, Relaxed);
                Ok(end.send(&command))
            }
            _ => Err(PyOSError::new_err(
                "an observer (`watch=True`), a closed controller and one of the process from which \
                 this one was forked cannot command",
            )),
        }
    }

    /// Asks the bridge to `arm`, `disarm` or `reset` all mechanisms, or the one that an actuator
    /// acts on, by its place in u; false where that could not be sent.
    #[pyo3(signature = (stamp_ns, operation, actuator = None))]
    fn operate(&self, stamp_ns: u64, operation: &str, actuator: Option<u32>) -> PyResult<bool> {
        let operation = operation_of(operation)?;
        let actuator = actuator.map_or(0, |actuator| actuator.saturating_add(1));
        let request = OperatorRequest { stamp_ns, operation: operation as u32, actuator };
        Ok(self.observer().is_some_and(|end| end.operate(&request)))
    }

    /// The newest state of the bridge by field, once; `None` without a new one.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(state) = self.observer().and_then(ObserverEnd::state) else { return Ok(None) };
        // a bridge keeps its model as long as it lives
        let _ = self.of_bridge.set(state.fingerprint);
        state_fields(py, &state).map(Some)
    }

    /// With `watch`, the numbers of the newest command to the bridge by field, once; `None` without
    /// a new one.
    fn commanded<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(End::Observer(_, commands)) = self.place.end() else {
            return Err(PyOSError::new_err("only an observer (`watch=True`) sees commands"));
        };
        commands.command().map(|command| command_fields(py, command)).transpose()
    }

    /// Leaves the shared memory.
    fn close(&mut self) {
        self.place.close();
    }
}

impl PyController {
    fn observer(&self) -> Option<&ObserverEnd> {
        match self.place.end()? {
            End::Controller(end) => Some(end.observer()),
            End::Observer(end, _) => Some(end),
        }
    }
}

fn os_error(error: ServiceError) -> PyErr {
    PyOSError::new_err(error.to_string())
}
