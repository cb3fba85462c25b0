//! Loop closures: from the independent coordinates of a cluster to all of its coordinates, their
//! Jacobian G and bias g.
//!
//! All quantities are relative to the cluster's parent body, so the cost grows with the cluster,
//! not with the robot. To add a closed form: one file beside these with its geometry, read off the
//! model at load (`build`) and its position, velocity and acceleration level; one variant of
//! [`Closure`].

mod constraint;
mod coupling;
mod dyads;
mod leg;
mod local;
mod numerical;
mod outcome;
mod path;
mod planar;
mod plane;
mod platform;
mod rod;
mod rrpr;
mod sliding;

pub(crate) use constraint::rates::local_rates;
pub(crate) use constraint::rows::{
    constraint_bias, constraint_jacobian, constraint_residual, force_bias, force_jacobian,
    forces_of_derivative, largest_residual, local_poses,
};
pub(crate) use constraint::scaling::{
    CLEAR, assembly_branch, column_unit, declared, declared_forces, dependents_range, row_unit,
    rows_at, scaled,
};
pub(crate) use constraint::second::Second;
pub(crate) use coupling::Coupling;
pub(crate) use dyads::{Driven, Dyads, Pair, Pin, Step};
pub(crate) use leg::Strut;
pub(crate) use local::{BUDGET, Level, Local, Rate, Scratch, TURN, Twist, UNBOUNDED};
pub(crate) use numerical::block::{Block, BlockCut, Blocks, RowKind};
pub(crate) use numerical::continuation::loses_rank;
pub(crate) use numerical::elimination::Elimination;
pub(crate) use numerical::seeds::{Axis, LANES, MOST, Seeds};
pub(crate) use numerical::{
    BlockForm, Chain, End, FEW_STEPS, Form, Formed, Mover, Numerical, Rod, Rods, Steps, Turn, screw,
};
pub(crate) use outcome::{Outcome, Validity};
pub(crate) use path::{distance, interpolate, largest_distance};
pub(crate) use planar::{LoopJoint, Planar, TwoLinks};
pub(crate) use plane::Point;
pub(crate) use platform::{Arm, Leg, Platform};
pub(crate) use rod::{RodLeg, Universal};
pub(crate) use rrpr::Rrpr;
pub(crate) use sliding::{DrivenSlide, Joints, Slider, SlidingPair};

use sarrus_proto::Status;

use self::numerical::continuation;
use crate::scalar::{Real, constants};

/// How a cluster's loops are closed.
#[derive(Clone, Debug)]
pub(crate) enum Closure<T> {
    /// One free joint.
    Serial,
    /// Couplings, and parallelograms.
    Coupling(Coupling<T>),
    /// Lambda.
    Rrpr(Rrpr<T>),
    /// A chain of independent joints that carries a platform on legs (2SPU+1U, 6UPS, 2SPRR+1U,
    /// 2SURRPR+1U).
    Platform(Platform<T>),
    /// A plane loop of four joints (four-bar, slider-crank).
    Planar(Planar<T>),
    /// Newton's method on the rows.
    Numerical(Numerical<T>),
}

impl<T: Real> Closure<T> {
    /// Closes one cluster down to a level.
    ///
    /// On entry `local.q` and `local.qd` hold y and, where the level asks for q̇, ẏ at the
    /// independents. On return q, the cosines and sines, and by level G, q̇ and g are those of the
    /// closed pose.
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Outcome {
        match self {
            // a free joint has nothing to close: q = y, G = 1, g = 0 are set where they are read
            Closure::Serial => Outcome::FINE,
            Closure::Coupling(coupling) => {
                coupling.close(local, level);
                match &coupling.polish {
                    None => Outcome::FINE,
                    Some(numerical) => polished(Outcome::FINE, numerical, local, level),
                }
            }
            Closure::Planar(planar) => match &planar.polish {
                None => report(planar.close(local, level), local),
                Some(numerical) => {
                    polished(planar.close(local, Level::Position).into(), numerical, local, level)
                }
            },
            Closure::Rrpr(rrpr) => match &rrpr.polish {
                None => report(rrpr.close(local, level), local),
                Some(numerical) => {
                    polished(rrpr.close(local, Level::Position).into(), numerical, local, level)
                }
            },
            Closure::Platform(platform) => match &platform.polish {
                None => report(platform.close(local, level), local),
                Some(numerical) => {
                    polished(platform.close(local, Level::Position).into(), numerical, local, level)
                }
            },
            Closure::Numerical(numerical) => numerical.close(local, level),
        }
    }
}

/// How a closed form ended; where it is singular, whether K lost rank there or only its part K_d.
fn report<T: Real>(validity: Validity<T>, local: &mut Local<'_, T>) -> Outcome {
    if validity.singular && !validity.unreachable && local.q.iter().all(|q| q.is_finite()) {
        return Outcome::failed(continuation::singular_status(local), 0);
    }
    validity.into()
}

/// The closed form starts Newton's method on the true rows of a mechanism that is only nearly of
/// its type.
fn polished<T: Real>(
    closed_form: Outcome,
    numerical: &Numerical<T>,
    local: &mut Local<'_, T>,
    level: Level,
) -> Outcome {
    if closed_form.status != Status::Ok {
        return closed_form;
    }
    let outcome = numerical.polish(local);
    if outcome.status == Status::Ok {
        numerical.differentiate(local, level, outcome)
    } else {
        outcome
    }
}

impl<T> Closure<T> {
    /// True where no state needs Newton's method.
    pub(crate) fn is_closed_form(&self) -> bool {
        match self {
            Closure::Serial => true,
            Closure::Coupling(coupling) => coupling.polish.is_none(),
            Closure::Rrpr(rrpr) => rrpr.polish.is_none(),
            Closure::Platform(platform) => platform.polish.is_none(),
            Closure::Planar(planar) => planar.polish.is_none(),
            Closure::Numerical(_) => false,
        }
    }

    /// True where G is constant.
    pub(crate) fn is_linear(&self) -> bool {
        match self {
            Closure::Serial => true,
            Closure::Coupling(coupling) => coupling.polish.is_none() && coupling.curves.is_empty(),
            _ => false,
        }
    }

    /// Newton's method, where the closure has need of it.
    pub(crate) fn numerical(&mut self) -> Option<&mut Numerical<T>> {
        match self {
            Closure::Serial => None,
            Closure::Coupling(coupling) => coupling.polish.as_mut(),
            Closure::Rrpr(rrpr) => rrpr.polish.as_mut(),
            Closure::Platform(platform) => platform.polish.as_mut(),
            Closure::Planar(planar) => planar.polish.as_mut(),
            Closure::Numerical(numerical) => Some(numerical),
        }
    }
}

constants! { enum Closure:
    keep Serial;
    map Coupling Rrpr Platform Planar Numerical;
}
