//! Client of a CAN bridge: commands of a controller; states, statistics and operations of
//! observers.

use sarrus_proto::actuators::{ActuatorCommand, ActuatorState, Operation, OperatorRequest};
use sarrus_proto::bridge::{ControllerEnd, ObserverEnd};
use sarrus_proto::heartbeat::monotonic_ns;
use sarrus_proto::service::ServiceError;
use sarrus_proto::watch::BridgeStatistics;
use sarrus_proto::{Domain, DomainError, DomainNode, Node, ServerName};

use crate::ConnectError;

/// The controller of a bridge; a bridge has one at a time.
///
/// A state older than a few cycles means that the bridge is gone: check its stamp. Commands must
/// keep coming: without one for T1 of the configuration the actuators are damped, for T2 disabled.
#[derive(Debug)]
pub struct Controller {
    end: ControllerEnd,
    fingerprint: u64,
    sequence: u64,
    _place: Place,
}

/// An observer of a bridge, which may also operate it.
#[derive(Debug)]
pub struct Observer {
    end: ObserverEnd,
    _place: Place,
}

impl Controller {
    /// Connects to a running bridge, with the fingerprint of the model that commands are computed
    /// with (0 where the bridge has none).
    ///
    /// # Errors
    /// No bridge of this name runs, or it has a controller.
    pub fn connect(name: &str, fingerprint: u64) -> Result<Controller, ConnectError> {
        let (end, place) = Place::enter(name, ControllerEnd::open)?;
        Ok(Controller { end, fingerprint, sequence: 0, _place: place })
    }

    /// Sends a command; its sequence, stamp and fingerprint are filled in. False if it could not be
    /// sent.
    pub fn send(&mut self, command: &mut ActuatorCommand) -> bool {
        self.sequence += 1;
        command.sequence = self.sequence;
        command.stamp_ns = now_ns();
        command.fingerprint = self.fingerprint;
        self.end.send(command)
    }

    /// The newest state of the actuators, once.
    pub fn state(&self) -> Option<ActuatorState> {
        self.end.observer().state()
    }

    /// Requests an operation; returns the time of the request `[ns]`, after which states may show
    /// it. Repeat the request until a state shows it: the first one can get lost before the bridge
    /// has discovered this program.
    pub fn operate(&self, operation: Operation) -> u64 {
        operate(self.end.observer(), operation, None)
    }

    /// Requests an operation of the mechanism that an actuator acts on, by its place in u.
    pub fn operate_mechanism(&self, operation: Operation, actuator: usize) -> u64 {
        operate(self.end.observer(), operation, Some(actuator))
    }
}

impl Observer {
    /// Connects to a running bridge.
    ///
    /// # Errors
    /// No bridge of this name runs, or too many watch it.
    pub fn connect(name: &str) -> Result<Observer, ConnectError> {
        let (end, place) = Place::enter(name, ObserverEnd::open)?;
        Ok(Observer { end, _place: place })
    }

    /// The newest state of the actuators, once.
    pub fn state(&self) -> Option<ActuatorState> {
        self.end.state()
    }

    /// The newest statistics, once; the bridge publishes them twice a second.
    pub fn statistics(&self) -> Option<BridgeStatistics> {
        self.end.statistics()
    }

    /// Requests an operation; returns the time of the request `[ns]`, after which states may show
    /// it. Repeat the request until a state shows it: the first one can get lost before the bridge
    /// has discovered this program.
    pub fn operate(&self, operation: Operation) -> u64 {
        operate(&self.end, operation, None)
    }

    /// Requests an operation of the mechanism that an actuator acts on, by its place in u.
    pub fn operate_mechanism(&self, operation: Operation, actuator: usize) -> u64 {
        operate(&self.end, operation, Some(actuator))
    }
}

fn operate(end: &ObserverEnd, operation: Operation, actuator: Option<usize>) -> u64 {
    let stamp_ns = now_ns();
    let actuator = actuator.map_or(0, |actuator| u32::try_from(actuator + 1).unwrap_or(u32::MAX));
    end.operate(&OperatorRequest { stamp_ns, operation: operation as u32, actuator });
    stamp_ns
}

fn refused(name: &str, error: ServiceError) -> ConnectError {
    match error {
        ServiceError::NoBridge { .. } => ConnectError::NoBridge { name: name.to_owned() },
        ServiceError::OtherVersion { .. } => ConnectError::WrongVersion { found: 0 },
        ServiceError::Full { limit, .. } => ConnectError::NoFreeSlot {
            transport: "places at the bridge",
            limit,
            help: "end the other controller or observers",
        },
        other => ConnectError::Service(other),
    }
}

/// CLOCK_MONOTONIC, which all processes of a machine share and stamps are in `[ns]`.
pub fn now_ns() -> u64 {
    monotonic_ns()
}

/// This process's node in the shared memory, dropped before its files are removed.
#[derive(Debug)]
struct Place {
    node: Option<DomainNode>,
    domain: Domain,
}

impl Place {
    /// A node, and the end of a bridge's services that `open` returns for it.
    fn enter<E>(
        name: &str,
        open: fn(&Node, &ServerName) -> Result<E, ServiceError>,
    ) -> Result<(E, Place), ConnectError> {
        let of_domain = |error: DomainError| ConnectError::Service(ServiceError::Domain(error));
        let server = ServerName::new(name).map_err(of_domain)?;
        let domain = Domain::of_user().map_err(of_domain)?;
        let node = domain.node().map_err(of_domain)?;
        let end = open(&node, &server).map_err(|error| refused(name, error))?;
        Ok((end, Place { node: Some(node), domain }))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.node = None;
        self.domain.tidy();
    }
}
