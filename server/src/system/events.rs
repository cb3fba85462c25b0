//! Events of `tracing` from the threads beside the answering thread.
//!
//! The control thread and the recorder emit them; the answering thread never does. Without a
//! subscriber an event is one comparison.

use sarrus_proto::control::{Grant, Refusal};
use tracing::{debug, error, info, warn};

/// Clients can attach.
pub(crate) fn serving(name: &str, robot: &str, fingerprint: u64, lanes: usize) {
    let fingerprint = format_args!("{fingerprint:016x}");
    info!(name, robot, %fingerprint, lanes, "serving");
}

/// The answering thread refuses from now on.
pub(crate) fn stopping(name: &str) {
    info!(name, "stopping");
}

/// The answering thread has no heartbeat.
pub(crate) fn hung(name: &str) {
    error!(name, "the answering thread hangs");
}

/// Requests and answers are kept in a file.
pub(crate) fn recording(file: &std::path::Path) {
    info!(file = %file.display(), "recording");
}

/// The recorder cannot write.
pub(crate) fn recording_ended(error: &std::io::Error) {
    error!(%error, "the recording ends");
}

/// A client connected.
pub(crate) fn attached(client: u64, process: u32) {
    info!(client, process, "attached");
}

/// A connection ended, and its resources are taken back.
pub(crate) fn detached(client: u64) {
    info!(client, "detached");
}

/// The answer to a call.
pub(crate) fn answered(client: u64, outcome: &Result<Grant, Refusal>) {
    match outcome {
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
        Err(reason) => warn!(client, ?reason, "refused"),
    }
}

/// Answers came after their deadlines since the last look.
pub(crate) fn late(answers: u64) {
    warn!(answers, "late");
}
