//! The implicit closure φ(q) = 0 of a cluster: its rows, their Jacobian and bias, and their
//! scaling.

pub(super) mod rates;
pub(super) mod rows;
pub(super) mod scaling;
pub(super) mod second;
mod so3_log;
