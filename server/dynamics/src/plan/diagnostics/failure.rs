//! What a failed closure still tells: residual, distance to singularity, good independents, the
//! nearest y.

use sarrus_proto::{Field, Status};

use crate::closure::{
    Closure, Level, between, close, constraint_jacobian, constraint_residual, dependents_range,
    largest_residual, local_poses,
};
use crate::model::{Body, Cluster, Model};
use crate::plan::diagnostics::{nearest, singular};
use crate::plan::run::Findings;
use crate::plan::{Plan, local};
use crate::scalar::Scalar;
use crate::workspace::Workspace;

/// Halvings of the path to an unreachable target.
const BISECTIONS: u32 = 50;
/// Residual, in cluster lengths, up to which a pose counts as closed, or where that is more 64 unit
/// roundoffs.
const CLOSED: f64 = 1e-8;

impl Plan {
    /// Notes what is wanted of a cluster that could not be closed, whose independents in q are
    /// those that were asked.
    pub(in crate::plan) fn remember_failure<T: Scalar>(
        &self,
        model: &Model<T>,
        cluster: &Cluster<T>,
        ws: &mut Workspace<T>,
        actuated: bool,
        found: &mut Findings<T>,
    ) {
        let bodies = &model.bodies[cluster.body..cluster.body + cluster.n];
        if self.wants(Field::Residual) {
            found.residual = residual(cluster, bodies, ws);
        }
        if !self.wants_any(&[Field::NearestY, Field::SigmaMin, Field::GoodIndependents]) {
            return;
        }
        let at = cluster.q..cluster.q + cluster.n_q;
        if !matches!(cluster.closure, Closure::Numerical(_)) {
            ws.scratch.last[..cluster.n_q].copy_from_slice(&ws.q[at.clone()]);
        }
        // a closed pose: the one that was found after all, or the last on the path
        for (k, &v) in cluster.independent.iter().enumerate() {
            ws.step_y[k] = ws.q[cluster.q + cluster.freedoms[v].q];
        }
        if actuated {
            ws.q[at.clone()].copy_from_slice(&ws.start[at]);
        } else if !residual(cluster, bodies, ws).lt(T::from_f64(CLOSED.max(64.0 * T::EPSILON))) {
            last_on_path(cluster, bodies, ws);
        }
        residual(cluster, bodies, ws);
        constraint_jacobian(cluster, &ws.scratch.pose, &mut ws.scratch.K);
        if self.wants(Field::SigmaMin) {
            found.sigma_min = dependents_range(cluster, &mut ws.scratch).1;
        }
        if self.wants(Field::GoodIndependents) {
            found.failed = true;
            singular::declared_independents(model, &mut ws.loop_q);
            let dense = (ws.dense.as_mut_slice(), ws.dense_rhs.as_mut_slice());
            if !singular::good_independents(model, cluster, &ws.scratch.K, dense, &mut ws.loop_q) {
                ws.loop_q.fill(T::from_f64(f64::NAN));
            }
        }
        if self.wants(Field::NearestY) {
            found.nearest = true;
            if !actuated {
                nearest::nearest_pose(cluster, bodies, ws);
            }
        }
    }

    /// The least distance to singularity among the clusters that were closed and the one that was
    /// not.
    pub(in crate::plan) fn distance_after<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        found: &Findings<T>,
    ) -> T {
        let mut least = found.sigma_min;
        if !self.wants(Field::SigmaMin)
            || matches!(
                found.status,
                Status::NonFiniteInput | Status::WrongSize | Status::BadRequest
            )
        {
            return T::from_f64(f64::NAN);
        }
        for &c in &model.tied[..found.closed] {
            let cluster = &model.clusters[c];
            let bodies = &model.bodies[cluster.body..cluster.body + cluster.n];
            residual(cluster, bodies, ws);
            constraint_jacobian(cluster, &ws.scratch.pose, &mut ws.scratch.K);
            let of = dependents_range(cluster, &mut ws.scratch).1;
            // what is not a number yet is greater than any
            least = if of < least || !least.is_finite() { of } else { least };
        }
        least
    }
}

/// Largest scaled residual of one cluster at whatever pose stands in q; leaves its poses in the
/// scratch.
fn residual<T: Scalar>(cluster: &Cluster<T>, bodies: &[Body<T>], ws: &mut Workspace<T>) -> T {
    let q = &ws.q[cluster.q..cluster.q + cluster.n_q];
    let turn = &mut ws.turn[cluster.body..cluster.body + cluster.n];
    local_poses(cluster, bodies, q, turn, &mut ws.scratch.pose);
    constraint_residual(cluster, &ws.scratch.pose, q, &mut ws.scratch.phi);
    largest_residual(cluster, &ws.scratch.phi)
}

/// Puts into q the last closed pose of one cluster on the straight path to those in the scratch's
/// `last`: a numerical closure has just followed it, a closed form is bisected.
fn last_on_path<T: Scalar>(cluster: &Cluster<T>, bodies: &[Body<T>], ws: &mut Workspace<T>) {
    let at = cluster.q..cluster.q + cluster.n_q;
    if matches!(cluster.closure, Closure::Numerical(_)) {
        ws.q[at].copy_from_slice(&ws.scratch.goal[..cluster.n_q]);
        return;
    }
    let (mut low, mut high) = (0.0, 1.0);
    ws.q[at.clone()].copy_from_slice(&ws.start[at.clone()]);
    ws.scratch.goal[..cluster.n_q].copy_from_slice(&ws.q[at.clone()]);
    for _ in 0..BISECTIONS {
        let part = 0.5 * (low + high);
        between(
            cluster,
            &ws.start[at.clone()],
            &ws.scratch.last,
            T::from_f64(part),
            &mut ws.q[at.clone()],
        );
        if close(cluster, bodies, &mut local(cluster, ws), Level::Position).status == Status::Ok {
            low = part;
            ws.scratch.goal[..cluster.n_q].copy_from_slice(&ws.q[at.clone()]);
        } else {
            high = part;
        }
    }
    ws.q[at].copy_from_slice(&ws.scratch.goal[..cluster.n_q]);
}
