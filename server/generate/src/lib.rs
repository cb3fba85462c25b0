//! Straight-line code of the dynamics of one robot, in C or JavaScript.
//!
//! The kernels of [`sarrus_dynamics`] are generic over their scalar. [`Kernel::trace`] runs a plan
//! with a scalar that records each operation, and so turns the plan and its model into a list of
//! operations: the robot's constants are folded, products with zero and sums with zero are dropped,
//! and no operation occurs twice. [`sarrus_dynamics::Plan::close`] closes loops by Newton's method
//! beforehand; its results are inputs. The C code ([`Source`]) needs only `math.h`, computes the
//! common operations of equal parts of the robot in pairs, uses no memory and branches once, at its
//! end. Where it answers, it gives the bits of [`sarrus_dynamics::Plan::run`]; where it cannot, it
//! reports so, and the caller runs the plan. JavaScript ([`Script`]) does the same in a page. The
//! C is CUDA and OpenCL C too, for kernels over batches of states ([`Source::of_device`]).
//!
//! With the feature `load` a program loads the shared objects that a compiler makes from it
//! (`ObjectFile`, `NativeKernel`) and keeps them for the next time (`Cache`).

mod bound;
mod c;
mod compiler;
mod error;
mod graph;
mod js;
mod kernel;
mod lengths;
#[cfg(feature = "load")]
mod load;
// without shared objects manifests are written, not read
#[cfg_attr(not(feature = "load"), allow(dead_code))]
mod manifest;
mod pair;
mod prune;
mod recorder;
mod row;
mod run;
mod scalar;
mod states;
mod trace;

pub use c::{Device, FLAGS, Launcher, Source};
pub use compiler::{Built, Compiler};
pub use error::{BuildError, GenerateError};
pub use js::{Script, sigma_min};
pub use kernel::{Kernel, Outcome};
pub use lengths::Lengths;
#[cfg(feature = "load")]
pub use load::{
    Cache, CacheError, LoadError, LoadFault, Made, MakeError, NativeKernel, ObjectFile, Origin,
    Trial,
};
pub use manifest::{Manifest, bare_query};
pub use run::Cancel;
pub use states::{RandomInputs, random_input};

/// Result of generating code; the error is the reason why there is none.
type Generated<T = ()> = Result<T, GenerateError>;
