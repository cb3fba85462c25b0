//! One file for each command.

pub(crate) mod processor;
pub(crate) mod robot;
pub(crate) mod serve;
