//! The straight path between two poses of a cluster's independents.

use crate::closure::column_unit;
use crate::mechanism::{Cluster, Dof};
use crate::scalar::Real;

/// A share of the path between two poses of a cluster's independents: straight in single
/// coordinates, along the great circle in quaternions.
pub(crate) fn interpolate<T: Real>(
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
        .map(|v| &cluster.dofs[*v])
        .filter(|at| at.k == 0 && at.motion.n_q() > 1);
    for at in quaternions {
        // q and −q are the same rotation: take the nearer one
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

/// Distance between the independents of two poses, in radians or cluster lengths: the sum over all
/// of them.
pub(crate) fn distance<T: Real>(cluster: &Cluster<T>, from: &[T], to: &[T]) -> T {
    let mut distance = T::ZERO;
    for dof in cluster.independent.iter().map(|v| &cluster.dofs[*v]) {
        if dof.single {
            let step = (to[dof.q] - from[dof.q]).abs();
            let unit = column_unit(cluster, dof.v);
            distance += if unit == 1.0 { step } else { step * T::from_f64(1.0 / unit) };
        } else if dof.k == 0 {
            distance += free_distance(cluster, dof, from, to);
        }
    }
    distance
}

/// The distance of a joint of several degrees of freedom: the angle of the turn and the path.
fn free_distance<T: Real>(cluster: &Cluster<T>, dof: &Dof, from: &[T], to: &[T]) -> T {
    let square = |range: core::ops::Range<usize>| {
        range.fold(T::ZERO, |sum, i| (to[i] - from[i]).mul_add(to[i] - from[i], sum))
    };
    let four = dof.q + dof.motion.n_q() - 4;
    // |q − p|² = 2 (1 − cos ½ angle), of q or −q
    let chord = square(four..four + 4);
    let other = T::from_f64(4.0) - chord;
    let chord = T::select_lt(other, chord, other, chord);
    let half_angle =
        (chord * T::from_f64(0.25)).sqrt().atan2((T::ONE - chord * T::from_f64(0.25)).sqrt())
            * T::from_f64(2.0);
    half_angle * T::from_f64(2.0) + square(dof.q..four).sqrt() * T::from_f64(1.0 / cluster.length)
}

/// How far the dependents of a pose are from those of another, in radians or cluster lengths: the
/// largest of them. Whole turns do not count.
pub(crate) fn largest_distance<T: Real>(cluster: &Cluster<T>, from: &[T], to: &[T]) -> f64 {
    const TURN: f64 = core::f64::consts::TAU;
    let mut largest = 0.0_f64;
    for dof in cluster.dependent.iter().map(|v| &cluster.dofs[*v]) {
        let of_dof = if !dof.single {
            if dof.k == 0 { free_distance(cluster, dof, from, to).to_f64() } else { 0.0 }
        } else {
            let step = (to[dof.q] - from[dof.q]).to_f64();
            if dof.slides() {
                step / cluster.length
            } else {
                (-(step / TURN).round()).mul_add(TURN, step)
            }
        };
        largest = largest.max(of_dof.abs());
    }
    largest
}
