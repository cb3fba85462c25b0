//! The operating system: processors, policies and limits, SIGBUS, stderr, the log's events.

pub(crate) mod events;
pub(crate) mod placement;
pub(crate) mod sigbus;
pub mod stderr;
