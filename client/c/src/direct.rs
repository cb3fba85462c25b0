//! The common requests, one function each: sizes are checked, and the plan is prepared on first
//! use.
#![allow(unsafe_code, reason = "functions have names that C can link, and arrays come as pointers")]

use core::mem::MaybeUninit;

use sarrus_client::{Error, PlanId};

use crate::border::{arrays, make, put};
use crate::failure::{Failure, guarded};
use crate::plan::{Plan, handle};
use crate::robot::Robot;
use crate::status::StatusCode;

/// Checks the arrays of a call, each beside its length, and calls the robot's method of this name.
macro_rules! ask {
    (
        $robot:ident, $method:ident,
        [$($given:ident: $n_given:ident),*] => [$($want:ident: $n_want:ident),*],
        $warnings:ident
    ) => {
        guarded(|| {
            let given = [$((stringify!($given), $given, $n_given)),*];
            let want = [$((stringify!($want), $want, $n_want)),*];
            // SAFETY: the header states the requirements on the arrays.
            let ([$($given),*], [$($want),*]) = unsafe { arrays(given, want)? };
            let robot = $robot.ok_or(Failure::Null("robot"))?;
            put($warnings, robot.robot.$method($($given,)* $($want),*)?.0);
            Ok(())
        })
    };
}

/// Actuator forces for a motion: tau_u = G_u^-T (M_y ydd + C_y).
///
/// y [m, rad] (n_qy), yd and ydd (n_vy), tau_u [N, N m] (n_u).
///
/// This and the four functions below: the first call of each prepares its plan and allocates, later
/// ones never do, in process and through a lane; sarrus_robot_prepare_... does that ahead of time.
/// After a failure all results are NaN, unless a pointer cannot be used. `warnings` gets bits of
/// sarrus_warning after SARRUS_STATUS_OK, and may be NULL.
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_inverse_dynamics(
    robot: Option<&mut Robot>,
    y: *const f64,
    n_qy: usize,
    yd: *const f64,
    ydd: *const f64,
    n_vy: usize,
    tau_u: *mut f64,
    n_u: usize,
    warnings: Option<&mut MaybeUninit<u32>>,
) -> StatusCode {
    ask!(robot, inverse_dynamics, [y: n_qy, yd: n_vy, ydd: n_vy] => [tau_u: n_u], warnings)
}

/// Motion under actuator forces: ydd = M_y^-1 (G_u^T tau_u - C_y).
///
/// y [m, rad] (n_qy), yd (n_vy), tau_u [N, N m] (n_u), ydd (n_ydd, which is n_vy).
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_forward_dynamics(
    robot: Option<&mut Robot>,
    y: *const f64,
    n_qy: usize,
    yd: *const f64,
    n_vy: usize,
    tau_u: *const f64,
    n_u: usize,
    ydd: *mut f64,
    n_ydd: usize,
    warnings: Option<&mut MaybeUninit<u32>>,
) -> StatusCode {
    ask!(robot, forward_dynamics, [y: n_qy, yd: n_vy, tau_u: n_u] => [ydd: n_ydd], warnings)
}

/// The motion of all joints of the spanning tree that goes with an independent motion.
///
/// y [m, rad] (n_qy), yd and ydd (n_vy); q (n_q), qd and qdd (n_v).
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_state(
    robot: Option<&mut Robot>,
    y: *const f64,
    n_qy: usize,
    yd: *const f64,
    ydd: *const f64,
    n_vy: usize,
    q: *mut f64,
    n_q: usize,
    qd: *mut f64,
    qdd: *mut f64,
    n_v: usize,
    warnings: Option<&mut MaybeUninit<u32>>,
) -> StatusCode {
    ask!(robot, state, [y: n_qy, yd: n_vy, ydd: n_vy] => [q: n_q, qd: n_v, qdd: n_v], warnings)
}

/// The actuators' motion: u, ud = G_u yd, udd = G_u ydd + g_u.
///
/// y [m, rad] (n_qy), yd and ydd (n_vy); u, ud and udd (n_u).
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_to_actuators(
    robot: Option<&mut Robot>,
    y: *const f64,
    n_qy: usize,
    yd: *const f64,
    ydd: *const f64,
    n_vy: usize,
    u: *mut f64,
    ud: *mut f64,
    udd: *mut f64,
    n_u: usize,
    warnings: Option<&mut MaybeUninit<u32>>,
) -> StatusCode {
    ask!(
        robot, to_actuators, [y: n_qy, yd: n_vy, ydd: n_vy] => [u: n_u, ud: n_u, udd: n_u],
        warnings
    )
}

/// The independent motion that encoders of the actuators show: the inverse of
/// sarrus_robot_to_actuators, from the pose where all coordinates are zero.
///
/// u [m, rad], ud and udd (n_u); y (n_qy), yd and ydd (n_vy).
#[unsafe(no_mangle)]
#[must_use]
pub unsafe extern "C" fn sarrus_robot_to_independent(
    robot: Option<&mut Robot>,
    u: *const f64,
    ud: *const f64,
    udd: *const f64,
    n_u: usize,
    y: *mut f64,
    n_qy: usize,
    yd: *mut f64,
    ydd: *mut f64,
    n_vy: usize,
    warnings: Option<&mut MaybeUninit<u32>>,
) -> StatusCode {
    ask!(
        robot, to_independent, [u: n_u, ud: n_u, udd: n_u] => [y: n_qy, yd: n_vy, ydd: n_vy],
        warnings
    )
}

/// Prepares sarrus_robot_inverse_dynamics, so that its first call does not allocate either.
/// `plan` may be NULL; else it gets a plan for sarrus_robot_ask, to be freed by sarrus_plan_free.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_inverse_dynamics(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, sarrus_client::Robot::prepare_inverse_dynamics)
}

/// Prepares sarrus_robot_forward_dynamics.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_forward_dynamics(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, sarrus_client::Robot::prepare_forward_dynamics)
}

/// Prepares sarrus_robot_state.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_state(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, sarrus_client::Robot::prepare_state)
}

/// Prepares sarrus_robot_to_actuators.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_to_actuators(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, sarrus_client::Robot::prepare_to_actuators)
}

/// Prepares sarrus_robot_to_independent.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_to_independent(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, sarrus_client::Robot::prepare_to_independent)
}

fn prepared(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
    prepare: fn(&mut sarrus_client::Robot) -> Result<PlanId, Error>,
) -> StatusCode {
    let prepared = || {
        let robot = robot.ok_or(Failure::Null("robot"))?;
        let id = prepare(&mut robot.robot)?;
        Ok((robot, id))
    };
    match plan {
        None => guarded(|| prepared().map(drop)),
        plan => make("plan", plan, || prepared().and_then(|(robot, id)| handle(robot, id))),
    }
}
