//! The parts of a mechanism as plain data.

mod joint;
mod terms;

pub(crate) use joint::{Freedom, Motion, joint_pose, single_pose};
pub(crate) use terms::{Damper, JointTerms, Rotor, Spring};
