//! Dual numbers of the tests.

pub use sarrus_units::{First, Second, model};
