//! The sarrus server: one process holds a robot's model and answers requests over shared memory.
//!
//! [`serve()`] runs it. Two threads do the work. The answering thread (`answering/`) polls
//! lanes, services and batches and runs plans. The thread that called [`serve()`] (`upkeep/`)
//! accepts clients, answers their calls on the control socket, and makes and retires segments and
//! plans. The threads share counters and bounded channels, and no lock.
//!
//! Three threads run beside them: two compute expensive states (`answering/aside.rs`), one watches
//! upkeep. On request one writes the last seconds of requests to a file ([`record`]) and one
//! compiles plans to native code (`kernels/`). `system/` holds the placement of threads, limits,
//! SIGBUS and stderr. [`pool`] is the allocator of programs that serve.

mod answering;
mod error;
mod kernels;
pub mod pool;
pub mod record;
pub mod system;
mod upkeep;

pub use answering::wait::Wait;
pub use error::{MAX_LANES, ServeError};
pub use kernels::Kernels;
pub use system::placement::PlacementError;
pub use upkeep::serve::{ServeOptions, serve};
