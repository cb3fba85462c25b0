//! Kinematics and dynamics of series-parallel hybrid robots.
#![forbid(unsafe_code)]
#![allow(non_snake_case)]

pub mod description;
mod fault;
pub mod scalar;

pub use fault::{CompileError, Fault, Site};
