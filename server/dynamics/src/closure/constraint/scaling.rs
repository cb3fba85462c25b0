//! The scaling of ranks, distances to singularity and norms of loop-closure forces.
//!
//! ```text
//!   K_s = D_r K D_c        λ = D_r λ_s
//! ```
//! D_c measures sliding joints in cluster lengths, and joints behind gears by the joints that they
//! turn with. D_r measures linear rows in the same lengths, and gives couplings unit norm. So K_s
//! has no dimension and does not depend on units, and λ_s holds moments: forces times the cluster's
//! length.

use crate::closure::Scratch;
use crate::linalg::{determinant_sign, singular_range};
use crate::mechanism::{Cluster, CutRow};
use crate::scalar::Real;

/// Least singular value of the scaled K_d from which on rows are taken as they are: closures do so,
/// and rows of files may contradict each other by their rounding.
pub(crate) const CLEAR: f64 = 1e-2;

/// The unit of one local velocity.
pub(crate) fn column_unit<T>(cluster: &Cluster<T>, v: usize) -> f64 {
    cluster.units[v]
}

/// The factor by which a row is scaled.
pub(crate) fn row_unit<T: Real>(cluster: &Cluster<T>, row: &CutRow<T>) -> f64 {
    if !row.terms.is_empty() {
        let size = row.terms.iter().fold(0.0, |sum, (j, c)| {
            let x = c.to_f64() * column_unit(cluster, *j);
            sum + x * x
        });
        return 1.0 / f64::sqrt(size);
    }
    if row.linear.iter().any(|x| *x != T::ZERO) { 1.0 / cluster.length } else { 1.0 }
}

/// A number of the r-th row as it is declared, from those of the rows in use.
pub(crate) fn declared<T: Real>(row: &CutRow<T>, r: usize, of: impl Fn(usize) -> T) -> T {
    row.leans.iter().fold(of(r) * row.size, |sum, (back, x)| x.mul_add(of(r - back), sum))
}

/// Forces of the declared rows, by their external indices, from those of the rows in use, which
/// are used up.
pub(crate) fn declared_forces<T: Real>(cluster: &Cluster<T>, forces: &mut [T], lambda: &mut [T]) {
    let mut r = cluster.rows.len();
    for row in cluster.cuts.iter().flat_map(|cut| &cut.rows).rev() {
        r -= 1;
        let x = forces[r] / row.size;
        lambda[cluster.rows[r]] = x;
        row.leans.iter().for_each(|(back, part)| forces[r - back] -= *part * x);
    }
}

/// Calls `put(i, a, entry)` for the i-th of the given rows and the a-th of the given columns of the
/// scaled K; K is that of all rows.
pub(crate) fn scaled<T: Real>(
    cluster: &Cluster<T>,
    K: &[T],
    rows: impl Iterator<Item = usize>,
    columns: &[usize],
    mut put: impl FnMut(usize, usize, T),
) {
    for (i, r) in rows.enumerate() {
        let Some(row) = cluster.cuts.iter().flat_map(|cut| &cut.rows).nth(r) else { continue };
        let unit = row_unit(cluster, row);
        for (a, &v) in columns.iter().enumerate() {
            put(i, a, K[r * cluster.n_v + v] * T::from_f64(unit * column_unit(cluster, v)));
        }
    }
}

/// Largest and least singular value of the scaled K_d; K is that of the pose in question.
pub(crate) fn dependents_range<T: Real>(cluster: &Cluster<T>, scratch: &mut Scratch<T>) -> (T, T) {
    let rows = rows_at(cluster, scratch, f64::INFINITY);
    range_of(cluster, rows, scratch)
}

/// The rows that make the square system at the pose of K: of several choices the first one whose
/// least singular value is above `clear`, else the one that is farthest from a singular pose.
pub(crate) fn rows_at<'a, T: Real>(
    cluster: &'a Cluster<T>,
    scratch: &mut Scratch<T>,
    clear: f64,
) -> &'a [usize] {
    let mut best = (&cluster.used, T::from_f64(-1.0));
    for rows in core::iter::once(&cluster.used).chain(&cluster.other_rows) {
        if cluster.other_rows.is_empty() || T::from_f64(clear).lt(best.1) {
            break;
        }
        let (_, least) = range_of(cluster, rows, scratch);
        if best.1 < least {
            best = (rows, least);
        }
    }
    best.0
}

fn range_of<T: Real>(cluster: &Cluster<T>, rows: &[usize], scratch: &mut Scratch<T>) -> (T, T) {
    let m = cluster.dependent.len();
    dependents(cluster, rows, scratch);
    singular_range(&mut scratch.A, m, m)
}

/// The branch of a closed pose: the sign of det K_d, scaled.
pub(crate) fn assembly_branch<T: Real>(cluster: &Cluster<T>, scratch: &mut Scratch<T>) -> T {
    dependents(cluster, &cluster.used, scratch);
    determinant_sign(&mut scratch.A, cluster.dependent.len())
}

/// The scaled K_d of some rows.
fn dependents<T: Real>(cluster: &Cluster<T>, rows: &[usize], scratch: &mut Scratch<T>) {
    let m = cluster.dependent.len();
    let A = &mut scratch.A;
    scaled(cluster, &scratch.K, rows.iter().copied(), &cluster.dependent, |i, a, x| {
        A[i * m + a] = x
    });
}
