//! Kernels from shared objects: read, checked, loaded, compared with the generic kernels, called.
//!
//! Trust in a file grows step by step, and each step may refuse it: its owner and that it is whole
//! (`file.rs`); its manifest (`crate::Manifest`), against the robot and the plan; the system's
//! loader (`object.rs`, the only place that runs foreign code); its answers, bit by bit
//! (`check.rs`). [`Cache`] keeps compiled kernels.

mod cache;
mod check;
mod error;
mod file;
mod native;
mod object;

pub use cache::{Cache, CacheError, Made, MakeError, Origin};
pub use error::LoadError;
pub use file::ObjectFile;
pub use native::NativeKernel;
