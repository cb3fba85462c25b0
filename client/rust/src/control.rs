//! A connection to a run of a server: calls outside the data path, and the server's liveness.

use std::io::{self, ErrorKind};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use sarrus_proto::batch::ClaimedBatch;
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::control::{
    Call, CallHead, ControlRequest, ControlResponse, Grant, NoResponse, Refusal,
};
use sarrus_proto::heartbeat::HeartbeatReader;
use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, Statistics};
use sarrus_proto::run::Link;
use sarrus_proto::service::{OpenedService, ServiceError, open_compute};
use sarrus_proto::socket::ControlSocket;
use sarrus_proto::{Domain, ModelInfo, Node, PROTOCOL_VERSION, ServerName, supervision};

use crate::interrupt::{self, exchange};
use crate::life::Life;
use crate::{ConnectError, Error, Outcome, Prepared};

/// Delay between two attempts to reach a busy server, at first and after some attempts.
const RETRY: [Duration; 2] = [Duration::from_micros(100), Duration::from_millis(5)];

/// Longest wait of a leaving client for the server.
const LEAVE: Duration = Duration::from_millis(250);

/// A connection to a run of a server. The server keeps its grants while this is open.
pub(crate) struct Control {
    socket: ControlSocket,
    name: String,
    /// Fingerprint of the server's model.
    pub(crate) fingerprint: u64,
    instance: u64,
    process: u32,
    /// The server's root, which may differ from this process's choice.
    domain: Domain,
    pages: usize,
    heartbeat: HeartbeatReader,
    nonce: AtomicU64,
}

/// The end of a wait of this length, saturated.
pub(crate) fn deadline_after(timeout: Duration) -> Instant {
    let now = Instant::now();
    let century = Duration::from_secs(100 * 365 * 86_400);
    now.checked_add(timeout.min(century)).unwrap_or(now)
}

impl Control {
    /// Connects and sends hello. Fails if `fingerprint` is given and the model has another one.
    pub(crate) fn open(
        domain: &Domain,
        name: &ServerName,
        fingerprint: Option<u64>,
        deadline: Instant,
    ) -> Outcome<Control> {
        let start = Instant::now();
        let head = CallHead { version: PROTOCOL_VERSION, nonce: 1 };
        let request =
            ControlRequest { head, fingerprint: fingerprint.unwrap_or(0), call: Call::Hello };
        let (socket, process, response, descriptor) = loop {
            let socket = connect(domain, name, deadline)?;
            let process = socket.peer().map_or(0, |peer| peer.process);
            match exchange(&socket, &request, deadline) {
                Ok(Some((response, descriptor))) => break (socket, process, response, descriptor),
                Ok(None) => return Err(ConnectError::Interrupted),
                // a new connection shows whether the server or only this connection is gone
                Err(NoResponse::Gone) if Instant::now() < deadline => std::thread::sleep(RETRY[0]),
                Err(error) => {
                    let life = || Life::of(process, None);
                    return Err(failed(error, domain, name.as_str(), start, life));
                }
            }
        };
        let expected = request.fingerprint;
        let Grant::Hello { root, pages } = granted(&response, expected)? else {
            return Err(ConnectError::BadAnswer("to an attach"));
        };
        let bad = || ConnectError::BadAnswer("to an attach");
        let heartbeat = HeartbeatReader::new(&descriptor.ok_or_else(bad)?)
            .map_err(|error| ConnectError::of_page("the sign of life", "to an attach", error))?;
        Ok(Control {
            socket,
            name: name.as_str().to_owned(),
            fingerprint: response.fingerprint,
            instance: response.instance,
            process,
            domain: Domain::at(Path::new(root))?,
            pages: *pages,
            heartbeat,
            nonce: AtomicU64::new(2),
        })
    }

    /// True once the server is gone, or has ended cleanly and no longer answers.
    pub(crate) fn is_over(&self) -> bool {
        self.heartbeat.read().stopped != 0 || self.socket.is_closed()
    }

    /// The state of the server's process and heartbeat.
    pub(crate) fn life(&self) -> Life {
        Life::of(self.process, Some(&self.heartbeat))
    }

    /// The model information.
    pub(crate) fn model(&self, deadline: Instant) -> Outcome<ModelInfo> {
        let mut json = String::new();
        for page in 0..self.pages {
            match self.granted(Call::Model { page }, deadline)? {
                Grant::Page { text } => json.push_str(&text),
                _ => return Err(ConnectError::BadAnswer("about the model")),
            }
        }
        let info = ModelInfo::from_json(json.as_bytes());
        info.ok_or(ConnectError::BadAnswer("about the model"))
    }

    /// Registers a plan; the server's number of it.
    pub(crate) fn plan(&self, prepared: &Prepared, deadline: Instant) -> Result<u32, Error> {
        let query = Box::new(*prepared.query());
        let (response, _) = self.exchange(Call::Plan { query }, deadline)?;
        match &response.outcome {
            // client and server must mean the same numbers
            Ok(Grant::Plan { number, n_in, n_out })
                if [*n_in, *n_out] == [prepared.given().len(), prepared.want().len()] =>
            {
                Ok(number.0)
            }
            Ok(_) => Err(ConnectError::BadAnswer("for a plan").into()),
            Err(Refusal::BadQuery { reason }) => Err(Error::NotPlanned(reason.clone())),
            Err(Refusal::TooLarge { n_in, n_out }) => Err(Error::TooLarge {
                n_in: *n_in,
                n_out: *n_out,
                max_in: MAX_NUMBERS_IN,
                max_out: MAX_NUMBERS_OUT,
            }),
            Err(Refusal::TooManyPlans) => {
                Err(Error::TooManyPlans { limit: MAX_PLANS, holder: response.holder })
            }
            Err(refusal) => {
                Err(ConnectError::of_refusal(refusal, &response, self.fingerprint).into())
            }
        }
    }

    /// Releases a plan by the server's number of it.
    pub(crate) fn release(&self, number: u32, deadline: Instant) -> Outcome {
        let plan = sarrus_proto::message::PlanNumber(number);
        self.granted(Call::Release { plan }, deadline).map(|_| ())
    }

    /// Returns the grant of [`Control::lane`] or [`Control::service`]; if the server does not
    /// answer in time, the end of the connection returns it.
    pub(crate) fn leave(&self) {
        let _ = self.granted(Call::Leave, deadline_after(LEAVE));
    }

    /// The server's counters.
    pub(crate) fn statistics(&self, deadline: Instant) -> Outcome<Statistics> {
        match self.granted(Call::Statistics, deadline)? {
            Grant::Statistics(statistics) => Ok(*statistics),
            _ => Err(ConnectError::BadAnswer("about its counts")),
        }
    }

    /// A lane for this client that holds this many numbers each way.
    pub(crate) fn lane(
        &self,
        [n_in, n_out]: [usize; 2],
        deadline: Instant,
    ) -> Outcome<(Node, ClaimedLane, [usize; 2])> {
        let Grant::Lane { link, class_in, class_out } =
            self.granted(Call::Lane { n_in, n_out }, deadline)?
        else {
            return Err(ConnectError::BadAnswer("for a lane"));
        };
        let node = self.link(link)?.node()?;
        let lane = ClaimedLane::claim(&node, [class_in, class_out]);
        let lane = lane.map_err(|error| self.of_service(error))?;
        Ok((node, lane, [class_in, class_out]))
    }

    /// A service for this client.
    pub(crate) fn service(&self, deadline: Instant) -> Outcome<(Node, Box<dyn OpenedService>)> {
        let Grant::Service { link } = self.granted(Call::Service, deadline)? else {
            return Err(ConnectError::BadAnswer("for a service"));
        };
        let node = self.link(link)?.node()?;
        let client = open_compute(&node).map_err(|error| self.of_service(error))?;
        self.granted(Call::Serve, deadline)?;
        Ok((node, client))
    }

    /// An area for batches in addition to the lane or the service.
    pub(crate) fn batch(&self, deadline: Instant) -> Outcome<ClaimedBatch> {
        let (response, descriptor) = self.exchange(Call::Batch, deadline)?;
        let granted = granted(&response, self.fingerprint)?;
        let bad = || ConnectError::BadAnswer("for batches");
        let memory = descriptor.filter(|_| *granted == Grant::Batch).ok_or_else(bad)?;
        ClaimedBatch::open(&memory)
            .map_err(|error| ConnectError::of_page("the area for batches", "for batches", error))
    }

    fn of_service(&self, error: ServiceError) -> ConnectError {
        let full = ["ports of the server", "close other clients of this server"];
        match error {
            ServiceError::Absent(_) => ConnectError::no_server(&self.name, &self.domain),
            other => ConnectError::of_service(other, full),
        }
    }

    fn link(&self, number: u64) -> Outcome<Link> {
        Ok(Link::new(&self.domain, self.instance, number)?)
    }

    fn granted(&self, call: Call, deadline: Instant) -> Outcome<Grant> {
        let (response, _) = self.exchange(call, deadline)?;
        granted(&response, self.fingerprint).cloned()
    }

    fn exchange(
        &self,
        call: Call,
        deadline: Instant,
    ) -> Outcome<(ControlResponse, Option<OwnedFd>)> {
        let start = Instant::now();
        let head = CallHead { version: PROTOCOL_VERSION, nonce: self.nonce.fetch_add(1, Relaxed) };
        let request = ControlRequest { head, fingerprint: self.fingerprint, call };
        loop {
            let answered = exchange(&self.socket, &request, deadline)
                .map_err(|error| failed(error, &self.domain, &self.name, start, || self.life()))?
                .ok_or(ConnectError::Interrupted)?;
            let is_early = matches!(answered.0.outcome, Err(Refusal::TooManyOrders { .. }));
            if !is_early || Instant::now() + RETRY[1] >= deadline {
                return Ok(answered);
            }
            std::thread::sleep(RETRY[1]);
            if interrupt::is_wanted() {
                return Err(ConnectError::Interrupted);
            }
        }
    }
}

/// A connection to the server of a name.
fn connect(domain: &Domain, name: &ServerName, deadline: Instant) -> Outcome<ControlSocket> {
    let start = Instant::now();
    let mut pause = RETRY[0];
    loop {
        if interrupt::is_wanted() {
            return Err(ConnectError::Interrupted);
        }
        let mut busy = false;
        for folder in domain.server_folders(name) {
            match ControlSocket::connect(&folder) {
                // a server of another user is refused, even in a folder of this name
                Ok(socket) if is_ours(&socket) => return Ok(socket),
                Ok(_) => {
                    let source = io::Error::other("the server is another user's");
                    return Err(ConnectError::Unreachable(folder, source));
                }
                Err(error) => match error.kind() {
                    ErrorKind::NotFound | ErrorKind::ConnectionRefused => {}
                    ErrorKind::WouldBlock | ErrorKind::Interrupted => busy = true,
                    _ => return Err(ConnectError::Unreachable(folder, error)),
                },
            }
        }
        if !busy {
            return Err(match supervision::given_up(domain.root(), name) {
                Some(reason) => ConnectError::GivenUp(name.as_str().to_owned(), reason),
                None => ConnectError::no_server(name.as_str(), domain),
            });
        }
        // it is alive, but other clients wait for it too
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            let name = name.as_str().to_owned();
            let timeout = start.elapsed();
            return Err(ConnectError::NoAnswer { name, timeout, life: Life::of(0, None) });
        }
        std::thread::sleep(pause.min(left));
        pause = (2 * pause).min(RETRY[1]);
    }
}

fn is_ours(socket: &ControlSocket) -> bool {
    let us = rustix::process::geteuid().as_raw();
    socket.peer().is_ok_and(|peer| peer.user == us)
}

fn failed(
    error: NoResponse,
    domain: &Domain,
    name: &str,
    start: Instant,
    life: impl FnOnce() -> Life,
) -> ConnectError {
    match error {
        NoResponse::Gone => ConnectError::no_server(name, domain),
        NoResponse::Late => {
            let name = name.to_owned();
            let timeout = start.elapsed();
            ConnectError::NoAnswer { name, timeout, life: life() }
        }
        NoResponse::OtherVersion(found) => ConnectError::WrongVersion(found),
        NoResponse::Nonsense => ConnectError::BadAnswer("to a call"),
    }
}

fn granted(response: &ControlResponse, expected: u64) -> Outcome<&Grant> {
    response
        .outcome
        .as_ref()
        .map_err(|refusal| ConnectError::of_refusal(refusal, response, expected))
}
