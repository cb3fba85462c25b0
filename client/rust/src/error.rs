use std::io;
use std::path::PathBuf;
use std::time::Duration;

use sarrus_proto::control::{ControlResponse, Holder, Refusal};
use sarrus_proto::message::MAX_PLANS_OF_PROCESS;
use sarrus_proto::service::ServiceError;
use sarrus_proto::{Domain, DomainError, FailedState, Field, PROTOCOL_VERSION, QueryError};

use crate::UnknownName;
use crate::life::Life;

/// Why a client cannot attach to a server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// No server has this name in this domain: the name, the domain's folder.
    #[error(
        "no server named `{0}` runs below {root}; start one with `sarrus serve --name {0}`, or \
         name its folder in SARRUS_ROOT",
        root = .1.display()
    )]
    NoServer(String, PathBuf),
    /// The server's supervisor has given up: the server's name, the reason.
    #[error(
        "the server `{0}` was given up by its supervisor: {1}; see to that and start it \
         again"
    )]
    GivenUp(String, String),
    /// A server has this name but does not answer.
    #[error("the server `{name}` gave no answer within {} s: {life}", seconds(timeout))]
    NoAnswer {
        /// The name.
        name: String,
        /// The waiting time.
        timeout: Duration,
        /// The state of the server's process and heartbeat.
        life: Life,
    },
    /// The server's socket cannot be used: its folder, the system's error.
    #[error(
        "the server's folder {path} cannot be used: {1}; see whose it is, and whether this \
         process may open more files",
        path = .0.display()
    )]
    Unreachable(PathBuf, #[source] io::Error),
    /// No CAN bridge has this name.
    #[error("no bridge named `{0}` runs; start one with `sarrus-can run CONFIG --name {0}`")]
    NoBridge(String),
    /// A bridge has this name but publishes nothing.
    #[error("the bridge `{0}` tells no state; see whether its process is stopped or has crashed")]
    SilentBridge(String),
    /// The server speaks this version of the protocol; zero where its payloads are so different
    /// that it cannot be asked.
    #[error(
        "the server speaks protocol version {0}, expected {PROTOCOL_VERSION}; use client and \
         server of one version"
    )]
    WrongVersion(u32),
    /// The server holds another model than the one expected.
    #[error(
        "the server holds the model {found:016x}, expected {expected:016x}; connect anew to use \
         the new model"
    )]
    WrongModel {
        /// Fingerprint of the server's model.
        found: u64,
        /// Fingerprint that was expected.
        expected: u64,
    },
    /// Every place at this transport is taken.
    #[error("all {limit} {transport} are taken; {}{help}", held(holder))]
    NoFreeSlot {
        /// The exhausted transport.
        transport: &'static str,
        /// The number of places.
        limit: usize,
        /// The process that holds most of them.
        holder: Option<Holder>,
        /// The remedy.
        help: &'static str,
    },
    /// This process orders too much of the server.
    #[error(
        "process {process} has ordered plans, lanes and services from the server faster than \
         {per_second} a second; keep and ask the plans that it has"
    )]
    TooManyOrders {
        /// The process, as the server sees it.
        process: u32,
        /// Orders that it may make in a second.
        per_second: u32,
    },
    /// The caller ended the wait; see [`interruptible`](crate::interruptible).
    #[error("the wait for the server was given up; ask again to connect anew")]
    Interrupted,
    /// The server is stopping.
    #[error("the server is stopping; connect again when it is back")]
    ShuttingDown,
    /// The server's answer to this request makes no sense.
    #[error(
        "the server's answer {0} makes no sense to this client; use client and server of one \
         version"
    )]
    BadAnswer(&'static str),
    /// The server failed, for this reason.
    #[error("the server could not take this client: {0}")]
    Failed(String),
    /// The shared memory, with so many bytes free, is too full for another client.
    #[error(
        "/dev/shm has {} KiB left, too few for another client; remove what is not needed there \
         (`sarrus tidy`) or give it more room",
        .0 / 1024
    )]
    NoSpace(u64),
    /// This process has too little memory for a part of a connection: the part, the system's error.
    #[error(
        "this process has no memory left for {0} of the server: {1}; give it more, \
         `ulimit -v`, or let it hold less"
    )]
    NoMemory(&'static str, #[source] io::Error),
    /// The shared memory cannot be entered.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A service cannot be opened.
    #[error(transparent)]
    Service(ServiceError),
}

/// Why a robot does not answer. A request through [`crate::Robot::ask`] that ends with a status
/// other than `ok` is an [`crate::Answer`], not an error; [`crate::Answer::ok`] converts it to one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The server is gone and did not come back in time: its name, the waiting time. The next
    /// request looks for it again.
    #[error(
        "the server `{0}` is gone, waited {s} s for it; start it again, the next request finds \
         it",
        s = .1.as_secs_f64()
    )]
    ServerGone(String, Duration),
    /// The server is alive but did not answer in time.
    #[error("the server `{name}` gave no answer within {} s: {life}", seconds(timeout))]
    NoAnswer {
        /// The server's name.
        name: String,
        /// The waiting time.
        timeout: Duration,
        /// The state of the server's process and heartbeat.
        life: Life,
    },
    /// Attaching failed, at first or again after the server was restarted.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// The query cannot be planned.
    #[error("{0}")]
    Query(QueryError),
    /// The server cannot plan the query, for this reason.
    #[error("the server cannot plan this: {0}")]
    NotPlanned(String),
    /// All names in a query that are unknown.
    #[error("{}", lines(.0))]
    UnknownNames(Vec<UnknownName>),
    /// An array does not fit this robot.
    #[error("`{}` has {found} numbers, expected {expected}", field.name())]
    WrongSize {
        /// The field of the array.
        field: Field,
        /// Its length.
        found: usize,
        /// The length for this robot.
        expected: usize,
    },
    /// The robot answered, but this state has no answer.
    #[error(transparent)]
    Failed(#[from] FailedState),
    /// The plan moves more numbers than a request carries.
    #[error(
        "the plan takes {n_in} numbers and gives {n_out}, expected at most {max_in} and {max_out}; \
         ask for fewer fields or frames at a time"
    )]
    TooLarge {
        /// Numbers in.
        n_in: usize,
        /// Numbers out.
        n_out: usize,
        /// The limit of numbers in.
        max_in: usize,
        /// The limit of numbers out.
        max_out: usize,
    },
    /// The server's table of plans is full, or holds as many of this process as it may.
    #[error(
        "the server takes no more plans; {}its table has {limit} places, of which one process may \
         have {MAX_PLANS_OF_PROCESS}; release some that nobody asks any more, or use queries that \
         are registered",
        held(holder)
    )]
    TooManyPlans {
        /// Size of the table.
        limit: usize,
        /// The process that holds most of them.
        holder: Option<Holder>,
    },
    /// The plan belongs to another robot, perhaps one of the same model.
    #[error(
        "the plan was prepared by another robot; prepare it with the robot that is asked, also \
         where both are of one model"
    )]
    UnknownPlan,
    /// The plan belongs to this robot, but was released.
    #[error("the plan was released; prepare it again")]
    ReleasedPlan,
}

fn lines(names: &[UnknownName]) -> String {
    names.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// The process that holds most, as the middle of a message.
fn held(holder: &Option<Holder>) -> String {
    holder.map_or(String::new(), |holder| format!("{holder}; "))
}

fn seconds(timeout: &Duration) -> String {
    format!("{:.3}", timeout.as_secs_f64()).trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl ConnectError {
    pub(crate) fn no_server(name: &str, domain: &Domain) -> ConnectError {
        ConnectError::NoServer(name.to_owned(), domain.root().to_owned())
    }

    /// A service that is there and cannot be opened; the places of a full one, and the remedy.
    pub(crate) fn of_service(
        error: ServiceError,
        [transport, help]: [&'static str; 2],
    ) -> ConnectError {
        match error {
            ServiceError::OtherVersion(..) => ConnectError::WrongVersion(0),
            ServiceError::Full(_, limit) => {
                ConnectError::NoFreeSlot { transport, limit, holder: None, help }
            }
            other => ConnectError::Service(other),
        }
    }

    /// Replaces the waiting time of the call's last part with that of the whole call.
    pub(crate) fn waited(self, timeout: Duration) -> ConnectError {
        match self {
            ConnectError::NoAnswer { name, life, .. } => {
                ConnectError::NoAnswer { name, timeout, life }
            }
            other => other,
        }
    }

    /// The reason why a memory page from the server cannot be used.
    pub(crate) fn of_page(
        page: &'static str,
        answer: &'static str,
        source: io::Error,
    ) -> ConnectError {
        match source.kind() {
            io::ErrorKind::OutOfMemory => ConnectError::NoMemory(page, source),
            _ => ConnectError::BadAnswer(answer),
        }
    }

    /// True if the server may be shutting down or starting.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(
            self,
            ConnectError::NoServer(..)
                | ConnectError::GivenUp(..)
                | ConnectError::NoAnswer { .. }
                | ConnectError::ShuttingDown
                | ConnectError::Service(_)
        )
    }

    pub(crate) fn of_refusal(
        refusal: &Refusal,
        response: &ControlResponse,
        expected: u64,
    ) -> ConnectError {
        let full = |transport: &'static str, limit: &usize, help: &'static str| {
            ConnectError::NoFreeSlot { transport, limit: *limit, holder: response.holder, help }
        };
        match refusal {
            Refusal::WrongVersion => ConnectError::WrongVersion(response.version),
            Refusal::WrongModel => {
                ConnectError::WrongModel { found: response.fingerprint, expected }
            }
            Refusal::NoLane { limit } => full(
                "lanes of the server",
                limit,
                "close a client, serve with more --lanes, or connect through requests and \
                 responses, the transport `service`",
            ),
            Refusal::NoService { limit } => {
                full("services of the server", limit, "close a client, or connect through a lane")
            }
            Refusal::TooManyClients { limit } => full(
                "connections of the server",
                limit,
                "close a client, or serve with more --lanes",
            ),
            Refusal::TooManyOrders { process, per_second } => {
                ConnectError::TooManyOrders { process: *process, per_second: *per_second }
            }
            Refusal::NoSpace { free, .. } => ConnectError::NoSpace(*free),
            Refusal::Stopping => ConnectError::ShuttingDown,
            Refusal::Failed { reason } => ConnectError::Failed(reason.clone()),
            _ => ConnectError::BadAnswer("to an attach"),
        }
    }
}
