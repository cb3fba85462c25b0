//! The thread that answers: lanes, services and batches in, answers out.
//!
//! It allocates nothing, takes no lock and writes no log; orders reach it through bounded channels.

pub(crate) mod aside;
pub(crate) mod batches;
pub(crate) mod counters;
pub(crate) mod engine;
pub(crate) mod thread;
pub(crate) mod timing;
pub(crate) mod wait;
