//! The operating system: processors, policies and limits, stopped processes, SIGBUS, stderr.

pub(crate) mod placement;
pub mod processes;
pub(crate) mod sigbus;
pub mod stderr;
