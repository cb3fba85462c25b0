//! The services of one CAN bridge: commands in, states and statistics out, operations from
//! controllers and observers.
//!
//! The newest sample wins: a subscriber has room for one, and a later command replaces an unread
//! one. Only operations queue.

use core::fmt::Debug;
use std::time::Duration;

use iceoryx2::node::{NodeState, NodeView};
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::prelude::{BackpressureStrategy, CallbackProgression, ServiceName, ZeroCopySend};
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use iceoryx2::service::port_factory::{PortFactory, publish_subscribe};

use crate::actuators::{ActuatorCommand, ActuatorState, OperatorRequest};
use crate::lane::Threadsafe;
use crate::service::ServiceError;
use crate::watch::BridgeStatistics;
use crate::{Domain, DomainNode, Node, PROTOCOL_VERSION, ServerName, process_number};

/// Processes that may watch one bridge.
const MAX_OBSERVERS: usize = 32;
/// Number of polls for the statistics of a running bridge, and the time between two.
const OWNER_LOOKS: usize = 60;
const OWNER_PAUSE: Duration = Duration::from_millis(20);
/// Operations that may wait for the bridge's next cycle.
const OPERATIONS: usize = 8;

type Factory<T> = publish_subscribe::PortFactory<Threadsafe, T, ()>;
type Sending<T> = Box<dyn Sender<T>>;
type Receiving<T> = Box<dyn Receiver<T>>;

trait Sender<T>: Debug + Send + Sync {
    /// False if the sample could not be sent.
    fn send(&self, sample: &T) -> bool;
}

trait Receiver<T>: Debug + Send + Sync {
    /// The next sample.
    fn next(&self) -> Option<T>;

    /// The newest sample, once.
    fn newest(&self) -> Option<T> {
        let mut newest = None;
        while let Some(sample) = self.next() {
            newest = Some(sample);
        }
        newest
    }
}

impl<T: Copy + Debug + ZeroCopySend + 'static> Sender<T> for Publisher<Threadsafe, T, ()> {
    fn send(&self, sample: &T) -> bool {
        self.send_copy(*sample).is_ok()
    }
}

impl<T: Copy + Debug + ZeroCopySend + 'static> Receiver<T> for Subscriber<Threadsafe, T, ()> {
    fn next(&self) -> Option<T> {
        self.receive().ok().flatten().map(|sample| *sample)
    }
}

/// The commands to a bridge, seen by another process than the bridge.
#[derive(Debug)]
pub struct CommandsEnd {
    commands: Receiving<ActuatorCommand>,
}

/// The bridge's side.
#[derive(Debug)]
pub struct BridgeEnd {
    commands: Receiving<ActuatorCommand>,
    operations: Receiving<OperatorRequest>,
    states: Sending<ActuatorState>,
    statistics: Sending<BridgeStatistics>,
}

/// A controller's side; a bridge has one controller at a time.
#[derive(Debug)]
pub struct ControllerEnd {
    commands: Sending<ActuatorCommand>,
    observer: ObserverEnd,
}

/// An observer's side, which may also operate.
#[derive(Debug)]
pub struct ObserverEnd {
    operations: Sending<OperatorRequest>,
    states: Receiving<ActuatorState>,
    statistics: Receiving<BridgeStatistics>,
}

impl BridgeEnd {
    /// Makes the services of a bridge.
    ///
    /// # Errors
    /// Another bridge has this name, or the shared memory is faulty.
    pub fn create(node: &Node, name: &ServerName) -> Result<BridgeEnd, ServiceError> {
        let services = names(name)?;
        let [commands, operations, states, statistics] = &services;
        // ports that only one bridge can hold come first
        let states = sender(&make(node, states, 1, MAX_OBSERVERS, 1)?, states, 1)
            .map_err(|error| taken(node, name, commands, error, true))?;
        let statistics = sender(&make(node, statistics, 1, MAX_OBSERVERS, 1)?, statistics, 1)?;
        let commands = receiver(&make(node, commands, 1, 1 + MAX_OBSERVERS, 1)?, commands, 1)?;
        let operations =
            receiver(&make(node, operations, MAX_OBSERVERS, 1, OPERATIONS)?, operations, 1)?;
        Ok(BridgeEnd { commands, operations, states, statistics })
    }

    /// The newest command, once.
    pub fn command(&self) -> Option<ActuatorCommand> {
        self.commands.newest()
    }

    /// The next operation.
    pub fn operation(&self) -> Option<OperatorRequest> {
        self.operations.next()
    }

    /// Publishes the state; false on failure.
    pub fn publish(&self, state: &ActuatorState) -> bool {
        self.states.send(state)
    }

    /// Publishes the statistics; false on failure.
    pub fn publish_statistics(&self, statistics: &BridgeStatistics) -> bool {
        self.statistics.send(statistics)
    }
}

impl ControllerEnd {
    /// Opens the services of a running bridge.
    ///
    /// # Errors
    /// No bridge of this name runs, it has a controller, or the shared memory is faulty.
    pub fn open(node: &Node, name: &ServerName) -> Result<ControllerEnd, ServiceError> {
        let [commands, ..] = &names(name)?;
        Ok(ControllerEnd {
            commands: sender(&open(node, commands)?, commands, 1)
                .map_err(|error| taken(node, name, commands, error, false))?,
            observer: ObserverEnd::open(node, name)?,
        })
    }

    /// Sends a command; false on failure.
    pub fn send(&self, command: &ActuatorCommand) -> bool {
        self.commands.send(command)
    }

    /// The controller's view of states and statistics, and its operations.
    pub fn observer(&self) -> &ObserverEnd {
        &self.observer
    }
}

impl ObserverEnd {
    /// Opens the services of a running bridge.
    ///
    /// # Errors
    /// No bridge of this name runs, it has too many observers, or the shared memory is faulty.
    pub fn open(node: &Node, name: &ServerName) -> Result<ObserverEnd, ServiceError> {
        let [_, operations, states, statistics] = &names(name)?;
        Ok(ObserverEnd {
            operations: sender(&open(node, operations)?, operations, MAX_OBSERVERS)?,
            states: receiver(&open(node, states)?, states, MAX_OBSERVERS)?,
            statistics: receiver(&open(node, statistics)?, statistics, MAX_OBSERVERS)?,
        })
    }

    /// The newest state, once.
    pub fn state(&self) -> Option<ActuatorState> {
        self.states.newest()
    }

    /// The newest statistics, once.
    pub fn statistics(&self) -> Option<BridgeStatistics> {
        self.statistics.newest()
    }

    /// Requests an operation; false if it could not be sent.
    pub fn operate(&self, request: &OperatorRequest) -> bool {
        self.operations.send(request)
    }
}

impl CommandsEnd {
    /// Sees the commands to a running bridge, from now on.
    ///
    /// # Errors
    /// As [`ObserverEnd::open`].
    pub fn open(node: &Node, name: &ServerName) -> Result<CommandsEnd, ServiceError> {
        let [commands, ..] = &names(name)?;
        Ok(CommandsEnd { commands: receiver(&open(node, commands)?, commands, MAX_OBSERVERS)? })
    }

    /// The newest command, once.
    pub fn command(&self) -> Option<ActuatorCommand> {
        self.commands.newest()
    }
}

/// An end of a bridge's services with the node of this process, dropped before its files are
/// removed.
#[derive(Debug)]
pub struct Place<E> {
    end: Option<E>,
    node: Option<DomainNode>,
    domain: Domain,
    /// [`process_number`] of the owner.
    process: u64,
}

impl<E> Place<E> {
    /// A node in the domain of this user, and the end of a bridge's services that `open` returns
    /// for it.
    ///
    /// # Errors
    /// The name or the domain cannot be used; else those of `open`.
    pub fn enter(
        name: &str,
        open: impl FnOnce(&Node, &ServerName) -> Result<E, ServiceError>,
    ) -> Result<Place<E>, ServiceError> {
        let name = ServerName::new(name)?;
        let domain = Domain::of_user()?;
        let node = domain.node()?;
        let end = Some(open(&node, &name)?);
        Ok(Place { end, node: Some(node), domain, process: process_number() })
    }

    /// The end; `None` after [`Place::close`], and in a child of the process that entered.
    pub fn end(&self) -> Option<&E> {
        self.end.as_ref().filter(|_| process_number() == self.process)
    }

    /// Leaves the shared memory.
    pub fn close(&mut self) {
        if process_number() != self.process {
            // end and node are still the parent's
            return std::mem::forget((self.end.take(), self.node.take()));
        }
        self.end = None;
        if self.node.take().is_some() {
            self.domain.tidy();
        }
    }
}

impl<E> Drop for Place<E> {
    fn drop(&mut self) {
        self.close();
    }
}

fn names(name: &ServerName) -> Result<[ServiceName; 4], ServiceError> {
    let [commands, operations, states, statistics] =
        ["command", "operation", "state", "statistics"].map(|part| name.bridge(part));
    Ok([commands?, operations?, states?, statistics?])
}

/// Makes a service, or opens the one of a dead bridge that others still hold.
fn make<T: Debug + ZeroCopySend + 'static>(
    node: &Node,
    service: &ServiceName,
    publishers: usize,
    subscribers: usize,
    room: usize,
) -> Result<Factory<T>, ServiceError> {
    let builder = node.inner().service_builder(service).publish_subscribe::<T>();
    let builder = builder
        .max_publishers(publishers)
        .max_subscribers(subscribers)
        .max_nodes(MAX_OBSERVERS + 2);
    let builder = builder
        .subscriber_max_buffer_size(room)
        .history_size(0)
        .enable_safe_overflow(true)
        .subscriber_max_borrowed_samples(1);
    builder.open_or_create().map_err(|error| ServiceError::memory(service, &error))
}

fn open<T: Debug + ZeroCopySend + 'static>(
    node: &Node,
    service: &ServiceName,
) -> Result<Factory<T>, ServiceError> {
    use PublishSubscribeOpenError as E;
    let name = || service.to_string();
    node.inner().service_builder(service).publish_subscribe::<T>().open().map_err(|error| {
        match error {
            E::DoesNotExist | E::IsMarkedForDestruction => ServiceError::NoBridge(name()),
            E::IncompatibleTypes => ServiceError::OtherVersion(name(), PROTOCOL_VERSION),
            E::ExceedsMaxNumberOfNodes => ServiceError::Full(name(), MAX_OBSERVERS + 2),
            other => ServiceError::memory(service, &other),
        }
    })
}

fn sender<T: Copy + Debug + ZeroCopySend + 'static>(
    factory: &Factory<T>,
    service: &ServiceName,
    limit: usize,
) -> Result<Sending<T>, ServiceError> {
    let builder = factory
        .publisher_builder()
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData);
    let port = builder.create().map_err(|error| match error {
        PublisherCreateError::ExceedsMaxSupportedPublishers => {
            ServiceError::Full(service.to_string(), limit)
        }
        other => ServiceError::memory(service, &other),
    })?;
    Ok(Box::new(port))
}

fn receiver<T: Copy + Debug + ZeroCopySend + 'static>(
    factory: &Factory<T>,
    service: &ServiceName,
    limit: usize,
) -> Result<Receiving<T>, ServiceError> {
    let port = factory.subscriber_builder().create().map_err(|error| match error {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
            ServiceError::Full(service.to_string(), limit)
        }
        other => ServiceError::memory(service, &other),
    })?;
    Ok(Box::new(port))
}

/// The error for an end that another process holds, with the name of that process. The service of
/// commands lists the bridge, its controller and those who see commands, but no other observers.
fn taken(
    node: &Node,
    name: &ServerName,
    commands: &ServiceName,
    error: ServiceError,
    is_bridge: bool,
) -> ServiceError {
    if !matches!(error, ServiceError::Full(..)) {
        return error;
    }
    let bridge = process_of_bridge(node, name);
    let mut owners = Vec::new();
    let holders = open::<ActuatorCommand>(node, commands).ok();
    let _ = holders.map(|commands| {
        commands.nodes(|state| {
            if let NodeState::Alive(holder) = state
                && holder.id() != node.inner().id()
                && let Some(details) = holder.details()
            {
                let process = u64::from(details.process_id().value().unsigned_abs());
                if bridge.is_none_or(|bridge| (process == bridge) == is_bridge) {
                    owners.push(format!("process {process} ({})", details.executable()));
                }
            }
            CallbackProgression::Continue
        })
    });
    let owner = match owners.is_empty() {
        true => "a process that does not say who it is".to_owned(),
        false => owners.join(" or "),
    };
    let name = name.as_str().to_owned();
    match is_bridge {
        true => ServiceError::BridgeRuns(name, owner),
        false => ServiceError::HasController(name, owner),
    }
}

/// The process of a running bridge, from the statistics that it publishes twice a second.
fn process_of_bridge(node: &Node, name: &ServerName) -> Option<u64> {
    let observer = ObserverEnd::open(node, name).ok()?;
    (0..OWNER_LOOKS).find_map(|_| {
        std::thread::sleep(OWNER_PAUSE);
        observer.statistics().map(|statistics| statistics.process)
    })
}
