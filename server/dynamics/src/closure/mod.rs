//! Loop closures: from the independent coordinates of a cluster to all of its coordinates, their
//! Jacobian G and bias g.
//!
//! Everything is relative to the cluster's parent body, so the cost grows with the cluster and not
//! with the robot. To add a closed form: one file beside these with its geometry, read off the
//! model at load (`build`) and its position, velocity and acceleration level; one variant of
//! [`Closure`].

mod constraint;
mod coupling;
mod leg;
mod numerical;
mod planar;
mod platform;
mod rrpr;

use nalgebra::Vector3;

pub(crate) use constraint::rows::{
    constraint_bias, constraint_jacobian, constraint_residual, largest_residual, local_poses,
    local_rates,
};
pub(crate) use constraint::scaling::{branch, column_unit, dependents_range, row_unit, scaled};
pub(crate) use coupling::Coupling;
pub(crate) use leg::Strut;
pub(crate) use numerical::block::{Block, BlockCut, Blocks, RowKind};
pub(crate) use numerical::continuation::loses_rank;
pub(crate) use numerical::{End, Numerical};
pub(crate) use planar::{Planar, Tie};
pub(crate) use platform::{Arm, Leg, Legs};
pub(crate) use rrpr::Rrpr;

use sarrus_proto::Status;

use self::numerical::continuation;
use crate::model::{Body, Cluster};
use crate::scalar::{Mask, Real, Scalar};
use crate::spatial::Pose;

/// Square of the sine, or of a length against its size, below which a pose is near a singular one:
/// rates are known to ε / δ² of their size at δ, accelerations to ε / δ³.
pub(crate) const NEAR: f64 = 1e-4;

/// How a cluster's loops are closed.
#[derive(Clone, Debug)]
pub(crate) enum Closure<C> {
    /// One free joint.
    Serial,
    /// Linear couplings, and parallelograms.
    Coupling(Coupling<C>),
    /// Lambda.
    Rrpr(Rrpr<C>),
    /// A chain of independent joints that carries a platform on legs (2SPU+1U, 6UPS, 2SPRR+1U).
    Legs(Legs<C>),
    /// A plane loop of four joints (four-bar, slider-crank).
    Planar(Planar<C>),
    /// Newton's method on the rows.
    Numerical(Numerical<C>),
}

/// A cut joint: two frames on two bodies of the cluster and the rows that tie them.
#[derive(Clone, Debug)]
pub(crate) struct Cut<C> {
    /// Local bodies (0 is the cluster's parent body) and the cut frames on them.
    pub(crate) predecessor: usize,
    pub(crate) successor: usize,
    pub(crate) x_p_cut: Pose<C>,
    pub(crate) x_s_cut: Pose<C>,
    /// Constrained directions {predecessor's cut frame}.
    pub(crate) rows: Vec<CutRow<C>>,
    /// Local joints between the two ends and the side on which they lie: true = successor's.
    pub(crate) path: Vec<(usize, bool)>,
    /// True when some row has an angular part.
    pub(crate) angular: bool,
}

/// One row of a cut, or a linear coupling when `terms` is not empty.
#[derive(Clone, Debug)]
pub(crate) struct CutRow<C> {
    pub(crate) angular: Vector3<C>,
    pub(crate) linear: Vector3<C>,
    /// The linear part {predecessor body}.
    pub(crate) linear_p: Vector3<C>,
    /// A direction {successor's cut frame} that the row holds perpendicular to the angular part.
    pub(crate) against: Option<Vector3<C>>,
    /// φ = Σ coefficient · q + offset over local joints.
    pub(crate) terms: Vec<(usize, C)>,
    pub(crate) offset: C,
}

/// How far down a closure is to be evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    Position,
    Velocity,
    Acceleration,
}

/// The numbers of one cluster, by local coordinate (q), velocity (q̇, G, g) or body (turns).
pub(crate) struct Local<'a, T> {
    /// The closed pose from which a numerical closure continues (n_q).
    pub(crate) start: &'a [T],
    /// The tree velocity at that pose, where one was given (n_v).
    pub(crate) tangent: Option<&'a [T]>,
    /// Tree coordinates, independents set (n_q).
    pub(crate) q: &'a mut [T],
    /// Cosine and sine of each revolute coordinate (n).
    pub(crate) turn: &'a mut [(T, T)],
    /// Tree velocities, independents set (n_v).
    pub(crate) qd: &'a mut [T],
    /// Loop Jacobian (n_v × n_vy, row-major).
    pub(crate) G: &'a mut [T],
    /// Bias (n_v).
    pub(crate) g: &'a mut [T],
    /// Scratch, shared by all clusters.
    pub(crate) scratch: &'a mut Scratch<T>,
}

/// Scratch for the largest cluster.
#[derive(Clone, Debug)]
pub(crate) struct Scratch<T> {
    /// Pose of each local body in the cluster's parent body; entry 0 is that body (n + 1).
    pub(crate) pose: Vec<Pose<T>>,
    /// The same at zero of the body's own joint, of bodies whose parent stands still within a block
    /// (n).
    pub(crate) base: Vec<Pose<T>>,
    /// Velocity and acceleration of each local body at q̈ = 0, cluster axes: ω, v, α, a of the
    /// origin (n + 1).
    pub(crate) rate: Vec<Rate<T>>,
    /// Constraint Jacobian (n_c × n_v).
    pub(crate) K: Vec<T>,
    /// Residuals and right-hand sides.
    pub(crate) phi: Vec<T>,
    /// Square and right-hand side matrices of the blocks, and their inverses one after the other.
    pub(crate) A: Vec<T>,
    pub(crate) B: Vec<T>,
    pub(crate) inverse: Vec<T>,
    /// Determinant of each block at the pose that Newton's method leaves.
    pub(crate) branch: Vec<T>,
    /// Newton's last step.
    pub(crate) step: Vec<T>,
    /// The last closed pose on a path, and the goal (n_q each).
    pub(crate) last: Vec<T>,
    pub(crate) goal: Vec<T>,
}

/// Rates of a local body, cluster axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate<T> {
    pub(crate) w: Vector3<T>,
    pub(crate) v: Vector3<T>,
    pub(crate) alpha: Vector3<T>,
    pub(crate) a: Vector3<T>,
}

/// What came of closing a cluster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    pub(crate) status: Status,
    pub(crate) iterations: u32,
    /// Closed, but so near a singular pose that rates may keep fewer than nine digits; told from
    /// the velocity level on.
    pub(crate) near: bool,
}

impl Outcome {
    pub(crate) const FINE: Outcome = Outcome::closed(0);

    pub(crate) const fn closed(iterations: u32) -> Outcome {
        Outcome { status: Status::Ok, iterations, near: false }
    }

    pub(crate) const fn failed(status: Status, iterations: u32) -> Outcome {
        Outcome { status, iterations, near: false }
    }
}

/// Least squared sine between the links of a closed form: 1e-24, or where the scalar has too few
/// digits for that the part of them that is lost at twice the root of its rounding.
const fn least_square_sine<T: Real>() -> f64 {
    let of_rounding = 8e7 * T::EPSILON * T::EPSILON;
    if of_rounding > 1e-24 { of_rounding } else { 1e-24 }
}

/// Which lanes a closed form could not serve, and why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Verdict<M> {
    pub(crate) unreachable: M,
    pub(crate) singular: M,
    /// As [`Outcome::near`].
    pub(crate) near: M,
}

impl<M: Mask> Verdict<M> {
    pub(crate) fn fine() -> Verdict<M> {
        let none = M::splat(false);
        Verdict { unreachable: none, singular: none, near: none }
    }

    /// From the square of what vanishes at a singular pose, negative beyond it, and the square of
    /// its size elsewhere.
    #[inline(always)]
    pub(crate) fn of<T: Real<Mask = M>>(square: T, size: T) -> Verdict<M> {
        let below = |floor: f64| square.lt(T::from_f64(floor) * size);
        Verdict {
            unreachable: square.lt(T::ZERO),
            singular: below(least_square_sine::<T>()),
            near: below(NEAR),
        }
    }

    /// Either.
    #[inline(always)]
    pub(crate) fn or(self, other: Verdict<M>) -> Verdict<M> {
        Verdict {
            unreachable: self.unreachable | other.unreachable,
            singular: self.singular | other.singular,
            near: self.near | other.near,
        }
    }
}

impl From<Verdict<bool>> for Outcome {
    fn from(verdict: Verdict<bool>) -> Outcome {
        if verdict.unreachable {
            Outcome::failed(Status::Unreachable, 0)
        } else if verdict.singular {
            Outcome::failed(Status::SingularClosure, 0)
        } else {
            Outcome { near: verdict.near, ..Outcome::FINE }
        }
    }
}

/// Closes one cluster down to the wanted level.
///
/// On entry `local.q` and `local.qd` hold y and ẏ at the independents. On return q, the turns, and
/// by level G and q̇, g are those of the closed pose.
pub(crate) fn close<T: Scalar>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    local: &mut Local<'_, T>,
    level: Level,
) -> Outcome {
    match &cluster.closure {
        // a free joint has nothing to close: q = y, G = 1, g = 0 are set where they are read
        Closure::Serial => Outcome::FINE,
        Closure::Coupling(coupling) => {
            coupling.close(cluster, bodies, local, level);
            match &coupling.polish {
                None => Outcome::FINE,
                Some(numerical) => {
                    polished(Outcome::FINE, numerical, cluster, bodies, local, level)
                }
            }
        }
        Closure::Planar(planar) => match &planar.polish {
            None => told(planar.close(local, level), cluster, bodies, local),
            Some(numerical) => polished(
                planar.close(local, Level::Position).into(),
                numerical,
                cluster,
                bodies,
                local,
                level,
            ),
        },
        Closure::Rrpr(rrpr) => match &rrpr.polish {
            None => told(rrpr.close(local, level), cluster, bodies, local),
            Some(numerical) => polished(
                rrpr.close(local, Level::Position).into(),
                numerical,
                cluster,
                bodies,
                local,
                level,
            ),
        },
        Closure::Legs(legs) => match &legs.polish {
            None => told(legs.close(cluster, bodies, local, level), cluster, bodies, local),
            Some(numerical) => polished(
                legs.close(cluster, bodies, local, Level::Position).into(),
                numerical,
                cluster,
                bodies,
                local,
                level,
            ),
        },
        Closure::Numerical(numerical) => numerical.close(cluster, bodies, local, level),
    }
}

/// How a closed form ended; where it is singular, whether K lost rank there or only its part K_d.
fn told<T: Scalar>(
    verdict: Verdict<bool>,
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    local: &mut Local<'_, T>,
) -> Outcome {
    if verdict.singular && !verdict.unreachable && local.q.iter().all(|q| q.is_finite()) {
        return Outcome::failed(continuation::singular_status(cluster, bodies, local), 0);
    }
    verdict.into()
}

/// The closed form starts Newton's method on the true rows of a mechanism that is only nearly of
/// its type.
fn polished<T: Scalar>(
    closed_form: Outcome,
    numerical: &Numerical<T>,
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    local: &mut Local<'_, T>,
    level: Level,
) -> Outcome {
    if closed_form.status != Status::Ok {
        return closed_form;
    }
    let outcome = numerical.polish(cluster, bodies, local);
    if outcome.status == Status::Ok {
        numerical.differentiate(cluster, bodies, local, level, outcome)
    } else {
        outcome
    }
}

impl<C> Closure<C> {
    /// Newton's method, where the closure has need of it.
    pub(crate) fn numerical(&mut self) -> Option<&mut Numerical<C>> {
        match self {
            Closure::Serial => None,
            Closure::Coupling(coupling) => coupling.polish.as_mut(),
            Closure::Rrpr(rrpr) => rrpr.polish.as_mut(),
            Closure::Legs(legs) => legs.polish.as_mut(),
            Closure::Planar(planar) => planar.polish.as_mut(),
            Closure::Numerical(numerical) => Some(numerical),
        }
    }
}

impl<C: nalgebra::Scalar + Copy> Closure<C> {
    /// The same closure with every constant converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Closure<D> {
        match self {
            Closure::Serial => Closure::Serial,
            Closure::Coupling(coupling) => Closure::Coupling(coupling.map(f)),
            Closure::Rrpr(rrpr) => Closure::Rrpr(rrpr.map(f)),
            Closure::Legs(legs) => Closure::Legs(legs.map(f)),
            Closure::Planar(planar) => Closure::Planar(planar.map(f)),
            Closure::Numerical(numerical) => Closure::Numerical(numerical.map(f)),
        }
    }
}

impl<C: nalgebra::Scalar + Copy> Cut<C> {
    /// The same cut with every constant converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Cut<D> {
        let row = |row: &CutRow<C>| CutRow {
            angular: row.angular.map(f),
            linear: row.linear.map(f),
            linear_p: row.linear_p.map(f),
            against: row.against.map(|b| b.map(f)),
            terms: row.terms.iter().map(|(j, c)| (*j, f(*c))).collect(),
            offset: f(row.offset),
        };
        Cut {
            predecessor: self.predecessor,
            successor: self.successor,
            x_p_cut: crate::model::map_pose(&self.x_p_cut, f),
            x_s_cut: crate::model::map_pose(&self.x_s_cut, f),
            rows: self.rows.iter().map(row).collect(),
            path: self.path.clone(),
            angular: self.angular,
        }
    }
}

/// A share of the way between two poses of a cluster's independents: straight in single
/// coordinates, along the great circle in quaternions.
pub(crate) fn between<T: Scalar>(
    cluster: &Cluster<T>,
    from: &[T],
    to: &[T],
    share: T,
    q: &mut [T],
) {
    for &i in &cluster.independent_q {
        q[i] = (to[i] - from[i]).mul_add(share, from[i]);
    }
    let quaternions = cluster
        .independent
        .iter()
        .map(|v| &cluster.freedoms[*v])
        .filter(|at| at.k == 0 && at.motion.n_q() > 1);
    for at in quaternions {
        // q and −q are the same turn: the nearer one
        let four = at.q + at.motion.n_q() - 4..at.q + at.motion.n_q();
        let along = four.clone().fold(T::ZERO, |sum, i| from[i].mul_add(to[i], sum));
        for i in four.clone() {
            let to = if along < T::ZERO { -to[i] } else { to[i] };
            q[i] = (to - from[i]).mul_add(share, from[i]);
        }
        let norm = four.clone().fold(T::ZERO, |sum, i| q[i].mul_add(q[i], sum)).sqrt();
        four.for_each(|i| q[i] = q[i] / norm);
    }
}
