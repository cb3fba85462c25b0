//! Size of a cluster, and the closure of a cluster of couplings alone by linear relations.

use nalgebra::Vector3;

use crate::closure::{Coupling, local_poses};
use crate::mechanism::{Body, Cluster, Curve, Cut, CutRow, Dof};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Pose;

/// Half the largest distance between two joint origins or cut points of a cluster at zero: the size
/// of the mechanism; 1 m without such points.
pub(super) fn characteristic_length(
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    zero: &[Dd],
) -> f64 {
    let pose = poses_at(cluster, bodies, zero);
    let mut points: Vec<Vector3<Dd>> = pose[1..].iter().map(|x| x.p).collect();
    for cut in cluster.cuts.iter().filter(|cut| cut.rows.iter().all(|row| row.terms.is_empty())) {
        points.push(pose[cut.predecessor].point(&cut.x_p_cut.p));
    }
    // half the largest extent
    let mut largest: f64 = 0.0;
    for a in &points {
        for b in &points {
            let d = a - b;
            largest = largest.max(d.dot(d).sqrt().to_f64());
        }
    }
    if largest > 0.0 { 0.5 * largest } else { 1.0 }
}

/// Units of the velocities of a cluster: a radian, its length; that of a joint on the way to no cut
/// moves the other joints of its coupling by theirs.
pub(super) fn units(cluster: &Cluster<Dd>) -> Vec<f64> {
    let is_gear = |cut: &&Cut<Dd>| cut.rows.iter().all(|row| !row.terms.is_empty());
    let own = |dof: &Dof| if dof.slides() { cluster.length } else { 1.0 };
    let mut units: Vec<Option<f64>> = vec![None; cluster.n_v];
    for (v, _) in cluster.cuts.iter().filter(|cut| !is_gear(cut)).flat_map(|cut| &cut.path) {
        units[*v] = Some(own(&cluster.dofs[*v]));
    }
    let rows = cluster.cuts.iter().filter(is_gear).flat_map(|cut| &cut.rows);
    spread(&rows.map(|row| &row.terms[..]).collect::<Vec<_>>(), &mut units);
    cluster.dofs.iter().zip(units).map(|(dof, unit)| unit.unwrap_or(own(dof))).collect()
}

/// Gives a unit to each joint that relations tie to joints with one, from gear to gear.
fn spread(relations: &[&[(usize, Dd)]], units: &mut [Option<f64>]) {
    for terms in relations.iter().flat_map(|_| relations) {
        let unknown: Vec<_> = terms.iter().filter(|(v, _)| units[*v].is_none()).collect();
        if let [(v, of_v)] = unknown[..] {
            let others = terms.iter().filter_map(|(j, c)| Some(c.abs().to_f64() * units[*j]?));
            let unit = others.sum::<f64>() / of_v.abs().to_f64();
            units[*v] = (unit > 0.0 && unit.is_finite()).then_some(unit);
        }
    }
}

/// Poses of the local bodies of a cluster at its coordinates {cluster's parent body}; 0 is that.
pub(super) fn poses_at(cluster: &Cluster<Dd>, bodies: &[Body<Dd>], q: &[Dd]) -> Vec<Pose<Dd>> {
    let mut cos_sin = vec![(Dd::ONE, Dd::ZERO); cluster.n];
    let mut pose = vec![Pose::identity(); cluster.n + 1];
    local_poses(cluster, bodies, q, &mut cos_sin, &mut pose);
    pose
}

/// Σ coefficient · q − Σ f(q) + offset = 0 over local joints.
pub(super) struct Relation {
    pub(super) terms: Vec<(usize, Dd)>,
    pub(super) curves: Vec<Curve<Dd>>,
    pub(super) offset: Dd,
}

impl Relation {
    /// That of a row of a coupling.
    pub(super) fn of(row: &CutRow<Dd>) -> Relation {
        Relation { terms: row.terms.clone(), curves: row.curves.clone(), offset: row.offset }
    }
}

/// Largest remainder of repeated relations, relative to their coefficients: numbers in files are
/// rounded.
const ROUNDING: f64 = 1e-12;

/// The closure of a cluster whose every row is a coupling; `None` for others and where the
/// couplings do not give the dependents one after the other.
pub(super) fn couplings(cluster: &Cluster<Dd>) -> Option<Coupling<Dd>> {
    if cluster.n_q != cluster.n {
        return None;
    }
    let rows = cluster.cuts.iter().flat_map(|cut| &cut.rows);
    let relations: Option<Vec<Relation>> =
        rows.map(|row| (!row.terms.is_empty()).then(|| Relation::of(row))).collect();
    solve(cluster, &relations?)
}

/// The dependents from relations that may hold in any order and at once, by elimination with full
/// pivoting; relations that repeat others are allowed, those that contradict them are not.
pub(super) fn solve(cluster: &Cluster<Dd>, relations: &[Relation]) -> Option<Coupling<Dd>> {
    let n = cluster.n;
    let m = cluster.n_vy;
    let d = cluster.dependent.len();
    let rows = relations.len();
    let curves: Vec<_> = relations.iter().flat_map(|relation| &relation.curves).collect();
    let width = d + m + curves.len() + 1;
    let mut A = coefficients(cluster, relations, width)?;
    let [unit, more] = equilibrate(cluster, relations, &mut A, width);
    let (mut free, mut row_of): (Vec<usize>, Vec<usize>) =
        ((0..rows).collect(), vec![usize::MAX; d]);
    for _ in 0..d {
        let open = (0..d).filter(|a| row_of[*a] == usize::MAX);
        let candidates = open.flat_map(|a| free.iter().map(move |r| (*r, a)));
        let size = |at: &(usize, usize)| A[at.0 * width + at.1].to_f64().abs();
        let (r, a) = candidates.max_by(|x, y| size(x).total_cmp(&size(y)))?;
        if size(&(r, a)) < ROUNDING {
            return None;
        }
        let pivot = A[r * width + a];
        for k in 0..width {
            A[r * width + k] = A[r * width + k] / pivot;
        }
        for other in (0..rows).filter(|other| *other != r) {
            let factor = A[other * width + a];
            for k in 0..width {
                let x = factor * A[r * width + k];
                A[other * width + k] -= x;
            }
        }
        free.retain(|x| *x != r);
        row_of[a] = r;
    }
    // the remaining relations must repeat these
    let repeats = |r: &usize| {
        let row = &A[r * width..(r + 1) * width];
        let offset = (row[width - 1] * more[*r]).to_f64();
        row[..width - 1].iter().all(|x| x.to_f64().abs() <= ROUNDING) && offset.abs() <= ROUNDING
    };
    if !free.iter().all(repeats) {
        return None;
    }
    let [M, b] = [n * m, n].map(|n| vec![Dd::ZERO; n]);
    let mut curves: Vec<_> = curves.into_iter().map(|of| (of.clone(), b.clone())).collect();
    let mut coupling = Coupling { M, b, curves: Vec::new(), polish: None };
    for (k, &j) in cluster.independent.iter().enumerate() {
        coupling.M[j * m + k] = Dd::ONE;
    }
    for (a, &j) in cluster.dependent.iter().enumerate() {
        let row = &A[row_of[a] * width + d..(row_of[a] + 1) * width];
        for k in 0..m {
            coupling.M[j * m + k] = -row[k] * unit[a];
        }
        for (k, (_, shares)) in curves.iter_mut().enumerate() {
            shares[j] = -row[m + k] * unit[a];
        }
        coupling.b[j] = -row[width - d - 1] * unit[a];
    }
    // a curve whose joint needs none of those that are left comes next
    while !curves.is_empty() {
        let needs = |v: usize| curves.iter().any(|(_, shares)| shares[v] != Dd::ZERO);
        let next = curves.iter().position(|(curve, _)| !needs(curve.of.v))?;
        coupling.curves.push(curves.remove(next));
    }
    Some(coupling)
}

/// The coefficients of some relations, row by row: [dependents | independents, values of curves,
/// offset], zero in all; `None` where they hold another joint.
fn coefficients(cluster: &Cluster<Dd>, relations: &[Relation], width: usize) -> Option<Vec<Dd>> {
    let place = |of: &[usize], j: &usize| of.iter().position(|x| x == j);
    let d = cluster.dependent.len();
    let mut next = d + cluster.n_vy;
    let mut A = vec![Dd::ZERO; relations.len() * width];
    for (row, relation) in A.chunks_exact_mut(width).zip(relations) {
        for (j, c) in &relation.terms {
            let independent = || place(&cluster.independent, j).map(|k| d + k);
            row[place(&cluster.dependent, j).or_else(independent)?] += *c;
        }
        row[next..next + relation.curves.len()].fill(-Dd::ONE);
        next += relation.curves.len();
        row[width - 1] = relation.offset;
    }
    Some(A)
}

/// Scales the columns of the dependents by their units and the rows to one; returns the units, and
/// of each row what the units add to the size that it has in the file.
fn equilibrate(
    cluster: &Cluster<Dd>,
    relations: &[Relation],
    A: &mut [Dd],
    width: usize,
) -> [Vec<Dd>; 2] {
    // a unit is what the joint moves where the independents move by one, as a power of two
    let mut units = vec![None; cluster.n];
    cluster.independent.iter().for_each(|j| units[*j] = Some(1.0));
    let terms: Vec<_> = relations.iter().map(|relation| &relation.terms[..]).collect();
    spread(&terms, &mut units);
    let power = |unit: f64| f64::exp2(unit.log2().round());
    let unit: Vec<Dd> =
        cluster.dependent.iter().map(|j| Dd::from(units[*j].map_or(1.0, power))).collect();
    let mut more = Vec::new();
    for row in A.chunks_exact_mut(width) {
        let largest = |row: &[Dd]| row.iter().fold(0.0, |l: f64, x| l.max(x.to_f64().abs()));
        let declared = largest(&row[..width - 1]);
        row.iter_mut().zip(&unit).for_each(|(x, unit)| *x *= *unit);
        let size = largest(&row[..width - 1]);
        if size > 0.0 {
            row.iter_mut().for_each(|x| *x = *x / Dd::from(size));
        }
        more.push(Dd::from(if declared > 0.0 { size / declared } else { 1.0 }));
    }
    [unit, more]
}
