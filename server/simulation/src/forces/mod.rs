//! Forces on a robot beside gravity and the terms of its joints.

pub(crate) mod inputs;
pub(crate) mod springs;
