//! Names, sizes and limits of a robot.
#![allow(unsafe_code, reason = "functions have names that C can link")]

use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::ptr::null;

use crate::failure::{Failure, guarded};
use crate::robot::Robot;
use crate::status::StatusCode;

/// Lists of names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Order {
    /// The spanning tree's velocities: order of qd (n_v).
    Tree = 0,
    /// The spanning tree's coordinates: order of q (n_q).
    TreeQ = 1,
    /// The independent velocities: order of yd (n_vy).
    Independent = 2,
    /// The independent coordinates: order of y (n_qy).
    IndependentQ = 3,
    /// The actuators: order of u (n_u).
    Active = 4,
    /// The rows of the loop Jacobian K (n_c).
    Loops = 5,
    /// Clusters that have an assembly branch (n_branches).
    Branches = 6,
    /// Links.
    Links = 7,
    /// Warnings about the files, one line each.
    Warnings = 8,
}

/// Sizes that fix the shape of every field.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Sizes {
    /// Tree coordinates.
    pub n_q: usize,
    /// Tree velocities.
    pub n_v: usize,
    /// Independent coordinates.
    pub n_qy: usize,
    /// Independent velocities.
    pub n_vy: usize,
    /// Actuators.
    pub n_u: usize,
    /// Constraint rows.
    pub n_c: usize,
    /// Clusters with an assembly branch.
    pub n_branches: usize,
}

/// Limits of a tree coordinate, in its own unit; infinite where there is none.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Limits {
    /// Least position [m, rad].
    pub lower: f64,
    /// Greatest position [m, rad].
    pub upper: f64,
    /// Greatest speed [m/s, rad/s].
    pub velocity: f64,
    /// Greatest force or moment [N, N m].
    pub effort: f64,
}

/// The sizes of a robot.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_sizes(
    robot: Option<&Robot>,
    sizes: Option<&mut MaybeUninit<Sizes>>,
) -> StatusCode {
    guarded(|| {
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let sarrus_client::ModelInfo { sizes: found, .. } = robot.robot.model();
        sizes.ok_or(Failure::Null("sizes"))?.write(Sizes {
            n_q: found.n_q,
            n_v: found.n_v,
            n_qy: found.n_qy,
            n_vy: found.n_vy,
            n_u: found.n_u,
            n_c: found.n_c,
            n_branches: found.n_branches,
        });
        Ok(())
    })
}

/// How many names a list has, by a number of sarrus_order; 0 for NULL and for other numbers.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_name_count(robot: Option<&Robot>, order: u32) -> usize {
    robot.and_then(|robot| robot.names.get(order as usize)).map_or(0, |names| names.len())
}

/// A name of a list, which lives as long as the robot; NULL beyond its end.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_robot_name_at(
    robot: Option<&Robot>,
    order: u32,
    index: usize,
) -> *const c_char {
    robot
        .and_then(|robot| robot.names.get(order as usize)?.get(index))
        .map_or(null(), |name| name.as_ptr())
}

/// The limits of a tree coordinate, by its place in qd.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_limits(
    robot: Option<&Robot>,
    index: usize,
    limits: Option<&mut MaybeUninit<Limits>>,
) -> StatusCode {
    guarded(|| {
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let place = limits.ok_or(Failure::Null("limits"))?;
        let all = &robot.robot.model().limits;
        let absent = || Failure::Place("tree coordinate", index, all.len());
        let found = all.get(index).ok_or_else(absent)?.as_ref();
        let most = |bound: Option<f64>| bound.unwrap_or(f64::INFINITY);
        place.write(Limits {
            lower: found.and_then(|limits| limits.lower).unwrap_or(f64::NEG_INFINITY),
            upper: most(found.and_then(|limits| limits.upper)),
            velocity: most(found.and_then(|limits| limits.velocity)),
            effort: most(found.and_then(|limits| limits.effort)),
        });
        Ok(())
    })
}
