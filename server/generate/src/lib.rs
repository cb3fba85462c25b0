//! Straight-line C of the dynamics of one robot.
//!
//! The kernels of [`sarrus_dynamics`] are generic over their scalar. With one that records what is
//! done with it ([`Kernel::trace`]) a plan on a model becomes a list of operations in which the
//! robot's constants are folded, products with zero and sums with it are gone, and no operation
//! stands twice. What Newton's method closes is closed before, by [`sarrus_dynamics::Plan::close`],
//! and its results are inputs. As C ([`Source`]) it needs `math.h` alone, does in pairs what like
//! parts of the robot have in common, has no memory of its own and one branch, at its end. It gives
//! the bits of [`sarrus_dynamics::Plan::run`] wherever it says that it answers, and says where it
//! does not: there the caller asks the plan.
//!
//! With the feature `load` a program loads the shared objects that a compiler made of it
//! (`ObjectFile`, `NativeKernel`) and keeps them for the next time (`Cache`).

mod bound;
mod c;
mod compiler;
mod error;
mod graph;
mod kernel;
#[cfg(feature = "load")]
mod load;
mod manifest;
mod pair;
mod prune;
mod recorder;
mod row;
mod run;
mod scalar;
mod states;
mod trace;

pub use c::Source;
pub use compiler::{BuildError, Built, Compiler, FLAGS};
pub use error::GenerateError;
pub use kernel::{Kernel, Outcome};
#[cfg(feature = "load")]
pub use load::{Cache, CacheError, LoadError, Made, MakeError, NativeKernel, ObjectFile, Origin};
pub use manifest::{Manifest, bare_query};
pub use run::Cancel;
pub use states::{RandomInputs, random_input};
