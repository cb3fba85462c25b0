//! The whole tree with its loops as constraints, at a state that need not be closed: for
//! integration in all coordinates, as in other engines.

use sarrus_proto::Status;

use crate::algorithms::{self, TreeMotion};
use crate::closure::{
    CLEAR, Scratch, column_unit, constraint_residual, declared_forces, forces_of_derivative,
    largest_residual, loses_rank, row_unit, rows_at, scaled,
};
use crate::linalg::least_norm;
use crate::mechanism::{Cluster, Motion};
use crate::model::{Model, Scope};
use crate::plan::{Drift, drift_of, supports, tree_under_constraints, wrenches_on_bodies};
use crate::scalar::Real;
use crate::workspace::{Needs, Workspace};

/// Steps of one projection, and the longest one, in radians or cluster lengths.
const STEPS: u32 = 50;
const LONGEST: f64 = 0.3;
/// Residual, in cluster lengths, from which on a redundant row indicates another pose.
const APART: f64 = 1e-3;
/// Lengths of a quaternion that count as rounding or an integrator's error.
const LENGTHS: [f64; 2] = [0.5, 2.0];

/// Forward dynamics in all tree coordinates, with Baumgarte's stabilisation, and the projection
/// onto the closed states.
///
/// ```text
///   M q̈ − Kᵀ λ = τ_q − C + Σ Jᵀ w        K q̈ = k − 2 α K q̇ − β² φ
/// ```
/// with the rows of K that were kept at load; the forces of the others are zero. Idle joints do not
/// move. q and q̇ have the external order of [`Model::tree_q_names`] and [`Model::tree_names`];
/// quaternions may be off unit length by a factor of up to two. Holds all scratch, so that nothing
/// allocates after [`ImplicitForm::new`].
///
/// Source: [F08, 8.5]; \[B72\], see [`crate::guide::bibliography`].
#[derive(Clone, Debug)]
pub struct ImplicitForm<T: Real> {
    fingerprint: u64,
    ws: Workspace<T>,
    /// Links with wrenches, and the bodies on the paths to them.
    links: Vec<(usize, usize)>,
    bodies: Vec<usize>,
    scope: Scope,
    /// By the user's order of rows.
    lambda: Vec<T>,
    drift: Drift<T>,
}

impl<T: Real> ImplicitForm<T> {
    /// Scratch for a model, without wrenches. Allocates; nothing after it does.
    pub fn new(model: &Model<T>) -> ImplicitForm<T> {
        ImplicitForm::with_wrenches(model, &[])
    }

    /// Scratch for a model with wrenches on these links, each an index into [`Model::link_names`];
    /// other indices are ignored. Allocates.
    pub fn with_wrenches(model: &Model<T>, links: &[u16]) -> ImplicitForm<T> {
        let links: Vec<usize> = links
            .iter()
            .map(|link| usize::from(*link))
            .filter(|link| *link < model.frames.len())
            .collect();
        ImplicitForm {
            fingerprint: model.fingerprint(),
            ws: Workspace::sized(model, Needs { kkt: true, ..Needs::default() }),
            bodies: supports(model, &links),
            links: links.into_iter().enumerate().collect(),
            scope: Scope::whole(model),
            lambda: vec![T::ZERO; model.sizes().n_c],
            drift: Drift { position: T::ZERO, velocity: T::ZERO },
        }
    }

    /// q̈ from the state, the forces on the tree and those on links.
    ///
    /// `q` (n_q), `qd`, `tau_q` and `qdd` (n_v); `wrenches` holds `[n; f]` in world axes at the
    /// origin of each link of [`ImplicitForm::with_wrenches`]; `stabilisation` is (α, β) `[1/s]`,
    /// zero for none. Fails where K has lost rank or M is not positive along the loops; q̈ is then
    /// NaN. Cost: a dense elimination of n_v plus kept rows. Allocates never.
    pub fn accelerations(
        &mut self,
        model: &Model<T>,
        q: &[T],
        qd: &[T],
        tau_q: &[T],
        wrenches: &[T],
        stabilisation: (T, T),
        qdd: &mut [T],
    ) -> Status {
        let sizes = model.sizes();
        let fits = (tau_q.len(), wrenches.len(), qdd.len())
            == (sizes.n_v, 6 * self.links.len(), sizes.n_v);
        let given = tau_q
            .iter()
            .chain(wrenches)
            .chain([&stabilisation.0, &stabilisation.1])
            .all(|x| x.is_finite());
        let taken = self.take(model, q, qd).and(match (fits, given) {
            (false, _) => Err(Status::WrongSize),
            (_, false) => Err(Status::NonFiniteInput),
            _ => Ok(()),
        });
        let ended = taken.and_then(|()| self.solve(model, tau_q, wrenches, stabilisation));
        if let Err(status) = ended {
            qdd.fill(T::from_f64(f64::NAN));
            self.lambda.fill(T::from_f64(f64::NAN));
            return status;
        }
        for (qdd, v) in qdd.iter_mut().zip(&model.order.v) {
            *qdd = self.ws.qdd[*v];
        }
        Status::Ok
    }

    /// λ of the last [`ImplicitForm::accelerations`], in the order of [`Model::loop_names`] (n_c).
    pub fn lambda(&self) -> &[T] {
        &self.lambda
    }

    /// How far a state is from closed, into [`ImplicitForm::position_drift`] and
    /// [`ImplicitForm::velocity_drift`], and nothing else. Allocates never.
    pub fn measure_drift(&mut self, model: &Model<T>, q: &[T], qd: &[T]) -> Status {
        match self.take(model, q, qd) {
            Ok(()) => {
                self.drift = drift_of(model, &mut self.ws);
                Status::Ok
            }
            Err(status) => {
                let nan = T::from_f64(f64::NAN);
                self.drift = Drift { position: nan, velocity: nan };
                status
            }
        }
    }

    /// The largest |φ| at the last state: lengths in lengths of the cluster, angles in radians,
    /// couplings of unit norm.
    pub fn position_drift(&self) -> T {
        self.drift.position
    }

    /// The largest |K q̇| at the last state, likewise.
    pub fn velocity_drift(&self) -> T {
        self.drift.velocity
    }

    /// Moves q to a closed pose by Newton's method with steps of least norm, and removes from q̇
    /// the part that violates the loops.
    ///
    /// Norms are over radians and lengths of the cluster, so that near a closed pose the nearest
    /// one is found to first order. Idle joints stay where they are and lose their velocity;
    /// quaternions come back with unit length. Fails where the loops cannot be closed from here or
    /// K has lost rank; q and q̇ are then NaN. Cost: a few small eliminations for each cluster.
    /// Allocates never.
    pub fn project(&mut self, model: &Model<T>, q: &mut [T], qd: &mut [T]) -> Status {
        let ended = self.take(model, q, qd).and_then(|()| {
            self.drift = Drift { position: T::ZERO, velocity: T::ZERO };
            model
                .closed_clusters
                .iter()
                .try_for_each(|c| close(model, &model.clusters[*c], &mut self.ws))
        });
        let nan = T::from_f64(f64::NAN);
        let fine = ended.is_ok();
        q.iter_mut()
            .zip(&model.order.q)
            .for_each(|(x, i)| *x = if fine { self.ws.q[*i] } else { nan });
        qd.iter_mut()
            .zip(&model.order.v)
            .for_each(|(x, i)| *x = if fine { self.ws.qd[*i] } else { nan });
        ended.err().unwrap_or(Status::Ok)
    }

    /// q and q̇ in the order of the bodies, quaternions of unit length.
    fn take(&mut self, model: &Model<T>, q: &[T], qd: &[T]) -> Result<(), Status> {
        let ws = &mut self.ws;
        let sizes = model.sizes();
        if model.fingerprint() != self.fingerprint {
            return Err(Status::WrongModel);
        }
        if (q.len(), qd.len()) != (sizes.n_q, sizes.n_v) {
            return Err(Status::WrongSize);
        }
        if !q.iter().chain(qd).all(|x| x.is_finite()) {
            return Err(Status::NonFiniteInput);
        }
        q.iter().zip(&model.order.q).for_each(|(x, i)| ws.q[*i] = *x);
        qd.iter().zip(&model.order.v).for_each(|(x, i)| ws.qd[*i] = *x);
        for body in model.bodies.iter().filter(|body| body.motion.n_q() > 1) {
            let four = &mut ws.q[body.q + body.motion.n_q() - 4..body.q + body.motion.n_q()];
            let length = four.iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum)).sqrt();
            if !(T::from_f64(LENGTHS[0]).lt(length) && length.lt(T::from_f64(LENGTHS[1]))) {
                return Err(Status::BadRequest);
            }
            four.iter_mut().for_each(|x| *x = *x / length);
        }
        Ok(())
    }

    fn solve(
        &mut self,
        model: &Model<T>,
        tau_q: &[T],
        wrenches: &[T],
        (alpha, beta): (T, T),
    ) -> Result<(), Status> {
        let ws = &mut self.ws;
        // poses of all bodies in their parents
        for (body, cos_sin) in model.bodies.iter().zip(&mut ws.cos_sin).skip(1) {
            if body.motion == Motion::Revolute {
                let (s, c) = ws.q[body.q].sin_cos();
                *cos_sin = (c, s);
            }
        }
        algorithms::joint_poses(model, &self.scope.posed, &ws.q, &ws.cos_sin, &mut ws.motion);

        // C less the wrenches, and the given forces
        if !self.links.is_empty() {
            wrenches_on_bodies(model, ws, &self.bodies, &self.links, wrenches);
        }
        let wrench = (!self.links.is_empty()).then_some(ws.wrench.as_slice());
        ws.qdd.fill(T::ZERO);
        let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
        algorithms::newton_euler(model, &self.scope, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
        tau_q.iter().zip(&model.order.v).for_each(|(x, v)| ws.loop_q[*v] = *x);

        self.drift = Drift { position: T::ZERO, velocity: T::ZERO };
        if let Err(status) =
            tree_under_constraints(model, &self.scope, ws, Some(([alpha, beta], &mut self.drift)))
        {
            return Err(if rank_is_lost(model, ws) { Status::SingularClosure } else { status });
        }
        if !ws.kkt_rhs.iter().all(|x| x.is_finite()) {
            return Err(Status::NonFiniteInput);
        }
        let mut first = model.sizes().n_v;
        for cluster in model.closed_clusters.iter().map(|c| &model.clusters[*c]) {
            ws.constraint_jacobian(cluster, model.bodies_of(cluster));
            let used = rows_at(cluster, &mut ws.scratch, CLEAR);
            ws.scratch.phi.fill(T::ZERO);
            for (r, x) in used.iter().zip(&ws.kkt_rhs[first..]) {
                ws.scratch.phi[*r] = -*x;
            }
            first += used.len();
            let Scratch { pose, phi, A, B, .. } = &mut ws.scratch;
            forces_of_derivative(cluster, pose, phi, (A, B));
            declared_forces(cluster, &mut ws.scratch.phi, &mut self.lambda);
        }
        Ok(())
    }
}

fn rank_is_lost<T: Real>(model: &Model<T>, ws: &mut Workspace<T>) -> bool {
    model.closed_clusters.iter().map(|c| &model.clusters[*c]).any(|cluster| {
        ws.constraint_jacobian(cluster, model.bodies_of(cluster));
        loses_rank(cluster, &mut ws.scratch)
    })
}

/// Closes one cluster, then projects its velocities: x −= D_c K_sᵀ (K_s K_sᵀ)⁻¹ b with b = φ_s,
/// then b = K_s D_c⁻¹ q̇.
fn close<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    ws: &mut Workspace<T>,
) -> Result<(), Status> {
    let columns = || cluster.independent.iter().chain(&cluster.dependent).copied();
    let last = T::from_f64(0.1 * T::EPSILON.sqrt());
    let floor = T::from_f64(8.0 * T::EPSILON);
    let nearly = T::from_f64(T::EPSILON.sqrt());
    let mut small = false;
    let mut before = T::from_f64(f64::INFINITY);
    for k in 0..=STEPS {
        ws.constraint_jacobian(cluster, model.bodies_of(cluster));
        let residual = residuals(cluster, ws);
        // after a small step the residual is rounding, and so is one that no step reduces
        if small || residual.lt(floor) || residual.lt(nearly) && !residual.lt(before) {
            break;
        }
        if k == STEPS {
            return Err(Status::NotConverged);
        }
        before = residual;
        least_step(cluster, ws)?;
        // no longer than allowed
        let size = ws.dense_spare[..columns().count()]
            .iter()
            .fold(T::ZERO, |size, x| T::select_lt(size, x.abs(), x.abs(), size));
        let part = T::select_lt(T::from_f64(LONGEST), size, T::from_f64(LONGEST) / size, T::ONE);
        for (a, v) in columns().enumerate() {
            let step = -(ws.dense_spare[a] * part * T::from_f64(column_unit(cluster, v)));
            cluster.dofs[v].advance(&mut ws.q[cluster.q..], step);
        }
        small = size.lt(last);
    }
    // rows dropped at load distinguish poses that satisfy the kept ones
    if !largest_residual(cluster, &ws.scratch.phi).lt(T::from_f64(APART)) {
        return Err(Status::NotConverged);
    }

    for &v in &cluster.locked {
        ws.qd[cluster.v + v] = T::ZERO;
    }
    for (i, &r) in rows_at(cluster, &mut ws.scratch, CLEAR).iter().enumerate() {
        let row = cluster.cuts.iter().flat_map(|cut| &cut.rows).nth(r);
        let unit = row.map_or(T::ONE, |row| T::from_f64(row_unit(cluster, row)));
        let of_row = &ws.scratch.K[r * cluster.n_v..(r + 1) * cluster.n_v];
        let qd = &ws.qd[cluster.velocities()];
        ws.dense_rhs[i] =
            of_row.iter().zip(qd).fold(T::ZERO, |sum, (entry, qd)| entry.mul_add(*qd, sum)) * unit;
    }
    least_step(cluster, ws)?;
    for (a, v) in columns().enumerate() {
        ws.qd[cluster.v + v] -= ws.dense_spare[a] * T::from_f64(column_unit(cluster, v));
    }
    Ok(())
}

/// φ of all rows into the scratch, that of the kept ones, scaled, into `dense_rhs`; the largest of
/// these.
fn residuals<T: Real>(cluster: &Cluster<T>, ws: &mut Workspace<T>) -> T {
    let scratch = &mut ws.scratch;
    constraint_residual(cluster, &scratch.pose, &ws.q[cluster.coordinates()], &mut scratch.phi);
    let mut largest = T::ZERO;
    for (i, &r) in rows_at(cluster, scratch, CLEAR).iter().enumerate() {
        let row = cluster.cuts.iter().flat_map(|cut| &cut.rows).nth(r);
        let phi = scratch.phi[r] * row.map_or(T::ONE, |row| T::from_f64(row_unit(cluster, row)));
        ws.dense_rhs[i] = phi;
        largest = T::select_lt(largest, phi.abs(), phi.abs(), largest);
    }
    largest
}

/// The solution of least norm of K_s x = b into `dense_spare`, b in `dense_rhs`, K in the scratch.
fn least_step<T: Real>(cluster: &Cluster<T>, ws: &mut Workspace<T>) -> Result<(), Status> {
    let used = rows_at(cluster, &mut ws.scratch, CLEAR);
    let m = used.len();
    let n = cluster.independent.len() + cluster.dependent.len();
    let A = &mut ws.dense;
    for (first, columns) in
        [(0, &cluster.independent), (cluster.independent.len(), &cluster.dependent)]
    {
        scaled(cluster, &ws.scratch.K, used.iter().copied(), columns, |i, a, x| {
            A[i * n + first + a] = x
        });
    }
    let solved = least_norm(A, &mut ws.dense_rhs, &mut ws.dense_spare, m, n);
    solved.map(|_| ()).ok_or(Status::SingularClosure)
}
