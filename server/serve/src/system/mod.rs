//! The operating system: processors, policies and limits, SIGBUS, stderr.

pub(crate) mod placement;
pub(crate) mod sigbus;
pub mod stderr;
