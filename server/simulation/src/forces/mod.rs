//! Forces on a robot beside gravity and the terms of its joints.

mod gains;
pub(crate) mod inputs;
pub(crate) mod springs;
mod table;
