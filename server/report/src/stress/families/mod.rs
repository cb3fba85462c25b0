//! Families of stress cases.

pub(super) mod chains;
pub(super) mod far;
pub(super) mod implicit;
pub(super) mod loops;
pub(super) mod mass;
pub(super) mod scale;
pub(super) mod simulated;
pub(super) mod singular;
pub(super) mod starts;
pub(super) mod terms;
