//! Outputs of a failed closure: residual, distance to singularity, good independents, the nearest
//! y.

use sarrus_proto::{Field, Status};

use crate::closure::{
    Closure, Level, UNBOUNDED, column_unit, constraint_residual, dependents_range, interpolate,
    largest_residual,
};
use crate::mechanism::{Body, Cluster, Dof};
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::diagnostics::{nearest, singular};
use crate::plan::run::RunReport;
use crate::plan::state::hold_idle;
use crate::scalar::{Real, noise};
use crate::workspace::Workspace;

/// Halvings of the path to an unreachable target.
const BISECTIONS: u32 = 50;
/// Residual, in cluster lengths, up to which a pose counts as closed; at least 64 unit roundoffs.
const CLOSED: f64 = 1e-8;
/// The level at which every request for a pose is answered.
const DEEPEST: Level = Level::Acceleration;
/// Doublings of a rounding away from a target out of reach, and from there towards the start.
const AWAY: u32 = 30;
/// Lengths of the steps that approach a target, and steps of one length and one independent of
/// which none comes nearer.
const LENGTHS: usize = 20;
const TRIES: usize = 10;

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
        if actuated {
            let at = cluster.coordinates();
            ws.q[at.clone()].copy_from_slice(&ws.start[at]);
        } else {
            last_closed(model, c, ws);
        }
        ws.constraint_jacobian(cluster, bodies);
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
            report.nearest = actuated || self.all_nearest(model, c, ws);
        }
    }

    /// Moves the independents of cluster c, whose last closed pose is in q, and those of the
    /// clusters behind it that cannot be closed either, to the nearest ones that are answered;
    /// false where there are none.
    fn all_nearest<T: Real>(&self, model: &Model<T>, c: usize, ws: &mut Workspace<T>) -> bool {
        let is_cold = self.given.slot(Field::Q).or(self.given.slot(Field::QGuess)).is_none();
        let closed = &self.needed.scope.closed;
        closed[closed.partition_point(|other| *other < c)..].iter().all(|&other| {
            let cluster = &model.clusters[other];
            if other != c {
                hold_idle(cluster, ws);
                if ws.close_from(model, other, DEEPEST, is_cold, false).status == Status::Ok {
                    return true;
                }
                last_closed(model, other, ws);
            }
            nearest::nearest_pose(cluster, model.bodies_of(cluster), ws);
            answered(model, other, ws, is_cold)
        })
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
            ws.constraint_jacobian(cluster, model.bodies_of(cluster));
            let sigma_min = dependents_range(cluster, &mut ws.scratch).1;
            // NaN counts as greater than any number
            least = if sigma_min < least || !least.is_finite() { sigma_min } else { least };
        }
        least
    }
}

/// Puts into q a closed pose of a cluster that could not be closed, the one that was found after
/// all or the last on the path, and into `step_y` the independents that were asked for.
fn last_closed<T: Real>(model: &Model<T>, c: usize, ws: &mut Workspace<T>) {
    let cluster = &model.clusters[c];
    if !matches!(model.closures[c], Closure::Numerical(_)) {
        ws.scratch.last[..cluster.n_q].copy_from_slice(&ws.q[cluster.coordinates()]);
    }
    for (k, &v) in cluster.independent.iter().enumerate() {
        ws.step_y[k] = ws.q[cluster.q + cluster.dofs[v].q];
    }
    let open = residual(cluster, model.bodies_of(cluster), ws);
    if !open.lt(T::from_f64(CLOSED.max(64.0 * T::EPSILON))) {
        last_on_path(model, c, ws);
    }
}

/// Moves the pose in q inside the reach, until a request for its independents is answered: away
/// from those in `step_y` by 2^k roundings, towards the start by 2^k roundings of the way; where
/// the straight way from the start does not lead there, to the nearest ones of [`approach`].
fn answered<T: Real>(model: &Model<T>, c: usize, ws: &mut Workspace<T>, is_cold: bool) -> bool {
    let cluster = &model.clusters[c];
    let at = cluster.coordinates();
    let mut spare = core::mem::take(&mut ws.dense_spare);
    let nearest = &mut spare[..cluster.n_q];
    nearest.copy_from_slice(&ws.q[at.clone()]);
    let away = singles(cluster).fold(T::ZERO, |most: T, (k, dof)| {
        let unit = T::from_f64(column_unit(cluster, dof.v));
        most.larger((nearest[dof.q] - ws.step_y[k]).abs() / unit)
    });
    let ask = |ws: &mut Workspace<T>| {
        ws.close_from(model, c, DEEPEST, is_cold, false).status == Status::Ok
    };
    let is_found = ask(ws)
        || T::ZERO.lt(away)
            && (0..AWAY).any(|k| {
                let part = rounding::<T>(k) / away;
                for (k, dof) in singles(cluster) {
                    let x = nearest[dof.q];
                    ws.q[cluster.q + dof.q] = (x - ws.step_y[k]).mul_add(part, x);
                }
                ask(ws)
            })
        || back(cluster, nearest, AWAY, ws, ask)
        || {
            // the request again, up to the last closed pose
            singles(cluster).for_each(|(k, dof)| ws.q[cluster.q + dof.q] = ws.step_y[k]);
            ask(ws) || {
                last_closed(model, c, ws);
                nearest.copy_from_slice(&ws.q[at]);
                back(cluster, nearest, u32::MAX, ws, ask) && {
                    approach(cluster, nearest, ws, ask);
                    true
                }
            }
        };
    ws.dense_spare = spare;
    is_found
}

/// The independents of one coordinate, by their places in y.
fn singles<T: Real>(cluster: &Cluster<T>) -> impl Iterator<Item = (usize, &Dof)> {
    let dofs = cluster.independent.iter().map(|v| &cluster.dofs[*v]).enumerate();
    dofs.filter(|(_, dof)| dof.single)
}

/// 2^k roundings of one.
fn rounding<T: Real>(k: u32) -> T {
    T::from_f64(T::EPSILON * 2_f64.powi(k as i32))
}

/// Goes from a pose towards the start by 2^k roundings of the way, to k at most, until its
/// independents are answered.
fn back<T: Real>(
    cluster: &Cluster<T>,
    from: &[T],
    most: u32,
    ws: &mut Workspace<T>,
    ask: impl Fn(&mut Workspace<T>) -> bool,
) -> bool {
    let at = cluster.coordinates();
    (0..=most.min((1.0 / T::EPSILON).log2() as u32)).any(|k| {
        let start = &ws.start[at.clone()];
        interpolate(cluster, start, from, T::ONE - rounding(k), &mut ws.q[at.clone()]);
        ask(ws)
    })
}

/// Comes nearer to the independents in `step_y` from the answered pose in q, by steps of any
/// direction to answered poses, of half the length where none of some is nearer: those that a
/// straight way reaches need not end where the loops become singular.
fn approach<T: Real>(
    cluster: &Cluster<T>,
    best: &mut [T],
    ws: &mut Workspace<T>,
    ask: impl Fn(&mut Workspace<T>) -> bool,
) {
    let at = cluster.coordinates();
    let unit = |dof: &Dof| T::from_f64(column_unit(cluster, dof.v));
    let distance = |q: &[T], y: &[T]| {
        let miss = |(k, dof): (usize, &Dof)| (q[dof.q] - y[k]) / unit(dof);
        singles(cluster).map(miss).fold(T::ZERO, |sum, x| x.mul_add(x, sum)).sqrt()
    };
    best.copy_from_slice(&ws.q[at.clone()]);
    let m = cluster.n_vy;
    let mut length = distance(best, &ws.step_y);
    let mut draws = 0;
    for _ in 0..LENGTHS {
        let mut tries = 0;
        while tries < TRIES * m {
            let before = distance(best, &ws.step_y);
            for (k, dof) in singles(cluster) {
                // straight on, then anywhere
                let x = best[dof.q];
                let step = if tries == 0 {
                    (ws.step_y[k] - x) * (length / before)
                } else {
                    T::from_f64(noise(draws + k)) * length * unit(dof)
                };
                ws.q[cluster.q + dof.q] = x + step;
            }
            draws += m;
            tries += 1;
            if distance(&ws.q[at.clone()], &ws.step_y).lt(before) && ask(ws) {
                best.copy_from_slice(&ws.q[at.clone()]);
                tries = 0;
            }
        }
        length *= T::from_f64(0.5);
    }
    ws.q[at].copy_from_slice(best);
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
