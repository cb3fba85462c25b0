//! The parts of a mechanism as plain data: bodies and their joints, clusters of joints and the cuts
//! that close them. Knows neither closures nor algorithms.

mod body;
mod cluster;
mod curve;
mod cut;
mod joint;
mod motor;
mod terms;
mod turns;
mod winding;

pub(crate) use body::{Body, Frame};
pub(crate) use cluster::{Cluster, GBlock};
pub(crate) use curve::{Curve, values};
pub(crate) use cut::{Cut, CutRow, Screw};
pub(crate) use joint::{Dof, Motion, joint_pose, single_pose};
pub(crate) use motor::Motor;
pub(crate) use terms::{Damper, Friction, JointTerms, Rotor, Spring};
pub(crate) use turns::{read_turns, turn, turn_some};
pub(crate) use winding::{Winding, Windings};
