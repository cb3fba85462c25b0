//! Outputs of a failed closure: residual, distance to singularity, good independents, the nearest
//! y.

use sarrus_proto::{Field, Status};

use crate::closure::{
    Closure, Level, UNBOUNDED, constraint_jacobian, constraint_residual, dependents_range,
    interpolate, largest_residual,
};
use crate::mechanism::{Body, Cluster};
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::diagnostics::{nearest, singular};
use crate::plan::run::RunReport;
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Halvings of the path to an unreachable target.
const BISECTIONS: u32 = 50;
/// Residual, in cluster lengths, up to which a pose counts as closed; at least 64 unit roundoffs.
const CLOSED: f64 = 1e-8;

impl Plan {
    /// Keeps the wanted outputs of a cluster that could not be closed, with the requested
    /// independents in q.
    pub(in crate::plan) fn remember_failure<T: Real>(
        &self,
        model: &Model<T>,
        c: usize,
        ws: &mut Workspace<T>,
        actuated: bool,
        report: &mut RunReport<T>,
    ) {
        let cluster = &model.clusters[c];
        let bodies = model.bodies_of(cluster);
        if self.wants(Field::Residual) {
            report.residual = residual(cluster, bodies, ws);
        }
        if !self.wants_any(&[Field::NearestY, Field::SigmaMin, Field::GoodIndependents]) {
            return;
        }
        let at = cluster.coordinates();
        if !matches!(model.closures[c], Closure::Numerical(_)) {
            ws.scratch.last[..cluster.n_q].copy_from_slice(&ws.q[at.clone()]);
        }
        // a closed pose: the one that was found after all, or the last on the path
        for (k, &v) in cluster.independent.iter().enumerate() {
            ws.step_y[k] = ws.q[cluster.q + cluster.dofs[v].q];
        }
        if actuated {
            ws.q[at.clone()].copy_from_slice(&ws.start[at]);
        } else if !residual(cluster, bodies, ws).lt(T::from_f64(CLOSED.max(64.0 * T::EPSILON))) {
            last_on_path(model, c, ws);
        }
        residual(cluster, bodies, ws);
        constraint_jacobian(cluster, &ws.scratch.pose, &mut ws.scratch.K);
        if self.wants(Field::SigmaMin) {
            report.sigma_min = dependents_range(cluster, &mut ws.scratch).1;
        }
        if self.wants(Field::GoodIndependents) {
            report.failed = true;
            singular::declared_independents(model, &mut ws.loop_q);
            let dense = (ws.dense.as_mut_slice(), ws.dense_rhs.as_mut_slice());
            if !singular::good_independents(model, cluster, &ws.scratch.K, dense, &mut ws.loop_q) {
                ws.loop_q.fill(T::from_f64(f64::NAN));
            }
        }
        if self.wants(Field::NearestY) && ws.budget(self.searches()) == UNBOUNDED {
            report.nearest = true;
            if !actuated {
                nearest::nearest_pose(cluster, bodies, ws);
            }
        }
    }

    /// The least distance to singularity among the clusters that were closed and the one that was
    /// not.
    pub(in crate::plan) fn distance_after<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        report: &RunReport<T>,
    ) -> T {
        let mut least = report.sigma_min;
        if !self.wants(Field::SigmaMin)
            || matches!(
                report.status,
                Status::NonFiniteInput | Status::WrongSize | Status::BadRequest
            )
        {
            return T::from_f64(f64::NAN);
        }
        for &c in &model.closed_clusters[..report.closed] {
            let cluster = &model.clusters[c];
            let bodies = model.bodies_of(cluster);
            residual(cluster, bodies, ws);
            constraint_jacobian(cluster, &ws.scratch.pose, &mut ws.scratch.K);
            let sigma_min = dependents_range(cluster, &mut ws.scratch).1;
            // NaN counts as greater than any number
            least = if sigma_min < least || !least.is_finite() { sigma_min } else { least };
        }
        least
    }
}

/// Largest scaled residual of one cluster at the pose in q; leaves its poses in the scratch.
fn residual<T: Real>(cluster: &Cluster<T>, bodies: &[Body<T>], ws: &mut Workspace<T>) -> T {
    ws.local_poses(cluster, bodies);
    let q = &ws.q[cluster.coordinates()];
    constraint_residual(cluster, &ws.scratch.pose, q, &mut ws.scratch.phi);
    largest_residual(cluster, &ws.scratch.phi)
}

/// Puts into q the last closed pose of one cluster on the straight path to those in the scratch's
/// `last`: a numerical closure has just followed it, a closed form is bisected.
fn last_on_path<T: Real>(model: &Model<T>, c: usize, ws: &mut Workspace<T>) {
    let cluster = &model.clusters[c];
    let at = cluster.coordinates();
    if matches!(model.closures[c], Closure::Numerical(_)) {
        ws.q[at].copy_from_slice(&ws.scratch.goal[..cluster.n_q]);
        return;
    }
    let mut low = 0.0;
    let mut high = 1.0;
    ws.q[at.clone()].copy_from_slice(&ws.start[at.clone()]);
    ws.scratch.goal[..cluster.n_q].copy_from_slice(&ws.q[at.clone()]);
    for _ in 0..BISECTIONS {
        let part = 0.5 * (low + high);
        interpolate(
            cluster,
            &ws.start[at.clone()],
            &ws.scratch.last,
            T::from_f64(part),
            &mut ws.q[at.clone()],
        );
        if ws.close(model, c, Level::Position).status == Status::Ok {
            low = part;
            ws.scratch.goal[..cluster.n_q].copy_from_slice(&ws.q[at.clone()]);
        } else {
            high = part;
        }
    }
    ws.q[at].copy_from_slice(&ws.scratch.goal[..cluster.n_q]);
}
