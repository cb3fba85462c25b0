//! The rows of the implicit closure φ(q) = 0, their Jacobian and bias, relative to the cluster's
//! parent body.
//!
//! ```text
//!   x = R_Pᵀ (p_S − p_P)         θ = log(R_Pᵀ R_S)         φ = linear · x + angular · θ
//! ```
//! or, where two directions stay perpendicular as in a universal joint, φ = a · b with a fixed in P
//! and b in S. P and S are the cut frames on predecessor and successor [K21, eq. 2.79 with its
//! errata]. The θ of a screw goes on beyond half a turn.
//!
//! Newton's method takes the derivative of φ, with θ̇ = A ω; K and k = −K̇ q̇, of which λ are the
//! forces, take ω = R_Pᵀ (ω_S − ω_P) instead, so that λ are moments. At a closed pose either has
//! the span of the other where θ keeps to one line; elsewhere K is the derivative.

use nalgebra::{Matrix3, Vector3};

use crate::closure::Rate;
use crate::closure::constraint::so3_log::{log, log_factors, rate_matrix};
use crate::linalg::solve_pivoted;
use crate::mechanism::{Body, Cluster, Cut, CutRow, Dof, Motion, Screw, joint_pose, single_pose};
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose, zero};

/// (cos x, sin x).
#[inline(always)]
pub(in crate::closure) fn cos_sin_of<T: Real>(x: T) -> (T, T) {
    let (s, c) = x.sin_cos();
    (c, s)
}

/// Pose of one local body from its coordinates and their cosines and sines.
#[inline(always)]
pub(in crate::closure) fn place<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    j: usize,
    q: &[T],
    cos_sin: &[(T, T)],
    pose: &mut [Pose<T>],
) {
    let body = &bodies[j];
    let q = &q[body.q - cluster.q..];
    pose[j + 1] = match body.motion {
        Motion::Revolute | Motion::Prismatic => {
            single_pose(body, &base(cluster, bodies, j, pose), q[0], cos_sin[j])
        }
        Motion::Spherical | Motion::Floating => {
            place_freely(body, q, &pose[cluster.local_parent[j]])
        }
    };
}

/// Pose of one local body at zero of its own joint.
#[inline(always)]
pub(in crate::closure) fn base<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    j: usize,
    pose: &[Pose<T>],
) -> Pose<T> {
    let at_zero = Pose { R: bodies[j].R_parent_body, p: bodies[j].p_local };
    let parent = cluster.local_parent[j];
    if parent == 0 { at_zero } else { pose[parent].then(&at_zero) }
}

#[inline(never)]
fn place_freely<T: Real>(body: &Body<T>, q: &[T], parent: &Pose<T>) -> Pose<T> {
    parent.then(&joint_pose(body, &body.p_local, q, (T::ONE, T::ZERO)))
}

/// One cut at one pose: the quantities that all of its rows share.
pub(in crate::closure) struct CutState<'a, T> {
    /// Orientation of the predecessor {cluster's parent body}.
    pub(super) R_p: &'a Matrix3<T>,
    /// Origin of S, the point whose velocities count on both sides, and p_S − p_P.
    pub(super) point: Vector3<T>,
    pub(in crate::closure) d: Vector3<T>,
    /// Where a row is angular.
    pub(super) angular: Option<Angular<T>>,
}

/// The quantities of a cut that only angular rows need.
pub(super) struct Angular<T> {
    /// Orientations of P and S {cluster's parent body}.
    pub(super) R_P: Matrix3<T>,
    pub(super) R_S: Matrix3<T>,
    /// θ and the matrix of θ̇ = A ω.
    pub(super) theta: Vector3<T>,
    pub(super) A: Matrix3<T>,
}

impl<'a, T: Real> CutState<'a, T> {
    /// The state of a cut.
    #[inline(always)]
    pub(in crate::closure) fn new(cut: &Cut<T>, pose: &'a [Pose<T>]) -> CutState<'a, T> {
        CutState::with(cut, pose, Angular::new)
    }

    /// The state of a cut for rows that hold no angle.
    #[inline(always)]
    pub(in crate::closure) fn linear(cut: &Cut<T>, pose: &'a [Pose<T>]) -> CutState<'a, T> {
        let [p, s] = [cut.predecessor, cut.successor].map(|of| &pose[of]);
        let point = s.point(&cut.x_s_cut.p);
        CutState { R_p: &p.R, point, d: point - p.point(&cut.x_p_cut.p), angular: None }
    }

    /// The same with ω for θ̇ where the cut allows it: the rows of K and k.
    pub(super) fn of_forces(cut: &Cut<T>, pose: &'a [Pose<T>]) -> CutState<'a, T> {
        CutState::with(cut, pose, if cut.on_line { Angular::at_zero } else { Angular::new })
    }

    #[inline(always)]
    fn with(
        cut: &Cut<T>,
        pose: &'a [Pose<T>],
        angular: impl FnOnce(&Cut<T>, &Pose<T>, &Pose<T>) -> Angular<T>,
    ) -> CutState<'a, T> {
        let own = || angular(cut, &pose[cut.predecessor], &pose[cut.successor]);
        CutState { angular: cut.angular.then(own), ..CutState::linear(cut, pose) }
    }

    /// φ of a row.
    #[inline]
    pub(in crate::closure) fn value(&self, cluster: &Cluster<T>, row: &CutRow<T>, q: &[T]) -> T {
        if !row.terms.is_empty() {
            let linear = row
                .terms
                .iter()
                .fold(row.offset, |sum, (j, c)| (*c).mul_add(q[cluster.dofs[*j].q], sum));
            return row.curves.iter().fold(linear, |sum, curve| sum - curve.at(q[curve.of.q])[0]);
        }
        let x = self.R_p.apply_transposed(self.d);
        match (&self.angular, &row.against) {
            (None, _) => row.linear_p.dot(x),
            (Some(of), None) => {
                let along = row_along(row, &x, &of.theta);
                let Some(screw) = &row.screw else { return along };
                turns(cluster, screw, of, q).mul_add(row.angular.dot(screw.line), along)
            }
            (Some(of), Some(b)) => of.R_P.apply(row.angular).dot(of.R_S.apply(*b)),
        }
    }

    /// The directions of a row {cluster's parent body}: φ̇ = linear · v + angular · ω for the
    /// motion of S against P.
    #[inline(always)]
    pub(in crate::closure) fn directions(&self, row: &CutRow<T>) -> (Vector3<T>, Vector3<T>) {
        let linear = self.R_p.apply(row.linear_p);
        match (&self.angular, &row.against) {
            (None, _) => (linear, zero()),
            (Some(of), None) => (linear, of.R_P.apply(of.A.apply_transposed(row.angular))),
            (Some(of), Some(b)) => (zero(), of.R_S.apply(*b).cross(of.R_P.apply(row.angular))),
        }
    }

    /// Twist of S against P for a unit rate of one degree of freedom: (ω, v).
    #[inline(always)]
    pub(in crate::closure) fn twist(
        &self,
        of: &Dof,
        pose: &Pose<T>,
        on_successor: bool,
    ) -> (Vector3<T>, Vector3<T>) {
        let z = of.axis(&pose.R);
        let z = if on_successor { z } else { -z };
        if of.slides() { (zero(), z) } else { (z, z.cross(self.point - pose.p)) }
    }

    /// ẍ (in the predecessor's axes) and θ̈ at q̈ = 0, from the rates of the two bodies; of a ball
    /// joint p̈_S − p̈_P, in the axes of the cluster's parent body.
    #[inline]
    pub(in crate::closure) fn acceleration(
        &self,
        cut: &Cut<T>,
        pose: &[Pose<T>],
        rate: &[Rate<T>],
        ball: bool,
    ) -> (Vector3<T>, Vector3<T>) {
        let s = &rate[cut.successor];
        let p = &rate[cut.predecessor];
        let arm = |body: usize| self.point - pose[body].p;
        if ball {
            let a_s = s.acceleration(arm(cut.successor));
            return (a_s - p.acceleration(arm(cut.predecessor)), zero());
        }
        let at = |x: &Rate<T>, r: Vector3<T>| (x.v.add_cross(x.w, r), x.acceleration(r));
        let (v_s, a_s) = at(s, arm(cut.successor));
        let (v_p, a_p) = at(p, arm(cut.predecessor));
        // v_p, a_p: of the predecessor's point that coincides with S
        let relative = a_s - a_p - p.w.cross(v_s - v_p) * T::from_f64(2.0);
        let x = self.R_p.apply_transposed(relative);
        let Some(Angular { R_P, theta, A, .. }) = &self.angular else { return (x, zero()) };
        // θ̈ = A ω̇ + Ȧ ω with ω = R_Pᵀ (ω_S − ω_P)
        let w = R_P.apply_transposed(s.w - p.w);
        let w_dot = R_P.apply_transposed(s.alpha - p.alpha - p.w.cross(s.w));
        let theta_dot = A.apply(w);
        let (c, dc) = log_factors(theta);
        let c_dot = dc * T::from_f64(2.0) * (*theta).dot(theta_dot);
        let theta_w = (*theta).cross(w);
        let twice = theta_dot.cross(theta_w) + (*theta).cross(theta_dot.cross(w));
        let bias = theta_dot.cross(w) * T::from_f64(-0.5)
            + (twice * c).add_scaled((*theta).cross(theta_w), c_dot);
        (x, A.apply(w_dot) + bias)
    }
}

/// The whole turns of a screw: of all its angles the nearest to the one that its joints have made,
/// less the principal one.
fn turns<T: Real>(cluster: &Cluster<T>, screw: &Screw<T>, of: &Angular<T>, q: &[T]) -> T {
    let angle = screw.line.dot(of.theta);
    let made =
        (screw.joints.iter()).fold(T::ZERO, |sum, (j, c)| c.mul_add(q[cluster.dofs[*j].q], sum));
    let (sine, cosine) = T::sin_cos(angle - made);
    made + sine.atan2(cosine) - angle
}

impl<T: Real> Angular<T> {
    /// With θ = 0, for which θ̇ = ω.
    fn at_zero(cut: &Cut<T>, p: &Pose<T>, s: &Pose<T>) -> Angular<T> {
        let R_P = p.R.times(cut.x_p_cut.R);
        let R_S = s.R.times(cut.x_s_cut.R);
        Angular { A: Matrix::identity(), R_P, R_S, theta: zero() }
    }

    /// With θ, for values alone.
    #[inline(never)]
    fn turned(cut: &Cut<T>, p: &Pose<T>, s: &Pose<T>) -> Angular<T> {
        let at = Angular::at_zero(cut, p, s);
        Angular { theta: log(&at.R_P.transpose().times(at.R_S)), ..at }
    }

    #[inline(never)]
    fn new(cut: &Cut<T>, p: &Pose<T>, s: &Pose<T>) -> Angular<T> {
        let at = Angular::turned(cut, p, s);
        let (c, _) = log_factors(&at.theta);
        Angular { A: rate_matrix(&at.theta, c), ..at }
    }
}

/// φ̈ of a row at q̈ = 0 from ẍ and θ̈; the same of two perpendicular directions is
/// (α_S − α_P)·(b × a) + (ω_S − ω_P)·((ω_S × b) × a + b × (ω_P × a)).
#[inline(always)]
pub(in crate::closure) fn row_acceleration<T: Real>(
    cut: &Cut<T>,
    row: &CutRow<T>,
    state: &CutState<'_, T>,
    (x, theta): &(Vector3<T>, Vector3<T>),
    rate: &[Rate<T>],
) -> T {
    let Some(of) = &state.angular else { return row.linear_p.dot(*x) };
    let Some(b) = &row.against else { return row_along(row, x, theta) };
    let s = &rate[cut.successor];
    let p = &rate[cut.predecessor];
    let a = of.R_P.apply(row.angular);
    let b = of.R_S.apply(*b);
    let turning = s.w.cross(b).cross(a) + b.cross(p.w.cross(a));
    (s.alpha - p.alpha).dot(b.cross(a)) + (s.w - p.w).dot(turning)
}

/// linear · x + angular · θ of a row, x in the predecessor's axes.
#[inline(always)]
pub(in crate::closure) fn row_along<T: Real>(
    row: &CutRow<T>,
    x: &Vector3<T>,
    theta: &Vector3<T>,
) -> T {
    row.linear_p.dot(*x) + row.angular.dot(*theta)
}

/// φ of every row of a cluster.
pub(crate) fn constraint_residual<T: Real>(
    cluster: &Cluster<T>,
    pose: &[Pose<T>],
    q: &[T],
    phi: &mut [T],
) {
    let mut r = 0;
    for cut in &cluster.cuts {
        let state = CutState::with(cut, pose, Angular::turned);
        for row in &cut.rows {
            phi[r] = state.value(cluster, row, q);
            r += 1;
        }
    }
}

/// The largest of the residuals φ, in lengths of the cluster.
pub(crate) fn largest_residual<T: Real>(cluster: &Cluster<T>, phi: &[T]) -> T {
    let unit = T::from_f64(1.0 / cluster.length);
    let rows = cluster.cuts.iter().flat_map(|cut| &cut.rows);
    phi.iter().zip(rows).fold(T::ZERO, |largest, (phi, row)| {
        // angles and couplings are numbers already
        let is_length = row.terms.is_empty() && row.linear.iter().any(|x| *x != T::ZERO);
        let size = if is_length { phi.abs() * unit } else { phi.abs() };
        T::select_lt(size, largest, largest, size)
    })
}

/// ∂φ/∂q of a cluster (rows × n_v, row-major).
pub(crate) fn constraint_jacobian<T: Real>(
    cluster: &Cluster<T>,
    pose: &[Pose<T>],
    q: &[T],
    K: &mut [T],
) {
    jacobian(cluster, (pose, q), CutState::new, K);
}

/// K of a cluster, of which λ are the forces.
pub(crate) fn force_jacobian<T: Real>(
    cluster: &Cluster<T>,
    pose: &[Pose<T>],
    q: &[T],
    K: &mut [T],
) {
    jacobian(cluster, (pose, q), CutState::of_forces, K);
}

#[inline(always)]
fn jacobian<'a, T: Real>(
    cluster: &Cluster<T>,
    (pose, q): (&'a [Pose<T>], &[T]),
    state: impl Fn(&Cut<T>, &'a [Pose<T>]) -> CutState<'a, T>,
    K: &mut [T],
) {
    let n = cluster.n_v;
    let mut r = 0;
    for cut in &cluster.cuts {
        let state = state(cut, pose);
        for row in &cut.rows {
            let of_row = &mut K[r * n..(r + 1) * n];
            of_row.fill(T::ZERO);
            for (j, c) in &row.terms {
                of_row[*j] = *c;
            }
            for curve in &row.curves {
                of_row[curve.of.v] -= curve.at(q[curve.of.q])[1];
            }
            if row.terms.is_empty() {
                let (linear, angular) = state.directions(row);
                for &(j, on_successor) in &cut.path {
                    let at = &cluster.dofs[j];
                    let (w, v) = state.twist(at, &pose[at.body + 1], on_successor);
                    of_row[j] = linear.dot(v) + angular.dot(w);
                }
            }
            r += 1;
        }
    }
}

/// The bias that belongs to [`constraint_jacobian`], from q, q̇ and the bodies' rates at q̈ = 0.
pub(crate) fn constraint_bias<T: Real>(
    cluster: &Cluster<T>,
    pose: &[Pose<T>],
    rates: (&[T], &[T], &[Rate<T>]),
    k: &mut [T],
) {
    bias(cluster, pose, rates, CutState::new, k);
}

/// k = −K̇ q̇, which belongs to [`force_jacobian`].
pub(crate) fn force_bias<T: Real>(
    cluster: &Cluster<T>,
    pose: &[Pose<T>],
    rates: (&[T], &[T], &[Rate<T>]),
    k: &mut [T],
) {
    bias(cluster, pose, rates, CutState::of_forces, k);
}

#[inline(always)]
fn bias<'a, T: Real>(
    cluster: &Cluster<T>,
    pose: &'a [Pose<T>],
    (q, qd, rate): (&[T], &[T], &[Rate<T>]),
    state: impl Fn(&Cut<T>, &'a [Pose<T>]) -> CutState<'a, T>,
    k: &mut [T],
) {
    let mut r = 0;
    for cut in &cluster.cuts {
        let state = state(cut, pose);
        let second = state.acceleration(cut, pose, rate, false);
        for row in &cut.rows {
            k[r] = row.bend(q, qd) - row_acceleration(cut, row, &state, &second, rate);
            r += 1;
        }
    }
}

/// Turns λ of ∂φ/∂q into that of K, which exerts the same wrenches; `A` and `x` are scratch.
pub(crate) fn forces_of_derivative<T: Real>(
    cluster: &Cluster<T>,
    pose: &[Pose<T>],
    lambda: &mut [T],
    (A, x): (&mut [T], &mut [T]),
) {
    let mut rest = lambda;
    for cut in &cluster.cuts {
        let (lambda, after) = rest.split_at_mut(cut.rows.len());
        rest = after;
        let state = CutState::new(cut, pose);
        let Some(of) = state.angular.filter(|_| cut.on_line) else { continue };
        // the wrench, and its parts along the rows: Σ_s (r · s) λ_s = r · wrench
        let rows = || cut.rows.iter().enumerate().filter(|(_, row)| row.against.is_none());
        let m = rows().count();
        let mut moment = zero();
        let mut force = zero();
        for (k, row) in rows() {
            moment = moment.add_scaled(of.A.apply_transposed(row.angular), lambda[k]);
            force = force.add_scaled(row.linear, lambda[k]);
        }
        for (i, (_, a)) in rows().enumerate() {
            for (j, (_, b)) in rows().enumerate() {
                A[i * m + j] = a.angular.dot(b.angular) + a.linear.dot(b.linear);
            }
            x[i] = a.angular.dot(moment) + a.linear.dot(force);
        }
        if solve_pivoted(A, x, m, 1).is_some() {
            rows().zip(&*x).for_each(|((k, _), x)| lambda[k] = *x);
        }
    }
}

/// Poses of every local body from q; fills the cosines and sines of revolute joints.
pub(crate) fn local_poses<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    q: &[T],
    cos_sin: &mut [(T, T)],
    pose: &mut [Pose<T>],
) {
    pose[0] = Pose::identity();
    for j in 0..cluster.n {
        if bodies[j].motion == Motion::Revolute {
            cos_sin[j] = cos_sin_of(q[bodies[j].q - cluster.q]);
        }
        place(cluster, bodies, j, q, cos_sin, pose);
    }
}
