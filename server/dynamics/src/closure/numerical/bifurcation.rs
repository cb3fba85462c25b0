//! Bifurcations. Where branches of a loop meet (a parallelogram folded flat), det K_d vanishes and
//! its sign does not select a branch. The velocity at the guess does: q ≈ q_guess + s q̇_guess,
//! with s such that the independents arrive, is near one of the branches beyond and far from the
//! others.

use sarrus_proto::Status;

use crate::closure::numerical::{Branches, Numerical, continuation};
use crate::closure::{Local, Outcome};
use crate::mechanism::Cluster;
use crate::scalar::Real;

/// Part of a path along the tangent by which its end may miss it.
const ASTRAY: f64 = 0.2;

/// Follows the straight path, and continues along the tangent, if given, at a bifurcation.
pub(in crate::closure) fn follow_or_bifurcate<T: Real>(
    numerical: &Numerical<T>,
    local: &mut Local<'_, T>,
    iterations: u32,
) -> Outcome {
    let cluster = local.cluster;
    let n = cluster.n_q;
    let followed = continuation::follow(numerical, local, iterations);
    let at_bifurcation = matches!(
        followed.status,
        Status::BranchChanged | Status::SingularClosure | Status::SingularIndependents
    );
    let Some(tangent) = local.tangent.filter(|_| at_bifurcation) else { return followed };

    // keep the pose of the failure, which is reported if this attempt fails too
    local.scratch.last[..n].copy_from_slice(local.q);
    for &j in &cluster.dependent_q {
        local.q[j] = local.start[j];
    }
    let Some(share) = share_of(cluster, tangent, local.start, local.q) else {
        local.q.copy_from_slice(&local.scratch.last[..n]);
        return followed;
    };
    let dependents = || cluster.dependent.iter().map(|v| (&cluster.dofs[*v], tangent[*v] * share));
    dependents().for_each(|(dof, step)| dof.advance(local.q, step));
    let (good, count) = numerical.newton(local, Branches::Unknown, T::ZERO);

    // how far Newton's method went from where the tangent led, against the distance
    let mut off = T::ZERO;
    let mut distance = T::ZERO;
    for (dof, step) in dependents().filter(|(dof, _)| dof.single) {
        let unit = T::from_f64(if dof.slides() { 1.0 / cluster.length } else { 1.0 });
        off += (local.q[dof.q] - local.start[dof.q] - step).abs() * unit;
        distance += step.abs() * unit;
    }
    let iterations = followed.iterations + count;
    let is_near = off < distance * T::from_f64(ASTRAY);
    if good && is_near && (!numerical.meets || continuation::is_apart(numerical, local, off)) {
        let gap = continuation::redundant_gap(local);
        if continuation::holds(gap) {
            return Outcome { open: gap.to_f64(), ..Outcome::closed(iterations) };
        }
    }
    local.q.copy_from_slice(&local.scratch.last[..n]);
    Outcome { iterations, ..followed }
}

/// The part of the tangent whose independents lead to those in `q`; nothing where it leads
/// elsewhere, or a quaternion is among them.
fn share_of<T: Real>(cluster: &Cluster<T>, tangent: &[T], start: &[T], q: &[T]) -> Option<T> {
    let moves = || {
        cluster.independent.iter().map(|v| (&cluster.dofs[*v], tangent[*v])).map(|(dof, rate)| {
            let unit = T::from_f64(if dof.slides() { 1.0 / cluster.length } else { 1.0 });
            ((q[dof.q] - start[dof.q]) * unit, rate * unit)
        })
    };
    let dot =
        |of: fn((T, T)) -> (T, T)| moves().map(of).fold(T::ZERO, |sum, (a, b)| a.mul_add(b, sum));
    let along = dot(|(d, r)| (d, r));
    let square = dot(|(_, r)| (r, r));
    let whole = dot(|(d, _)| (d, d));
    let off = whole * square - along * along;
    let straight = cluster.independent.iter().all(|v| cluster.dofs[*v].single);
    (straight && T::ZERO < along.abs() && off < T::from_f64(ASTRAY * ASTRAY) * whole * square)
        .then(|| along / square)
}
