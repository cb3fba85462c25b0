//! The sarrus server: one process holds a model and answers over shared memory.
//!
//! [`serve()`] runs it. Two threads share the work: the answering thread (`hot.rs`) polls both
//! transports and runs plans (`engine.rs`); the thread that called takes clients in
//! (`arrivals.rs`), makes and retires lanes (`connections.rs`) and plans (`plans.rs`), answers the
//! control socket (`control.rs`) and counts (`counters.rs`). A third one keeps the last seconds in
//! a file where that is asked ([`record`]), another makes kernels of plans (`kernels/`). Which
//! processors and policies they have is decided in `placement/`. They meet in counters and in
//! bounded channels, never in a lock. What all but the answering thread log is in `events.rs`.

mod arrivals;
mod batches;
mod bus_guard;
mod connections;
mod control;
mod counters;
mod engine;
mod error;
mod events;
mod hot;
mod kernels;
mod placement;
mod places;
mod plans;
pub mod pool;
mod pulse;
pub mod record;
mod refusals;
pub mod rights;
mod serve;
pub mod stderr;
mod taken;
mod wait;

pub use error::{MAX_LANES, ServeError};
pub use kernels::Kernels;
pub use placement::PlacementError;
pub use serve::{ServeOptions, serve};
pub use wait::Wait;
