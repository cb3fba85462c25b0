//! Pages to read: what the symbols mean, where the equations come from, how loops are closed in
//! closed form.
//!
//! There is no code here.

pub mod closures;

#[doc = include_str!("notation.md")]
pub mod notation {}

#[doc = include_str!("bibliography.md")]
pub mod bibliography {}
