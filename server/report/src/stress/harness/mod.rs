//! The harness of stress cases.

pub(super) mod ask;
pub(super) mod assess;
pub(super) mod case;
pub(super) mod robot;
pub(super) mod runs;
