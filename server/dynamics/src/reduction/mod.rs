//! Reduces a robot to the needs of a scene: holds joints still, and omits branches.
//!
//! Both turn a [`Description`] into a description, which compiles as any other robot: bodies
//! without relative motion are merged, loops without freedom are removed. The reduced robot has the
//! answers of the whole one with the joints held there (ẏ = ÿ = 0), up to the rounding of merged
//! inertias; held joints exert any force that holds them.
//!
//! # Holding joints still
//! [`locked`] holds joints at positions. In a mechanism of several joints (a cluster) all joints
//! that lose their freedom are held, each where the loops close on the straight path from the zero
//! pose to the locked positions, all other independents at 0. A path of other independents to the
//! same positions leads to the same assembly where no singular pose lies between the two paths. If
//! freedoms remain, the mechanism keeps the rows of its loops in their frames, and coordinates keep
//! their meaning; so at its zero pose, where the remaining independents are 0, other joints may not
//! be ([`Description::zero_pose`]). Its actuators stay, even if they then outnumber its
//! independents: inverse dynamics shares forces among them by least norm.
//!
//! A held independent joint removes its own coordinate. For any other joint one of the independents
//! of its mechanism that moves with it becomes dependent: the last one with at least 0.3 of the
//! largest gain.
//!
//! # Leaving branches out
//! [`restricted`] keeps some links and the dependencies of their motion: the joints between them
//! and the root, the mechanisms that these are part of, and all links that are fixed to a link that
//! is kept. Branches that begin at other joints are removed with their mass.

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
    /// Warnings, by the sites of the whole robot.
    pub warnings: Vec<Diagnostic>,
    /// Of each link the link of the whole robot.
    pub links: Vec<usize>,
    /// Of each joint that of the whole robot.
    pub joints: Vec<usize>,
    /// Of each submechanism that of the whole robot, and of each of its given loops the one there.
    pub submechanisms: Vec<(usize, Vec<usize>)>,
}
