//! The service of one client, with its settings: made by the server, opened by the client.

use core::fmt::Debug;

use iceoryx2::node::Node;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{BackpressureStrategy, Service, ServiceName};
use iceoryx2::service::builder::request_response::RequestResponseOpenError;
use iceoryx2::service::port_factory::request_response;

use crate::lane::ComputeClient;
use crate::message::{ComputeRequest, ComputeResponse};
use crate::{DomainError, PROTOCOL_VERSION};

/// A server's port of the service.
pub type ComputeServer<S> = Server<S, ComputeRequest, (), ComputeResponse, ()>;

type Factory<S> = request_response::PortFactory<S, ComputeRequest, (), ComputeResponse, ()>;

/// Why a service cannot be made or opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServiceError {
    /// No server has this name.
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
    /// A bridge of this name runs.
    #[error(
        "a bridge named `{name}` runs already: {owner}; end it, or give this one another name with \
         --name"
    )]
    BridgeRuns {
        /// Name of the bridge.
        name: String,
        /// Its process.
        owner: String,
    },
    /// The bridge has its controller.
    #[error(
        "the bridge `{name}` has a controller already: {owner}; it takes one at a time, so end \
         that one first"
    )]
    HasController {
        /// Name of the bridge.
        name: String,
        /// The controller's process.
        owner: String,
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
    #[error("`{service}`: {reason}")]
    Memory {
        /// Name of the service.
        service: String,
        /// The transport's error.
        reason: String,
    },
    /// The name cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

impl ServiceError {
    pub(crate) fn memory(service: &ServiceName, reason: &dyn Debug) -> ServiceError {
        ServiceError::Memory { service: service.to_string(), reason: crate::domain::reason(reason) }
    }
}

/// The server's end of the service of one client.
pub fn serve_compute<S: Service>(node: &Node<S>) -> Result<ComputeServer<S>, ServiceError> {
    let service = name()?;
    // one request under way, nothing overwritten: no request is lost in silence
    let factory: Factory<S> = node
        .service_builder(&service)
        .request_response::<ComputeRequest, ComputeResponse>()
        .max_servers(1)
        .max_clients(1)
        .max_nodes(2)
        .max_active_requests_per_client(1)
        .max_loaned_requests(1)
        .max_response_buffer_size(1)
        .max_borrowed_responses_per_pending_response(1)
        .enable_safe_overflow_for_requests(false)
        .enable_safe_overflow_for_responses(false)
        // the transport forgets to release a request whose client is gone unless it may be taken
        // without one; the server looks itself whether the client waits
        .enable_fire_and_forget_requests(true)
        .create()
        .map_err(|error| ServiceError::memory(&service, &error))?;
    // a client that went away must not hold the server up
    let builder = factory
        .server_builder()
        .max_loaned_responses_per_request(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData);
    builder.create().map_err(|error| ServiceError::memory(&service, &error))
}

/// The client's end of its service.
pub fn open_compute<S: Service>(node: &Node<S>) -> Result<ComputeClient<S>, ServiceError> {
    let service = name()?;
    let factory: Factory<S> = node
        .service_builder(&service)
        .request_response::<ComputeRequest, ComputeResponse>()
        .open()
        .map_err(|error| match error {
            RequestResponseOpenError::DoesNotExist
            | RequestResponseOpenError::IsMarkedForDestruction => {
                ServiceError::Absent { service: service.to_string() }
            }
            RequestResponseOpenError::IncompatibleRequestOrResponseType => {
                ServiceError::OtherVersion {
                    service: service.to_string(),
                    version: PROTOCOL_VERSION,
                }
            }
            other => ServiceError::memory(&service, &other),
        })?;
    let builder = factory.client_builder().backpressure_strategy(BackpressureStrategy::DiscardData);
    builder.create().map_err(|error| ServiceError::memory(&service, &error))
}

fn name() -> Result<ServiceName, ServiceError> {
    link_service("compute")
}

/// The name of a service of a link, which needs no other.
pub(crate) fn link_service(name: &'static str) -> Result<ServiceName, ServiceError> {
    ServiceName::new(name).map_err(|error| ServiceError::Memory {
        service: name.to_owned(),
        reason: format!("{error:?}"),
    })
}
