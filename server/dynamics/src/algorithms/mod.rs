//! Recursions over the spanning tree: one algorithm, one file.

mod centroidal;
mod cluster_aba;
mod cluster_columns;
mod crba;
mod derivatives;
mod frames;
mod mass_matrix;
mod regressor;
mod rnea;
mod terms;

pub(crate) use centroidal::Links;
pub(crate) use cluster_aba::embedded_solve;
pub(crate) use crba::{own_inertias, projected_solve, reduced_mass_matrix};
pub(crate) use derivatives::{force_derivatives, momenta, moving_bodies};
pub(crate) use frames::{
    frame_acceleration, frame_by_geometry, frame_jacobian, frame_pose, frame_twist, frame_wrench,
    in_root, pack, pose_numbers, rates, velocities, world_poses,
};
pub(crate) use mass_matrix::tree_mass_matrix;
pub(crate) use regressor::tree_regressor;
pub(crate) use rnea::{TreeMotion, joint_poses, newton_euler, rest_forces};
