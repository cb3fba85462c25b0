//! The implicit closure φ(q) = 0 of a cluster: its rows, their Jacobian and bias, and the scaling in
//! which they are measured.

pub(super) mod rows;
pub(super) mod scaling;
mod so3_log;
