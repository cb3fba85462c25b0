//! Calls outside the data path: JSON messages through the control socket, each answered by one.

use std::fmt::{self, Display, Formatter};
use std::io::ErrorKind;
use std::os::fd::OwnedFd;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::message::{PlanNumber, Statistics};
use crate::socket::{ControlSocket, MAX_MESSAGE};
use crate::{PROTOCOL_VERSION, Query, fnv1a_64};

/// Bytes of model information in one answer.
pub const PAGE: usize = 16 << 10;

/// The head of every call, in every version.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CallHead {
    /// [`PROTOCOL_VERSION`] of the client.
    pub version: u32,
    /// A number that the client chooses; the answer repeats it.
    #[serde(default)]
    pub nonce: u64,
}

/// A call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControlRequest {
    /// Version and nonce.
    #[serde(flatten)]
    pub head: CallHead,
    /// Fingerprint of the model that the client expects; zero for any.
    #[serde(default)]
    pub fingerprint: u64,
    /// The call itself.
    pub call: Call,
}

/// The calls of a client.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Call {
    /// Identifies the server. The answer carries the descriptor of the
    /// [heartbeat](crate::heartbeat).
    Hello,
    /// A page of the model information.
    Model {
        /// Number of the page.
        page: usize,
    },
    /// Register a query. The server holds the plan until every connection that registered it has
    /// released it or ended.
    Plan {
        /// The query.
        query: Box<Query>,
    },
    /// Release this connection's hold on a plan.
    Release {
        /// The plan.
        plan: PlanNumber,
    },
    /// A lane for plans of up to this many numbers.
    Lane {
        /// Numbers in.
        n_in: usize,
        /// Numbers out.
        n_out: usize,
    },
    /// A service for this client.
    Service,
    /// The client has opened its end of the service: requests may come.
    Serve,
    /// An area for [batches](crate::batch), in addition to the lane or service of this connection,
    /// with the same lifetime; the answer carries its descriptor.
    Batch,
    /// Return the lane or the service of this connection; after the answer it is no longer polled.
    Leave,
    /// The server's counters.
    Statistics,
}

/// An answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControlResponse {
    /// [`PROTOCOL_VERSION`] of the server.
    pub version: u32,
    /// The call's nonce.
    pub nonce: u64,
    /// [`query_hash`] of the answered query; zero without one.
    pub query: u64,
    /// Fingerprint of the model.
    pub fingerprint: u64,
    /// Distinguishes the runs of a server.
    pub instance: u64,
    /// The process that holds most plans, lanes, services or connections, where these are refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<Holder>,
    /// The grant, or the reason of the refusal.
    pub outcome: Result<Grant, Refusal>,
}

/// A process of clients, and how much it holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Its number, as the server sees it.
    pub process: u32,
    /// Number of its plans, lanes, services or connections.
    pub held: usize,
}

impl Display for Holder {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "process {} holds {}", self.process, self.held)
    }
}

/// The grants of a server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grant {
    /// To [`Call::Hello`].
    Hello {
        /// Root of the server's domain.
        root: String,
        /// Pages of the model information.
        pages: usize,
    },
    /// To [`Call::Model`]: a piece of JSON.
    Page {
        /// The piece.
        text: String,
    },
    /// To [`Call::Plan`].
    Plan {
        /// Number for the requests.
        number: PlanNumber,
        /// Numbers in.
        n_in: usize,
        /// Numbers out.
        n_out: usize,
    },
    /// To [`Call::Release`].
    Released {
        /// Whether this connection held the plan.
        had: bool,
    },
    /// To [`Call::Lane`]: the lane exists.
    Lane {
        /// Number of its [link](crate::run::Link).
        link: u64,
        /// Its class of numbers in.
        class_in: usize,
        /// Its class of numbers out.
        class_out: usize,
    },
    /// To [`Call::Service`]: the service exists; [`Call::Serve`] comes next.
    Service {
        /// Number of its [link](crate::run::Link).
        link: u64,
    },
    /// To [`Call::Serve`].
    Served,
    /// To [`Call::Batch`]: the area exists.
    Batch,
    /// To [`Call::Leave`].
    Left,
    /// To [`Call::Statistics`].
    Statistics(Box<Statistics>),
}

/// Why a server refuses a call.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// The client speaks another version of the protocol; the answer has the server's.
    WrongVersion,
    /// The message is not a call of this version.
    UnknownCall,
    /// The client was made for a model with another fingerprint.
    WrongModel,
    /// The query cannot be planned.
    BadQuery {
        /// Why.
        reason: String,
    },
    /// The plan has more numbers than a request or answer carries.
    TooLarge {
        /// Numbers in.
        n_in: usize,
        /// Numbers out.
        n_out: usize,
    },
    /// The table of plans is full, or this process has
    /// [`MAX_PLANS_OF_PROCESS`](crate::message::MAX_PLANS_OF_PROCESS).
    TooManyPlans,
    /// This process has made plans, lanes and services too fast for a while.
    TooManyOrders {
        /// The process.
        process: u32,
        /// Orders that it may make in a second.
        per_second: u32,
    },
    /// Every lane is taken, or all that one process may hold.
    NoLane {
        /// Their number.
        limit: usize,
    },
    /// Every place at the service is taken.
    NoService {
        /// Their number.
        limit: usize,
    },
    /// The connection has no service that waits for its client, or neither lane nor service for
    /// batches.
    NoEnd,
    /// The server has its maximum of connections.
    TooManyClients {
        /// Their number.
        limit: usize,
    },
    /// The shared memory is too full.
    NoSpace {
        /// Memory that the grant needs `[byte]`.
        needed: u64,
        /// Free memory `[byte]`.
        free: u64,
    },
    /// The server is stopping.
    Stopping,
    /// The model information has no such page.
    NoSuchPage,
    /// Something failed.
    Failed {
        /// The reason.
        reason: String,
    },
}

impl ControlRequest {
    /// A call on the wire.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Reads a call; refuses a message that is not a call of this version.
    ///
    /// # Errors
    /// The head, if there is one, and the reason of the refusal.
    pub fn from_bytes(bytes: &[u8]) -> Result<ControlRequest, (CallHead, Refusal)> {
        let head = serde_json::from_slice::<CallHead>(bytes)
            .map_err(|_| (CallHead::default(), Refusal::UnknownCall))?;
        if head.version != PROTOCOL_VERSION {
            return Err((head, Refusal::WrongVersion));
        }
        serde_json::from_slice(bytes).map_err(|_| (head, Refusal::UnknownCall))
    }
}

impl ControlResponse {
    /// An answer on the wire.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Reads an answer; `None` for any other message.
    pub fn from_bytes(bytes: &[u8]) -> Option<ControlResponse> {
        serde_json::from_slice(bytes).ok()
    }
}

/// The reason why a call has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoResponse {
    /// The server is gone.
    Gone,
    /// The deadline passed.
    Late,
    /// The answer has this other version.
    OtherVersion(u32),
    /// The answer is malformed, or answers another query.
    Nonsense,
}

/// Makes a call and waits for its answer, with the descriptor that came with it. Ignores the answer
/// to an earlier, cancelled call.
///
/// # Errors
/// [`NoResponse`].
pub fn exchange(
    socket: &ControlSocket,
    request: &ControlRequest,
    deadline: Instant,
) -> Result<(ControlResponse, Option<OwnedFd>), NoResponse> {
    send_call(socket, request)?;
    receive_answer(socket, request, deadline)
}

/// Makes a call without waiting for its answer.
///
/// # Errors
/// [`NoResponse`].
pub fn send_call(socket: &ControlSocket, request: &ControlRequest) -> Result<(), NoResponse> {
    socket.send(&request.to_bytes(), None).map_err(|error| match error.kind() {
        // the server does not read the messages that already wait in its queue
        ErrorKind::WouldBlock => NoResponse::Late,
        _ => NoResponse::Gone,
    })
}

/// Waits for the answer to an earlier call; after [`NoResponse::Late`] the caller may wait again.
///
/// # Errors
/// [`NoResponse`].
pub fn receive_answer(
    socket: &ControlSocket,
    request: &ControlRequest,
    deadline: Instant,
) -> Result<(ControlResponse, Option<OwnedFd>), NoResponse> {
    let gone = |_| NoResponse::Gone;
    let query = match &request.call {
        Call::Plan { query } => query_hash(query),
        _ => 0,
    };
    let mut buffer = vec![0; MAX_MESSAGE];
    loop {
        while let Some((bytes, descriptor)) = socket.receive(&mut buffer).map_err(gone)? {
            let bytes = buffer.get(..bytes).unwrap_or_default();
            let Some(response) = ControlResponse::from_bytes(bytes) else {
                return Err(match serde_json::from_slice(bytes) {
                    Ok(CallHead { version, .. }) if version != PROTOCOL_VERSION => {
                        NoResponse::OtherVersion(version)
                    }
                    _ => NoResponse::Nonsense,
                });
            };
            // a call that the server could not read has no nonce there
            if response.nonce != request.head.nonce && response.nonce != 0 {
                continue;
            }
            return match response.outcome.is_err() || response.query == query {
                true => Ok((response, descriptor)),
                false => Err(NoResponse::Nonsense),
            };
        }
        if !socket.wait(deadline).map_err(gone)? && Instant::now() >= deadline {
            return Err(NoResponse::Late);
        }
    }
}

/// FNV-1a of a query's bytes on the wire; an answer identifies its query by this hash.
pub fn query_hash(query: &Query) -> u64 {
    fnv1a_64(&serde_json::to_vec(query).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FieldSet, Request};

    fn query() -> Query {
        Query::new(Request::Kinematics, FieldSet(1), FieldSet(2))
    }

    #[test]
    fn calls_travel_unchanged() {
        let head = CallHead { version: PROTOCOL_VERSION, nonce: u64::MAX };
        let calls = [
            Call::Hello,
            Call::Model { page: 3 },
            Call::Plan { query: Box::new(query()) },
            Call::Release { plan: PlanNumber(u32::MAX) },
            Call::Lane { n_in: 1, n_out: usize::MAX },
            Call::Service,
            Call::Serve,
            Call::Batch,
            Call::Leave,
            Call::Statistics,
        ];
        for call in calls {
            let request = ControlRequest { head, fingerprint: u64::MAX, call };
            assert_eq!(ControlRequest::from_bytes(&request.to_bytes()), Ok(request));
        }
    }

    #[test]
    fn another_version_is_no_garbage() {
        let of = |text: &str| ControlRequest::from_bytes(text.as_bytes()).unwrap_err();
        let other = r#"{"version":99,"nonce":7,"call":{"unheard":[1]}}"#;
        assert_eq!(of(other), (CallHead { version: 99, nonce: 7 }, Refusal::WrongVersion));
        for garbage in ["", "{", "null", "[]", &"[".repeat(10_000), r#"{"version":-1}"#] {
            assert_eq!(of(garbage), (CallHead::default(), Refusal::UnknownCall), "{garbage}");
        }
        let unknown = format!(r#"{{"version":{PROTOCOL_VERSION},"nonce":1,"call":"dance"}}"#);
        assert_eq!(of(&unknown).1, Refusal::UnknownCall);
    }

    #[test]
    fn queries_that_differ_have_other_hashes() {
        let other = Query::new(Request::Kinematics, FieldSet(1), FieldSet(3));
        assert_ne!(query_hash(&query()), query_hash(&other));
        assert_eq!(query_hash(&query()), query_hash(&query()));
    }
}
