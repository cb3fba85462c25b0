//! The sarrus server: one process holds a model and answers over shared memory.
//!
//! [`serve()`] runs it. Two threads share the work: the answering thread (`hot.rs`) polls both
//! transports and runs plans (`engine.rs`); the thread that called makes and retires lanes
//! (`lanes.rs`) and plans (`plans.rs`), answers the control service (`control.rs`) and publishes
//! statistics (`counters.rs`). Which processors and policies they have is decided in `placement/`.
//! They meet in counters and in bounded channels, never in a lock.

mod control;
mod counters;
mod engine;
mod hot;
mod lanes;
mod placement;
mod plans;
pub mod pool;
pub mod rights;
mod serve;
mod wait;

pub use placement::PlacementError;
pub use serve::{MAX_LANES, ServeError, ServeOptions, serve};
pub use wait::Wait;
