//! The operating system: processors, policies and limits, limits of memory, stopped processes,
//! SIGBUS, stderr.

pub(crate) mod memory;
pub(crate) mod placement;
pub mod processes;
pub(crate) mod sigbus;
pub mod stderr;
