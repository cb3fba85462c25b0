//! The service of one client, with its settings: made by the server, opened by the client.

use core::fmt::Debug;
use core::sync::atomic::AtomicU64;

use iceoryx2::port::server::Server;
use iceoryx2::prelude::{BackpressureStrategy, ServiceName};
use iceoryx2::response::Response;
use iceoryx2::service::builder::request_response::RequestResponseOpenError;
use iceoryx2::service::port_factory::request_response;

use crate::lane::{
    ComputeActive, ComputeClient, ComputePending, Threadsafe, send_request, send_response,
};
use crate::message::{ComputeRequest, ComputeResponse, RequestHead, ResponseHead};
use crate::{DomainError, Node, PROTOCOL_VERSION};

type Factory = request_response::PortFactory<Threadsafe, ComputeRequest, (), ComputeResponse, ()>;

/// The reason why a service cannot be made or opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServiceError {
    /// No server has the name of this service.
    #[error(
        "`{0}` is not there: no server runs under this name; start one with `sarrus serve \
         --name NAME`"
    )]
    Absent(String),
    /// No bridge runs under the name of this service.
    #[error(
        "`{0}` is not there: no bridge runs under this name; start one with `sarrus-can run \
         CONFIG --name NAME`"
    )]
    NoBridge(String),
    /// Another server has this service.
    #[error("`{0}` is served already; stop the other server or choose another --name")]
    Taken(String),
    /// A bridge of this name runs: the name, its process.
    #[error(
        "a bridge named `{0}` runs already: {1}; end it, or give this one another name with \
         --name"
    )]
    BridgeRuns(String, String),
    /// The bridge of this name has its controller: the name, the controller's process.
    #[error(
        "the bridge `{0}` has a controller already: {1}; it takes one at a time, so end \
         that one first"
    )]
    HasController(String, String),
    /// All ports of a service are in use: the service, how many there are.
    #[error(
        "`{0}` has no port left, expected fewer than {1} clients; close some or use \
         another server"
    )]
    Full(String, usize),
    /// The service was made by another version of sarrus: the service, the expected version.
    #[error(
        "`{0}` has other payloads, expected those of protocol version {1}; use client \
         and server of one version"
    )]
    OtherVersion(String, u32),
    /// The previous writer of this service died and left the entry locked: the lane is unusable.
    #[error("`{0}` is locked by a process that died; attach again for a fresh lane")]
    Locked(String),
    /// The shared memory of a service has another fault: the service, the reason.
    #[error("`{0}`: {1}")]
    Memory(String, String),
    /// The name cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

impl ServiceError {
    pub(crate) fn memory(service: &ServiceName, reason: &dyn Debug) -> ServiceError {
        ServiceError::Memory(service.to_string(), crate::domain::reason(reason))
    }
}

/// The server's end of the service of one client.
pub trait ServedService: Send {
    /// Maps the memory of a client that has opened its end. Drops a pending request.
    fn connect(&mut self);

    /// Answers the pending request, if its client still waits for it: `answer` writes the numbers
    /// of the response in place and returns its head, or `None` if the request stays pending. True
    /// if a request was answered; `answer` has not run if the transport had no memory for a
    /// response.
    fn answer(
        &mut self,
        answer: &mut dyn FnMut(&ComputeRequest, &[AtomicU64]) -> Option<ResponseHead>,
    ) -> bool;
}

/// The client's end of its service; one request at a time.
pub trait OpenedService: Send {
    /// Sends a request; false if it was not taken: the last one was not cancelled, or the server is
    /// busy or gone.
    fn send(&mut self, head: &RequestHead, numbers: &[f64]) -> bool;

    /// A response, once each; it may belong to an older request.
    ///
    /// # Errors
    /// [`Disconnected`] if no response can come.
    fn poll(&mut self) -> Result<Option<(ResponseHead, &[AtomicU64])>, Disconnected>;

    /// Ends the last request, answered or not.
    fn cancel(&mut self);
}

/// The server is gone, or there is no request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disconnected;

/// Dropped in this order.
struct Serving {
    pending: Option<ComputeActive>,
    server: Server<Threadsafe, ComputeRequest, (), ComputeResponse, ()>,
}

impl ServedService for Serving {
    fn connect(&mut self) {
        drop(self.server.receive());
    }

    #[inline]
    fn answer(
        &mut self,
        answer: &mut dyn FnMut(&ComputeRequest, &[AtomicU64]) -> Option<ResponseHead>,
    ) -> bool {
        // an error concerns a client that is about to leave
        let found = match self.pending.take() {
            None => self.server.receive().ok().flatten(),
            pending => pending,
        };
        let Some(request) = found else { return false };
        let mut held = Held(Some(request));
        // otherwise cancelled meanwhile, or its client is gone: dropping it releases it
        let Some(request) = held.0.as_ref().filter(|request| request.is_connected()) else {
            return false;
        };
        let payload: &ComputeRequest = request.payload();
        let is_done = send_response(request, |numbers| answer(payload, numbers));
        if !is_done {
            self.pending = held.0.take();
        }
        is_done
    }
}

/// A request that is leaked during a panic: dropping it could panic again, which ends the process.
struct Held(Option<ComputeActive>);

impl Drop for Held {
    fn drop(&mut self) {
        if std::thread::panicking() {
            std::mem::forget(self.0.take());
        }
    }
}

/// Dropped in this order.
struct Opened {
    response: Option<Response<Threadsafe, ComputeResponse, ()>>,
    pending: Option<ComputePending>,
    client: ComputeClient,
}

impl OpenedService for Opened {
    fn send(&mut self, head: &RequestHead, numbers: &[f64]) -> bool {
        let pending = send_request(&self.client, head, numbers);
        let is_taken = pending.is_some();
        if is_taken {
            self.pending = pending;
        }
        is_taken
    }

    fn poll(&mut self) -> Result<Option<(ResponseHead, &[AtomicU64])>, Disconnected> {
        self.response = None;
        let pending = self.pending.as_ref().ok_or(Disconnected)?;
        self.response = pending.receive().map_err(|_| Disconnected)?;
        let payload = self.response.as_ref().map(|response| response.payload());
        Ok(payload.map(|payload| (payload.head(), payload.numbers())))
    }

    fn cancel(&mut self) {
        self.response = None;
        self.pending = None;
    }
}

/// Makes the service of one client.
///
/// # Errors
/// The shared memory is too full, or has another fault.
pub fn serve_compute(node: &Node) -> Result<Box<dyn ServedService>, ServiceError> {
    let service = name()?;
    // one pending request, nothing overwritten: no request is lost silently
    let factory: Factory = node
        .inner()
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
        // the transport leaks a request whose client is gone unless it may be received without one;
        // the server itself checks whether the client waits
        .enable_fire_and_forget_requests(true)
        .create()
        .map_err(|error| ServiceError::memory(&service, &error))?;
    // a client that is gone must not delay the server
    let builder = factory
        .server_builder()
        .max_loaned_responses_per_request(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData);
    let port = builder.create().map_err(|error| ServiceError::memory(&service, &error))?;
    Ok(Box::new(Serving { pending: None, server: port }))
}

/// Opens the service that the server made for this client.
///
/// # Errors
/// The service is missing, has another version, or the shared memory is faulty.
pub fn open_compute(node: &Node) -> Result<Box<dyn OpenedService>, ServiceError> {
    let service = name()?;
    let factory: Factory = node
        .inner()
        .service_builder(&service)
        .request_response::<ComputeRequest, ComputeResponse>()
        .open()
        .map_err(|error| match error {
            RequestResponseOpenError::DoesNotExist
            | RequestResponseOpenError::IsMarkedForDestruction => {
                ServiceError::Absent(service.to_string())
            }
            RequestResponseOpenError::IncompatibleRequestOrResponseType => {
                ServiceError::OtherVersion(service.to_string(), PROTOCOL_VERSION)
            }
            other => ServiceError::memory(&service, &other),
        })?;
    let builder = factory.client_builder().backpressure_strategy(BackpressureStrategy::DiscardData);
    let client = builder.create().map_err(|error| ServiceError::memory(&service, &error))?;
    Ok(Box::new(Opened { response: None, pending: None, client }))
}

fn name() -> Result<ServiceName, ServiceError> {
    link_service("compute")
}

/// The name of a link's only service.
pub(crate) fn link_service(name: &'static str) -> Result<ServiceName, ServiceError> {
    ServiceName::new(name)
        .map_err(|error| ServiceError::Memory(name.to_owned(), format!("{error:?}")))
}
