//! Client of a CAN bridge: commands of a controller; states, statistics and operations of
//! observers.

use sarrus_proto::actuators::{ActuatorCommand, ActuatorState, Operation, OperatorRequest};
use sarrus_proto::bridge::{ControllerEnd, ObserverEnd, Place};
use sarrus_proto::heartbeat::monotonic_ns;
use sarrus_proto::service::ServiceError;
use sarrus_proto::watch::BridgeStatistics;

use crate::ConnectError;

/// The controller of a bridge; a bridge has one at a time.
///
/// A state older than a few cycles means that the bridge is gone: check its stamp. Commands must
/// keep coming: without one for T1 of the configuration the actuators are damped, for T2 disabled.
/// A child of `fork` sends and reads nothing through the controller of its parent.
#[derive(Debug)]
pub struct Controller {
    place: Place<ControllerEnd>,
    fingerprint: u64,
    sequence: u64,
}

/// An observer of a bridge, which may also operate it; a child of `fork` as for a [`Controller`].
#[derive(Debug)]
pub struct Observer {
    place: Place<ObserverEnd>,
}

impl Controller {
    /// Connects to a running bridge, with the fingerprint of the model that commands are computed
    /// with (0 where the bridge has none).
    ///
    /// # Errors
    /// No bridge of this name runs, or it has a controller.
    pub fn connect(name: &str, fingerprint: u64) -> Result<Controller, ConnectError> {
        let place = Place::enter(name, ControllerEnd::open).map_err(|why| refused(name, why))?;
        Ok(Controller { place, fingerprint, sequence: 0 })
    }

    /// Sends a command; its sequence, stamp and fingerprint are filled in. False if it could not be
    /// sent.
    pub fn send(&mut self, command: &mut ActuatorCommand) -> bool {
        self.sequence += 1;
        command.sequence = self.sequence;
        command.stamp_ns = now_ns();
        command.fingerprint = self.fingerprint;
        self.place.end().is_some_and(|end| end.send(command))
    }

    /// The newest state of the actuators, once.
    pub fn state(&self) -> Option<ActuatorState> {
        self.observer()?.state()
    }

    fn observer(&self) -> Option<&ObserverEnd> {
        self.place.end().map(ControllerEnd::observer)
    }

    /// Requests an operation; returns the time of the request `[ns]`, after which states may show
    /// it. Repeat the request until a state shows it: the first one can get lost before the bridge
    /// has discovered this program.
    pub fn operate(&self, operation: Operation) -> u64 {
        operate(self.observer(), operation, None)
    }

    /// Requests an operation of the mechanism that an actuator acts on, by its place in u.
    pub fn operate_mechanism(&self, operation: Operation, actuator: usize) -> u64 {
        operate(self.observer(), operation, Some(actuator))
    }
}

impl Observer {
    /// Connects to a running bridge.
    ///
    /// # Errors
    /// No bridge of this name runs, or too many watch it.
    pub fn connect(name: &str) -> Result<Observer, ConnectError> {
        let place = Place::enter(name, ObserverEnd::open).map_err(|why| refused(name, why))?;
        Ok(Observer { place })
    }

    /// The newest state of the actuators, once.
    pub fn state(&self) -> Option<ActuatorState> {
        self.place.end()?.state()
    }

    /// The newest statistics, once; the bridge publishes them twice a second.
    pub fn statistics(&self) -> Option<BridgeStatistics> {
        self.place.end()?.statistics()
    }

    /// Requests an operation; returns the time of the request `[ns]`, after which states may show
    /// it. Repeat the request until a state shows it: the first one can get lost before the bridge
    /// has discovered this program.
    pub fn operate(&self, operation: Operation) -> u64 {
        operate(self.place.end(), operation, None)
    }

    /// Requests an operation of the mechanism that an actuator acts on, by its place in u.
    pub fn operate_mechanism(&self, operation: Operation, actuator: usize) -> u64 {
        operate(self.place.end(), operation, Some(actuator))
    }
}

fn operate(end: Option<&ObserverEnd>, operation: Operation, actuator: Option<usize>) -> u64 {
    let stamp_ns = now_ns();
    let actuator = actuator.map_or(0, |actuator| u32::try_from(actuator + 1).unwrap_or(u32::MAX));
    if let Some(end) = end {
        end.operate(&OperatorRequest { stamp_ns, operation: operation as u32, actuator });
    }
    stamp_ns
}

fn refused(name: &str, error: ServiceError) -> ConnectError {
    let full = ["places at the bridge", "end the other controller or observers"];
    match error {
        ServiceError::NoBridge(_) => ConnectError::NoBridge(name.to_owned()),
        other => ConnectError::of_service(other, full),
    }
}

/// CLOCK_MONOTONIC, which all processes of a machine share and stamps are in `[ns]`.
pub fn now_ns() -> u64 {
    monotonic_ns()
}
