//! The common requests, one function each: sizes are checked, and the plan is prepared on first
//! use.
#![allow(unsafe_code, reason = "functions have names that C can link, and arrays come as pointers")]

use core::mem::MaybeUninit;

use sarrus_client::{Error, PlanId};

use crate::border::{arrays, make, put};
use crate::failure::{Failure, guarded};
use crate::plan::{Plan, handle};
use crate::robot::Robot;
use crate::status::{StatusCode, bits};

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
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([y, yd, ydd], [tau_u]) = unsafe {
            arrays([("y", y, n_qy), ("yd", yd, n_vy), ("ydd", ydd, n_vy)], [("tau_u", tau_u, n_u)])?
        };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        put(warnings, bits(robot.robot.inverse_dynamics(y, yd, ydd, tau_u)?));
        Ok(())
    })
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
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([y, yd, tau_u], [ydd]) = unsafe {
            arrays(
                [("y", y, n_qy), ("yd", yd, n_vy), ("tau_u", tau_u, n_u)],
                [("ydd", ydd, n_ydd)],
            )?
        };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        put(warnings, bits(robot.robot.forward_dynamics(y, yd, tau_u, ydd)?));
        Ok(())
    })
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
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([y, yd, ydd], [q, qd, qdd]) = unsafe {
            arrays(
                [("y", y, n_qy), ("yd", yd, n_vy), ("ydd", ydd, n_vy)],
                [("q", q, n_q), ("qd", qd, n_v), ("qdd", qdd, n_v)],
            )?
        };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        put(warnings, bits(robot.robot.state(y, yd, ydd, q, qd, qdd)?));
        Ok(())
    })
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
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([y, yd, ydd], [u, ud, udd]) = unsafe {
            arrays(
                [("y", y, n_qy), ("yd", yd, n_vy), ("ydd", ydd, n_vy)],
                [("u", u, n_u), ("ud", ud, n_u), ("udd", udd, n_u)],
            )?
        };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        put(warnings, bits(robot.robot.to_actuators(y, yd, ydd, u, ud, udd)?));
        Ok(())
    })
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
    guarded(|| {
        // SAFETY: the header states the requirements on the arrays.
        let ([u, ud, udd], [y, yd, ydd]) = unsafe {
            arrays(
                [("u", u, n_u), ("ud", ud, n_u), ("udd", udd, n_u)],
                [("y", y, n_qy), ("yd", yd, n_vy), ("ydd", ydd, n_vy)],
            )?
        };
        let robot = robot.ok_or(Failure::Null("robot"))?;
        put(warnings, bits(robot.robot.to_independent(u, ud, udd, y, yd, ydd)?));
        Ok(())
    })
}

/// Prepares sarrus_robot_inverse_dynamics, so that its first call does not allocate either.
/// `plan` may be NULL; else it gets a plan for sarrus_robot_ask, to be freed by sarrus_plan_free.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_inverse_dynamics(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, |robot| robot.robot.prepare_inverse_dynamics())
}

/// Prepares sarrus_robot_forward_dynamics.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_forward_dynamics(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, |robot| robot.robot.prepare_forward_dynamics())
}

/// Prepares sarrus_robot_state.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_state(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, |robot| robot.robot.prepare_state())
}

/// Prepares sarrus_robot_to_actuators.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_to_actuators(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, |robot| robot.robot.prepare_to_actuators())
}

/// Prepares sarrus_robot_to_independent.
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn sarrus_robot_prepare_to_independent(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
) -> StatusCode {
    prepared(robot, plan, |robot| robot.robot.prepare_to_independent())
}

fn prepared(
    robot: Option<&mut Robot>,
    plan: Option<&mut MaybeUninit<Option<Box<Plan>>>>,
    prepare: impl FnOnce(&mut Robot) -> Result<PlanId, Error>,
) -> StatusCode {
    guarded(|| {
        let prepared = || {
            let robot = robot.ok_or(Failure::Null("robot"))?;
            let id = prepare(robot)?;
            Ok((robot, id))
        };
        match plan {
            None => prepared().map(|_| ()),
            plan => make("plan", plan, || {
                let (robot, id) = prepared()?;
                handle(robot, id)
            }),
        }
    })
}
