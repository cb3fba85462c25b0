//! The services of one server, with their settings: made by the server, opened by its clients.

use core::fmt::Debug;

use iceoryx2::identifiers::UniqueClientId;
use iceoryx2::node::Node;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{
    BackpressureStrategy, CallbackProgression, PortFactory, Service, ServiceName, ZeroCopySend,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseOpenError, RequestResponseOpenOrCreateError,
};
use iceoryx2::service::port_factory::client::ClientCreateError;
use iceoryx2::service::port_factory::request_response;
use iceoryx2::service::port_factory::server::ServerCreateError;

use crate::lane::{ComputeClient, Threadsafe};
use crate::message::{
    ComputeRequest, ComputeResponse, ControlRequest, ControlResponse, MAX_REQUEST_CLIENTS,
};
use crate::{DomainError, PROTOCOL_VERSION, ServerName};

/// The node of a process, or of a part of it, in shared memory; each connected robot is one.
pub type NodeId = iceoryx2::identifiers::UniqueNodeId;
/// A server's port of the control service.
pub type ControlServer = Server<Threadsafe, ControlRequest, (), ControlResponse, ()>;
/// A client's port of the control service.
pub type ControlClient = Client<Threadsafe, ControlRequest, (), ControlResponse, ()>;
/// A server's port of the service.
pub type ComputeServer<S> = Server<S, ComputeRequest, (), ComputeResponse, ()>;

type Factory<S, Q, R> = request_response::PortFactory<S, Q, (), R, ()>;

/// Clients that can talk to the control service at one time.
const MAX_CONTROL_CLIENTS: usize = 32;

/// Why a service cannot be made or opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServiceError {
    /// Nobody serves under this name.
    #[error(
        "`{service}` is not there: no server runs under this name; start one with `sarrus serve \
         --name NAME`"
    )]
    Absent {
        /// Name of the service.
        service: String,
    },
    /// No bridge runs under this name.
    #[error(
        "`{service}` is not there: no bridge runs under this name; start one with `sarrus-can run \
         CONFIG --name NAME`"
    )]
    NoBridge {
        /// Name of the service.
        service: String,
    },
    /// Another server has this name.
    #[error("`{service}` is served already; stop the other server or choose another --name")]
    Taken {
        /// Name of the service.
        service: String,
    },
    /// All ports are in use.
    #[error(
        "`{service}` has no port left, expected fewer than {limit} clients; close some or use \
         another server"
    )]
    Full {
        /// Name of the service.
        service: String,
        /// How many ports there are.
        limit: usize,
    },
    /// The service was made by another version of sarrus.
    #[error(
        "`{service}` has other payloads, expected those of protocol version {version}; use client \
         and server of one version"
    )]
    OtherVersion {
        /// Name of the service.
        service: String,
        /// The version of this side.
        version: u32,
    },
    /// The writer before died and left the entry locked: the lane is of no more use.
    #[error("`{service}` is locked by a process that died; attach again for a fresh lane")]
    Locked {
        /// Name of the service.
        service: String,
    },
    /// Something else is wrong with the shared memory.
    #[error(
        "`{service}`: {reason}; if it stays so, stop all servers and clients and remove what is \
         left in /dev/shm"
    )]
    Memory {
        /// Name of the service.
        service: String,
        /// What the transport says.
        reason: String,
    },
    /// The name cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

impl ServiceError {
    pub(crate) fn memory(service: &ServiceName, reason: &dyn Debug) -> ServiceError {
        ServiceError::Memory { service: service.to_string(), reason: format!("{reason:?}") }
    }

    fn of_open(
        service: &ServiceName,
        error: RequestResponseOpenError,
        limit: usize,
    ) -> ServiceError {
        use RequestResponseOpenError as E;
        let service_name = service.to_string();
        match error {
            E::DoesNotExist | E::IsMarkedForDestruction => {
                ServiceError::Absent { service: service_name }
            }
            E::ExceedsMaxNumberOfNodes => ServiceError::Full { service: service_name, limit },
            E::IncompatibleRequestOrResponseType
            | E::IncompatibleMessagingPattern
            | E::DoesNotSupportRequestedAmountOfClients
            | E::DoesNotSupportRequestedAmountOfNodes => {
                ServiceError::OtherVersion { service: service_name, version: PROTOCOL_VERSION }
            }
            other => ServiceError::memory(service, &other),
        }
    }
}

/// The control service, served: only one server can have it, also when clients of a dead one still
/// hold it.
pub fn serve_control(
    node: &Node<Threadsafe>,
    name: &ServerName,
) -> Result<(ControlServer, ControlCallers), ServiceError> {
    let service = name.control()?;
    let factory = request_response_service(node, &service, MAX_CONTROL_CLIENTS)?;
    Ok((serve(&factory, &service)?, ControlCallers { factory }))
}

/// Who calls the control service.
pub struct ControlCallers {
    factory: Factory<Threadsafe, ControlRequest, ControlResponse>,
}

impl ControlCallers {
    /// The node of a caller; `None` when it is gone.
    pub fn node_of(&self, caller: UniqueClientId) -> Option<NodeId> {
        let mut node = None;
        self.factory.dynamic_config().list_clients(|client| match client.client_id == caller {
            true => {
                node = Some(client.node_id);
                CallbackProgression::Stop
            }
            false => CallbackProgression::Continue,
        });
        node
    }
}

/// The service of a run of the server, served.
pub fn serve_compute<S: Service>(
    node: &Node<S>,
    name: &ServerName,
    instance: u64,
) -> Result<ComputeServer<S>, ServiceError> {
    let service = name.compute(instance)?;
    let factory = request_response_service(node, &service, MAX_REQUEST_CLIENTS)?;
    serve(&factory, &service)
}

/// A port of the control service.
pub fn open_control(
    node: &Node<Threadsafe>,
    name: &ServerName,
) -> Result<ControlClient, ServiceError> {
    connect(node, &name.control()?, MAX_CONTROL_CLIENTS)
}

/// A port of the service.
pub fn open_compute<S: Service>(
    node: &Node<S>,
    name: &ServerName,
    instance: u64,
) -> Result<ComputeClient<S>, ServiceError> {
    connect(node, &name.compute(instance)?, MAX_REQUEST_CLIENTS)
}

fn request_response_service<S: Service, Q, R>(
    node: &Node<S>,
    service: &ServiceName,
    clients: usize,
) -> Result<Factory<S, Q, R>, ServiceError>
where
    Q: Debug + ZeroCopySend + 'static,
    R: Debug + ZeroCopySend + 'static,
{
    // one request of each client under way, nothing overwritten, nothing sent to nobody: no request
    // is lost in silence
    node.service_builder(service)
        .request_response::<Q, R>()
        .max_servers(1)
        .max_clients(clients)
        .max_nodes(clients + 8)
        .max_active_requests_per_client(1)
        .max_loaned_requests(1)
        .max_response_buffer_size(1)
        .max_borrowed_responses_per_pending_response(1)
        .enable_safe_overflow_for_requests(false)
        .enable_safe_overflow_for_responses(false)
        .enable_fire_and_forget_requests(false)
        .open_or_create()
        .map_err(|error| match error {
            RequestResponseOpenOrCreateError::RequestResponseOpenError(error) => {
                ServiceError::of_open(service, error, clients)
            }
            other => ServiceError::memory(service, &other),
        })
}

fn serve<S: Service, Q, R>(
    factory: &Factory<S, Q, R>,
    service: &ServiceName,
) -> Result<Server<S, Q, (), R, ()>, ServiceError>
where
    Q: Debug + ZeroCopySend + 'static,
    R: Debug + ZeroCopySend + 'static,
{
    // a client that went away must not hold the server up
    let builder = factory
        .server_builder()
        .max_loaned_responses_per_request(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData);
    builder.create().map_err(|error| match error {
        ServerCreateError::ExceedsMaxSupportedServers => {
            ServiceError::Taken { service: service.to_string() }
        }
        other => ServiceError::memory(service, &other),
    })
}

fn connect<S: Service, Q, R>(
    node: &Node<S>,
    service: &ServiceName,
    limit: usize,
) -> Result<Client<S, Q, (), R, ()>, ServiceError>
where
    Q: Debug + ZeroCopySend + 'static,
    R: Debug + ZeroCopySend + 'static,
{
    let factory = node
        .service_builder(service)
        .request_response::<Q, R>()
        .open()
        .map_err(|error| ServiceError::of_open(service, error, limit))?;
    let builder = factory.client_builder().backpressure_strategy(BackpressureStrategy::DiscardData);
    builder.create().map_err(|error| match error {
        ClientCreateError::ExceedsMaxSupportedClients => {
            ServiceError::Full { service: service.to_string(), limit }
        }
        other => ServiceError::memory(service, &other),
    })
}
