//! Kernels from shared objects: read, checked, loaded, compared with the generic kernels, called.
//!
//! Trust in a file grows step by step, and each step may refuse it: its owner and that it is whole
//! (`file.rs`); the symbols that it takes from other objects (`elf.rs`); its manifest
//! (`crate::Manifest`), against the robot and the plan; the system's loader (`object.rs`, the only
//! place that runs foreign code); its answers, bit by bit (`check.rs`). [`Cache`] keeps compiled
//! kernels, and has each new one tried in another process before this one loads it.

mod cache;
mod check;
mod elf;
mod error;
mod file;
mod native;
mod object;

pub use cache::{Cache, CacheError, Made, MakeError, Origin, Trial};
pub use error::{LoadError, LoadFault};
pub use file::ObjectFile;
pub use native::NativeKernel;

/// A step on the way to a loaded object; the error names the file.
type Loaded<T = ()> = Result<T, LoadError>;
