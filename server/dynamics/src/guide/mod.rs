//! Pages without code: symbols, closed forms, derivatives, parameters, motors, sources of the
//! equations.

pub mod closures;

#[doc = include_str!("derivatives.md")]
pub mod derivatives {}

#[doc = include_str!("parameters.md")]
pub mod parameters {}

#[doc = include_str!("motors.md")]
pub mod motors {}

#[doc = include_str!("notation.md")]
pub mod notation {}

#[doc = include_str!("bibliography.md")]
pub mod bibliography {}
