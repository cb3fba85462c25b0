//! Kinematics and dynamics of series-parallel hybrid robots.
//!
//! A [`description::Description`] holds what a person wrote; [`Model::compile`] turns it into flat
//! arrays; a [`Plan`] is the list of steps that a query needs; [`Plan::run`]
//! answers requests in a [`Workspace`] without allocating. Nothing here knows a clock, a file or a
//! transport.
#![forbid(unsafe_code)]
// the symbols of the equations
#![allow(non_snake_case)]

mod algorithms;
mod closure;
mod compile;
mod constrained;
pub mod description;
mod diagnostic;
mod initial_pose;
mod linalg;
mod mechanism;
mod model;
mod plan;
pub mod scalar;
mod spatial;
mod workspace;

pub use constrained::ImplicitForm;
pub use diagnostic::{CompileError, Diagnostic, Site};
pub use initial_pose::{AssembleError, Assembled, OpenModel, closing_placements, rezeroed};
pub use model::{ClosureAtZero, ClosureInfo, ClosureKind, Compiled, Model};
pub use plan::{Answer, Method, Plan};
pub use sarrus_proto::{
    Field, FieldSet, Layout, Query, QueryError, Request, Sizes, Slot, Status, Warnings,
};
pub use workspace::Workspace;
