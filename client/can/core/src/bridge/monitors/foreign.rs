//! A second master: the bus delivers a frame with an identifier that only this bridge uses.
//!
//! One frame is enough. Some adapters return the frames that they sent: a frame equal bit for bit
//! to one of the last two cycles counts as the bridge's own.

use crate::state::state;

/// Time for which a foreign frame keeps a motor from being armed `[ns]`.
const HEARD_NS: u64 = 1_000_000_000;

#[derive(Clone, Copy, Debug, Default)]
pub(in crate::bridge) struct Foreign {
    heard_ns: Option<u64>,
}

impl Foreign {
    /// A foreign frame arrived.
    pub(in crate::bridge) fn hear(&mut self, now_ns: u64) {
        self.heard_ns = Some(now_ns);
    }

    pub(super) fn is_heard(&self, now_ns: u64) -> bool {
        self.heard_ns.is_some_and(|heard| now_ns.saturating_sub(heard) < HEARD_NS)
    }
}

state!(Foreign { heard_ns });
