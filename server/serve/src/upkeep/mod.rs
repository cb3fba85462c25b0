//! The upkeep thread: clients, their calls, segments and plans.

pub(crate) mod calls;
pub(crate) mod connections;
pub(crate) mod listener;
pub(crate) mod plans;
pub(crate) mod quota;
pub(crate) mod refusals;
pub(crate) mod segment;
pub(crate) mod serve;
pub(crate) mod watchdog;
