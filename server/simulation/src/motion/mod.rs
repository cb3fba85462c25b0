//! The equations of motion as a right-hand side ẋ = f(t, x), and the energy of a state.

pub(crate) mod elastic;
pub(crate) mod energy;
pub(crate) mod engine;
pub(crate) mod rates;
