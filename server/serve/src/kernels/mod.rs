//! Generated kernels for the plans of clients.
//!
//! A plan with a kernel has its answers from it wherever it answers, with the same bits, and from
//! the generic kernels elsewhere (`engine.rs`). Kernels come from one file, or are made in the
//! background (`maker.rs`). Built without `generate`, the server loads no code (`absent.rs`).

#[cfg(not(feature = "generate"))]
mod absent;
#[cfg(feature = "generate")]
mod maker;

#[cfg(not(feature = "generate"))]
pub use absent::Kernels;
#[cfg(not(feature = "generate"))]
pub(crate) use absent::{Maker, NativeKernel};
#[cfg(feature = "generate")]
pub use maker::Kernels;
#[cfg(feature = "generate")]
pub(crate) use maker::Maker;
#[cfg(feature = "generate")]
pub(crate) use sarrus_generate::NativeKernel;
