//! Answers to the clients' calls: hello, model, plans, lanes, services, batches, statistics.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::time::Instant;

use sarrus_dynamics::Model;
use sarrus_proto::PROTOCOL_VERSION;
use sarrus_proto::batch::BATCH_WORDS;
use sarrus_proto::board::class_of;
use sarrus_proto::control::{
    Call, CallHead, ControlRequest, ControlResponse, Grant, PAGE, Refusal, query_hash,
};
use sarrus_proto::message::Statistics;
use sarrus_proto::run::Run;
use sarrus_proto::socket::MAX_MESSAGE;
use tracing::{debug, info, warn};

use crate::system::memory::MemoryLimits;
use crate::upkeep::connections::{Connections, SERVICE_NEEDS, lane_needs};
use crate::upkeep::plans::{Plans, Registered};
use crate::upkeep::quota::{Client, Orders};

/// Memory of a plan `[byte]`.
const PLAN_NEEDS: u64 = 64 << 10;

/// State behind the clients' calls.
pub(crate) struct Calls {
    pub(crate) run: Run,
    pub(crate) root: String,
    pub(crate) connections: Connections,
    pub(crate) model: Arc<Model<f64>>,
    pub(crate) plans: Plans,
    pub(crate) orders: Orders,
    pub(crate) memory: MemoryLimits,
    /// The model information in pages.
    pub(crate) pages: Vec<String>,
    pub(crate) fingerprint: u64,
    pub(crate) heartbeat: OwnedFd,
    /// Buffer of one message.
    pub(crate) buffer: Vec<u8>,
}

/// Cuts the model information into pages.
pub(crate) fn pages(info: &str) -> Vec<String> {
    let mut pages = vec![String::new()];
    for letter in info.chars() {
        if pages.last().is_some_and(|page| page.len() + letter.len_utf8() > PAGE) {
            pages.push(String::new());
        }
        if let Some(page) = pages.last_mut() {
            page.push(letter);
        }
    }
    pages
}

impl Calls {
    /// Answers one call of a client; ends the connection if the client is gone, breaks the protocol
    /// or does not read.
    pub(crate) fn answer_call(
        &mut self,
        client: u64,
        stopping: bool,
        statistics: impl FnOnce(&Calls) -> Statistics,
    ) {
        let Some(connection) = self.connections.get(client) else { return };
        if connection.is_over || connection.socket.is_closed() {
            return self.end(client);
        }
        self.buffer.resize(MAX_MESSAGE, 0);
        let bytes = match connection.socket.receive(&mut self.buffer) {
            Ok(Some((bytes, _))) => bytes,
            // no message after all
            Ok(None) => return,
            // the client is gone or does not keep to the protocol
            Err(_) => return self.end(client),
        };
        let request = self.buffer.get(..bytes).map(ControlRequest::from_bytes);
        let (head, query, outcome) = match request {
            Some(Ok(ControlRequest { head, fingerprint, call })) => {
                let query = match &call {
                    Call::Plan { query } => query_hash(query),
                    _ => 0,
                };
                (head, query, self.grant(client, fingerprint, call, stopping, statistics))
            }
            Some(Err((head, refusal))) => (head, 0, Err(refusal)),
            None => (CallHead::default(), 0, Err(Refusal::UnknownCall)),
        };
        let connection = self.connections.get(client);
        let descriptor = match &outcome {
            Ok(Grant::Hello { .. }) => Some(self.heartbeat.as_fd()),
            Ok(Grant::Batch) => connection.and_then(|one| one.batches.as_ref()).map(AsFd::as_fd),
            _ => None,
        };
        let response = ControlResponse {
            version: PROTOCOL_VERSION,
            nonce: head.nonce,
            query,
            fingerprint: self.fingerprint,
            instance: self.run.instance(),
            holder: match &outcome {
                Err(Refusal::TooManyPlans) => self.plans.greatest_holder(),
                Err(refusal) => self.connections.greatest_holder(refusal),
                Ok(_) => None,
            },
            outcome,
        };
        let sent =
            connection.map(|connection| connection.socket.send(&response.to_bytes(), descriptor));
        log(client, &response);
        let is_surplus = matches!(response.outcome, Err(Refusal::TooManyClients { .. }));
        if is_surplus || !matches!(sent, Some(Ok(()))) {
            self.end(client);
        }
    }

    /// Ends a connection, its plans and its transport.
    fn end(&mut self, client: u64) {
        self.plans.release_all(client);
        self.connections.close(client);
    }

    fn grant(
        &mut self,
        client: u64,
        fingerprint: u64,
        call: Call,
        stopping: bool,
        statistics: impl FnOnce(&Calls) -> Statistics,
    ) -> Result<Grant, Refusal> {
        if stopping {
            return Err(Refusal::Stopping);
        }
        if fingerprint != 0 && fingerprint != self.fingerprint {
            return Err(Refusal::WrongModel);
        }
        let served = self.connections.get(client).filter(|one| one.surplus_since.is_none());
        let Some(process) = served.map(|one| one.process) else {
            return Err(Refusal::TooManyClients { limit: self.connections.limit() });
        };
        let holder = Client { number: client, process };
        if matches!(call, Call::Lane { .. } | Call::Service) {
            self.orders.count(process, Instant::now())?;
        }
        let needed = match &call {
            Call::Plan { .. } => PLAN_NEEDS,
            Call::Lane { n_in, n_out } => {
                lane_needs([*n_in, *n_out].map(|n| class_of(n).unwrap_or(0)))
            }
            Call::Service => SERVICE_NEEDS,
            Call::Batch => 8 * BATCH_WORDS as u64,
            _ => 0,
        };
        if needed > 0 {
            self.memory.admit(needed)?;
        }
        match call {
            Call::Hello => Ok(Grant::Hello { root: self.root.clone(), pages: self.pages.len() }),
            Call::Model { page } => {
                let text = self.pages.get(page).cloned().ok_or(Refusal::NoSuchPage)?;
                Ok(Grant::Page { text })
            }
            Call::Plan { query } => {
                let Registered { number, n_in, n_out } =
                    self.plans.register(&self.model, &query, holder, &mut self.orders)?;
                Ok(Grant::Plan { number, n_in, n_out })
            }
            Call::Release { plan } => Ok(Grant::Released { had: self.plans.release(plan, holder) }),
            Call::Lane { n_in, n_out } => {
                let (Some(class_in), Some(class_out)) = (class_of(n_in), class_of(n_out)) else {
                    return Err(Refusal::TooLarge { n_in, n_out });
                };
                let link = self.connections.make_lane(&self.run, client, [class_in, class_out])?;
                Ok(Grant::Lane { link, class_in, class_out })
            }
            Call::Service => {
                Ok(Grant::Service { link: self.connections.make_service(&self.run, client)? })
            }
            Call::Serve => {
                self.connections.serve_service(client)?;
                Ok(Grant::Served)
            }
            Call::Batch => {
                self.connections.make_batches(client)?;
                Ok(Grant::Batch)
            }
            Call::Leave => {
                self.connections.leave(client);
                Ok(Grant::Left)
            }
            Call::Statistics => Ok(Grant::Statistics(Box::new(statistics(self)))),
        }
    }
}

/// Logs the answer to a call.
fn log(client: u64, response: &ControlResponse) {
    match &response.outcome {
        Ok(Grant::Plan { number, n_in, n_out }) => {
            info!(client, plan = number.0, n_in, n_out, "plan registered");
        }
        Ok(Grant::Released { had }) => debug!(client, had, "plan released"),
        Ok(Grant::Lane { link, .. }) => debug!(client, link, "lane"),
        Ok(Grant::Service { link }) => debug!(client, link, "service"),
        Ok(Grant::Served) => debug!(client, "service is polled"),
        Ok(Grant::Batch) => debug!(client, "batches are polled"),
        Ok(Grant::Left) => debug!(client, "lane or service given back"),
        Ok(Grant::Hello { .. } | Grant::Page { .. } | Grant::Statistics(_)) => {}
        Err(reason) => {
            warn!(client, ?reason, holder = response.holder.map(display), "refused");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_the_text_again() {
        let text = "äx".repeat(PAGE);
        let pages = pages(&text);
        assert!(pages.len() > 2 && pages.iter().all(|page| page.len() <= PAGE));
        assert_eq!(pages.concat(), text);
        assert_eq!(super::pages(""), [""]);
    }
}
