//! Recursions over the spanning tree: one algorithm, one file.

mod aba;
mod crba;
mod frames;
mod rnea;

pub(crate) use aba::{Articulated, articulated_solve};
pub(crate) use crba::reduced_mass_matrix;
pub(crate) use frames::{frame_acceleration, frame_jacobian, frame_pose, frame_twist, frame_wrench, rates, velocities, world_poses};
pub(crate) use rnea::{joint_poses, newton_euler};
