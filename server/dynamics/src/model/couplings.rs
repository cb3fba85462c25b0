//! What is read off a cluster before its closure is chosen: its size, and its couplings if it is tied by nothing else.

use nalgebra::Vector3;

use super::{Body, Cluster};
use crate::closure::Coupling;
use crate::scalar::{Dd, Real, Scalar};
use crate::spatial::Pose;

/// Mean distance of a cluster's joint origins and cuts from its parent body's nearest point: the size of the mechanism.
pub(super) fn characteristic_length(cluster: &Cluster<Dd>, bodies: &[Body<Dd>]) -> f64 {
    let mut pose = vec![Pose::identity()];
    for j in 0..cluster.n {
        let body = &bodies[cluster.body + j];
        let next = pose[cluster.local_parent[j]].then(&Pose { R: body.E, p: body.r });
        pose.push(next);
    }
    let mut points: Vec<Vector3<Dd>> = pose[1..].iter().map(|x| x.p).collect();
    for cut in cluster.cuts.iter().filter(|cut| cut.rows.iter().all(|row| row.terms.is_empty())) {
        points.push(pose[cut.predecessor].point(&cut.x_p_cut.p));
    }
    // half the largest extent
    let mut largest: f64 = 0.0;
    for a in &points {
        for b in &points {
            let d = a - b;
            largest = largest.max(crate::spatial::dot(&d, &d).sqrt().to_f64());
        }
    }
    if largest > 0.0 { 0.5 * largest } else { 1.0 }
}

/// M and b of a cluster whose every row is a coupling of dependents to independents; `None` otherwise.
pub(super) fn couplings(cluster: &Cluster<Dd>) -> Option<Coupling<Dd>> {
    let (n, m) = (cluster.n, cluster.n_vy);
    if cluster.cuts.iter().flat_map(|cut| &cut.rows).any(|row| row.terms.is_empty())
        || cluster.rows.len() != cluster.dependent.len()
        || cluster.n_q != cluster.n
    {
        return None;
    }
    let mut coupling = Coupling { M: vec![Dd::ZERO; n * m], b: vec![Dd::ZERO; n] };
    let mut known = vec![false; n];
    for (k, &j) in cluster.independent.iter().enumerate() {
        coupling.M[j * m + k] = Dd::ONE;
        known[j] = true;
    }
    // chains of couplings resolve from the independents outwards, in either direction of a row
    for _ in 0..n {
        for row in cluster.cuts.iter().flat_map(|cut| &cut.rows) {
            let mut unknown = row.terms.iter().filter(|(j, _)| !known[*j]);
            let (Some(&(j, own)), None) = (unknown.next(), unknown.next()) else { continue };
            if own == Dd::ZERO {
                return None;
            }
            let mut b = row.offset;
            for &(i, c) in row.terms.iter().filter(|(i, _)| *i != j) {
                b += c * coupling.b[i];
                for k in 0..m {
                    let x = c * coupling.M[i * m + k];
                    coupling.M[j * m + k] -= x;
                }
            }
            for k in 0..m {
                coupling.M[j * m + k] = coupling.M[j * m + k] / own;
            }
            coupling.b[j] = -b / own;
            known[j] = true;
        }
    }
    known.iter().all(|known| *known).then_some(coupling)
}
