//! Kinematics and dynamics of series-parallel hybrid robots.
//!
//! A [`description::Description`] holds a robot as a file or a [`DescriptionBuilder`] defines it.
//! [`Model::compile`] turns it into flat arrays. A [`Plan`] is the list of steps that a query
//! needs, and [`Plan::run`] answers requests in a [`Workspace`] without allocating. The crate uses
//! no clock, file or transport. The [`guide`] has the symbols, the sources of the equations and the
//! closed form of each mechanism.
//!
//! # Building
//!
//! On x86-64 the kernels need FMA and AVX2 at compile time. Cargo reads compiler flags from the
//! built project alone, so these two lines belong in its `.cargo/config.toml`; without them this
//! crate stops the build and prints them:
//!
//! ```toml
//! [target.'cfg(target_arch = "x86_64")']
//! rustflags = ["-C", "target-cpu=x86-64-v3"]
//! ```
//!
//! With the feature `portable` it compiles for any x86-64 processor. `mul_add` is then a call to
//! the system's library, which rounds once like the instruction: the answers keep their bits and
//! take three to seven times as long.
#![forbid(unsafe_code)]
// the symbols of the equations
#![allow(non_snake_case)]

// stops a build that would be slow by accident; documentation builds read no `rustflags`
#[cfg(all(
    target_arch = "x86_64",
    not(any(doc, doctest)),
    not(all(target_feature = "fma", target_feature = "avx2")),
    not(feature = "portable")
))]
compile_error!(
    r#"sarrus is built without FMA and AVX2 and would be three to seven times slower.
Put these two lines into `.cargo/config.toml` of your project:

[target.'cfg(target_arch = "x86_64")']
rustflags = ["-C", "target-cpu=x86-64-v3"]

RUSTFLAGS in the environment replaces them. For `cargo install`:
RUSTFLAGS="-C target-cpu=x86-64-v3" cargo install ...
For processors without FMA turn on the feature `portable`: the same results, slowly."#
);

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

mod algorithms;
mod builder;
mod closure;
mod compile;
mod constrained;
pub mod description;
mod diagnostic;
mod fingerprint;
pub mod guide;
mod initial_pose;
mod linalg;
mod mechanism;
mod model;
mod plan;
mod reduction;
pub mod scalar;
mod spatial;
mod workspace;

pub use builder::{CutBuilder, CutJoint, DescriptionBuilder, JointBuilder, LinkId};
pub use compile::{
    CLOSED_FORMS, SuggestedIndependents, curve_fault, fitting_types, joint_orders, loops_of,
    suggest_independents, table_fit,
};
pub use constrained::ImplicitForm;
pub use diagnostic::{CompileError, Diagnostic, Site};
pub use initial_pose::{
    AssembleError, Assembled, OpenModel, closing_placements, displaced, rezeroed,
};
pub use model::{Bound, ClosureAtZero, Compiled, Method, Model, Part};
pub use plan::{
    Base, Batch, BatchWorkspace, CUT_SHORT, ClosedNumbers, MOST_ROWS, NewtonBlock, NewtonCluster,
    Outline, PackedRows, Plan, PlanScalar, Planned, STRAIGHT_FIELDS, STRAIGHT_GIVEN,
    base_parameters,
};
pub use reduction::{Lock, Reduced, locked, restricted};
pub use sarrus_proto::{
    Answer, Axes, ClosureInfo, ClosureKind, FailedState, Field, FieldSet, JointLimits, Layout,
    ModelInfo, Query, QueryError, QueryOptions, Request, Sizes, Slot, Status, TaskParts, Warnings,
    named_enum,
};
pub use workspace::Workspace;
