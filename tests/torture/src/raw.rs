//! A client made of the parts of the protocol, which can stop between any two of them.

use std::cell::Cell;
use std::os::fd::OwnedFd;

use sarrus_client::Domain;
use sarrus_proto::batch::{BatchHead, ClaimedBatch};
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::control::{Call, CallHead, ControlRequest, Grant, Refusal, exchange};
use sarrus_proto::message::RequestHead;
use sarrus_proto::run::Link;
use sarrus_proto::service::{OpenedService, open_compute};
use sarrus_proto::socket::ControlSocket;
use sarrus_proto::{Node, PROTOCOL_VERSION, Query, ServerName};

use crate::patience::deadline;
use crate::sandbox::words;

/// A connection.
pub struct Raw {
    /// Its socket.
    pub socket: ControlSocket,
    domain: Domain,
    /// The model's fingerprint; 0 before the greeting.
    pub fingerprint: u64,
    pub(crate) instance: u64,
    nonce: Cell<u64>,
}

impl Raw {
    /// Connects without a greeting.
    pub fn connect(domain: &Domain, name: &str) -> Result<Raw, String> {
        let name = ServerName::new(name).map_err(words)?;
        let folder = domain.server_folders(&name).next().ok_or("no folder of servers")?;
        let socket = ControlSocket::connect(&folder).map_err(words)?;
        let domain = domain.clone();
        Ok(Raw { socket, domain, fingerprint: 0, instance: 0, nonce: Cell::new(0) })
    }

    /// Connects and greets the server.
    pub fn greet(domain: &Domain, name: &str) -> Result<Raw, String> {
        let mut raw = Raw::connect(domain, name)?;
        raw.hello()?;
        Ok(raw)
    }

    /// Greets the server.
    pub fn hello(&mut self) -> Result<(), String> {
        let request = self.request(Call::Hello);
        let (response, _) =
            exchange(&self.socket, &request, deadline()).map_err(|error| format!("{error:?}"))?;
        self.fingerprint = response.fingerprint;
        self.instance = response.instance;
        response.outcome.map(|_| ()).map_err(|refusal| format!("{refusal:?}"))
    }

    /// A call as it travels.
    pub fn request(&self, call: Call) -> ControlRequest {
        self.nonce.set(self.nonce.get() + 1);
        let head = CallHead { version: PROTOCOL_VERSION, nonce: self.nonce.get() };
        ControlRequest { head, fingerprint: self.fingerprint, call }
    }

    /// Sends a request as it is; an error where there is no answer.
    pub fn send(&self, request: &ControlRequest) -> Result<Result<Grant, Refusal>, String> {
        let answered = exchange(&self.socket, request, deadline());
        answered.map(|(response, _)| response.outcome).map_err(|error| format!("{error:?}"))
    }

    /// Makes a call; an error where there is no answer.
    pub fn try_call(&self, call: Call) -> Result<Result<Grant, Refusal>, String> {
        self.send(&self.request(call))
    }

    /// Makes a call.
    pub fn call(&self, call: Call) -> Result<Grant, String> {
        self.try_call(call)?.map_err(|refusal| format!("{refusal:?}"))
    }

    /// Registers a query; its number and sizes.
    pub fn plan(&self, query: &Query) -> Result<(u32, [usize; 2]), String> {
        match self.call(Call::Plan { query: Box::new(*query) })? {
            Grant::Plan { number, n_in, n_out } => Ok((number.0, [n_in, n_out])),
            other => Err(format!("{other:?}")),
        }
    }

    /// Asks for a lane; its link and classes.
    pub fn lane(&self, [n_in, n_out]: [usize; 2]) -> Result<(u64, [usize; 2]), String> {
        match self.call(Call::Lane { n_in, n_out })? {
            Grant::Lane { link, class_in, class_out } => Ok((link, [class_in, class_out])),
            other => Err(format!("{other:?}")),
        }
    }

    /// Asks for a service; its link.
    pub fn service(&self) -> Result<u64, String> {
        match self.call(Call::Service)? {
            Grant::Service { link } => Ok(link),
            other => Err(format!("{other:?}")),
        }
    }

    /// Takes a lane that was granted.
    pub fn claim(&self, link: u64, classes: [usize; 2]) -> Result<(ClaimedLane, Node), String> {
        let node = self.node(link)?;
        Ok((ClaimedLane::claim(&node, classes).map_err(words)?, node))
    }

    /// Opens a service that was granted.
    pub fn open(&self, link: u64) -> Result<(Box<dyn OpenedService>, Node), String> {
        let node = self.node(link)?;
        Ok((open_compute(&node).map_err(words)?, node))
    }

    /// Asks for a lane and takes it.
    pub fn take_lane(&self, sizes: [usize; 2]) -> Result<(Node, ClaimedLane), String> {
        let (link, classes) = self.lane(sizes)?;
        let (lane, node) = self.claim(link, classes)?;
        Ok((node, lane))
    }

    /// Asks for a service, opens it and has it served.
    pub fn take_service(&self) -> Result<(Node, Box<dyn OpenedService>), String> {
        let opened = self.open_service()?;
        self.call(Call::Serve)?;
        Ok(opened)
    }

    /// A service whose client's side the server does not know yet.
    pub fn open_service(&self) -> Result<(Node, Box<dyn OpenedService>), String> {
        let link = self.service()?;
        let (client, node) = self.open(link)?;
        Ok((node, client))
    }

    fn node(&self, link: u64) -> Result<Node, String> {
        Link::new(&self.domain, self.instance, link).and_then(|link| link.node()).map_err(words)
    }

    /// The area for batches, and its descriptor.
    pub fn batches(&self) -> Result<(ClaimedBatch, OwnedFd), String> {
        let request = self.request(Call::Batch);
        let (response, memory) =
            exchange(&self.socket, &request, deadline()).map_err(|error| format!("{error:?}"))?;
        response.outcome.map_err(|refusal| format!("{refusal:?}"))?;
        let memory = memory.ok_or("an area without a descriptor")?;
        Ok((ClaimedBatch::open(&memory).map_err(words)?, memory))
    }

    /// The head of a batch.
    pub fn batch_head(&self, plan: u32, sequence: u64, rows: u64) -> BatchHead {
        let version = PROTOCOL_VERSION;
        BatchHead { version, plan, fingerprint: self.fingerprint, sequence, rows }
    }

    /// The head of a request.
    pub fn head(&self, plan: u32, sequence: u64) -> RequestHead {
        let fingerprint = self.fingerprint;
        let version = PROTOCOL_VERSION;
        RequestHead { version, plan, fingerprint, sequence, ..RequestHead::default() }
    }

    /// The beginning of the names of a link's files in shared memory.
    pub fn prefix_of(&self, link: u64) -> String {
        format!("{}{:016x}_{link:08x}_", self.domain.prefix(), self.instance)
    }
}
