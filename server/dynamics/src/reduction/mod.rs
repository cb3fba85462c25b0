//! A robot less what a scene does not need: joints that are held still, and branches that are left
//! out.
//!
//! Both make a [`Description`] from a description, and what is left is compiled as any other robot:
//! bodies that do not move against each other are merged, loops without a freedom are gone. What
//! the reduced robot answers is what the whole one answers with the joints held there (ẏ = ÿ = 0),
//! to what merging inertias rounds; joints that are held exert whatever holds them.
//!
//! # Holding joints still
//! [`locked`] holds joints at positions. Of a mechanism of several joints (a cluster) all joints
//! that cannot move any more are held, each where the loops close on the way that the whole robot
//! goes from its zero pose: the same assembly. Where freedoms are left, the mechanism keeps the
//! rows of its loops in the frames where they were, and coordinates mean what they meant; so its
//! zero pose, at which the independents that are left are 0, may have other joints elsewhere
//! ([`Description::zero_pose`]). Its actuators stay, also where they are then more than its
//! independents: inverse dynamics shares forces among them by least norm.
//!
//! An independent joint takes its own coordinate away. For any other joint one of the independents
//! of its mechanism that moves with it becomes dependent: the last one with at least 0.3 of the
//! largest gain.
//!
//! # Leaving branches out
//! [`restricted`] keeps some links with what their motion depends on: the joints between them and
//! the root, the mechanisms that these are part of, and all links that are fixed to a link that is
//! kept. A branch that begins at another joint is no part of the robot any more: neither is its
//! mass.

mod choice;
mod exchange;
mod fold;
mod lock;
mod pose;
mod restrict;

pub use lock::{Lock, locked};
pub use restrict::restricted;

use crate::description::Description;
use crate::diagnostic::Diagnostic;

/// A robot less some of its parts.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Reduced {
    /// The robot that is left.
    pub description: Description,
    /// What is remarkable but no error, by the places of the whole robot.
    pub warnings: Vec<Diagnostic>,
    /// Of each link the link of the whole robot.
    pub links: Vec<usize>,
    /// Of each joint that of the whole robot.
    pub joints: Vec<usize>,
    /// Of each submechanism that of the whole robot, and of each of its given loops the one there.
    pub submechanisms: Vec<(usize, Vec<usize>)>,
}
