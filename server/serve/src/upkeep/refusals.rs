//! Faults of a client's part of shared memory, as refusals for the client.

use std::panic::{AssertUnwindSafe, catch_unwind};

use sarrus_proto::control::Refusal;
use sarrus_proto::run::free_shared_memory;

/// Drops a part of the transport. Where a client has overwritten the transport's records, dropping
/// panics; the rest of the part is then leaked.
pub(crate) fn take_down<T>(part: T) {
    let _ = catch_unwind(AssertUnwindSafe(|| drop(part)));
}

pub(crate) fn failed(error: &dyn std::fmt::Display) -> Refusal {
    Refusal::Failed { reason: error.to_string() }
}

pub(crate) fn no_space(error: &std::io::Error) -> Refusal {
    match error.kind() {
        std::io::ErrorKind::StorageFull => {
            Refusal::NoSpace { needed: 0, free: free_shared_memory() }
        }
        _ => failed(error),
    }
}
