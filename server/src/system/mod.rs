//! The operating system: processors and policies, limits, SIGBUS, stderr, the log's events.

pub(crate) mod events;
pub mod limits;
pub(crate) mod placement;
pub(crate) mod sigbus;
pub mod stderr;
