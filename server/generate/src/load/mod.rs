//! Kernels from shared objects: read, checked, loaded, compared with the generic kernels, called.
//!
//! What is believed of a file grows step by step, and each step may refuse it: whose it is and that
//! it is whole (`file.rs`); what it says of itself (`crate::Manifest`), against the robot and the
//! plan; the system's loader (`object.rs`, the only place that runs what is not ours); its answers,
//! bit by bit (`check.rs`). What was made once is kept by [`Cache`].

mod build;
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
