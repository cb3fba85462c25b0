//! Redundant rows: the loop gaps along them, and cut joints without them.

use core::f64::consts::PI;

use nalgebra::Vector3;
use sarrus_factorisations::{Mat, solve, thin_svd};

use crate::closure::{Scratch, column_unit, constraint_residual};
use crate::compile::analysis::{Sample, Subject, closed_near, joined};
use crate::compile::blocks::is_length;
use crate::compile::rank::{independent_rows, matrix, rank};
use crate::diagnostic::Diagnostic;
use crate::mechanism::{Body, Cluster, Motion};
use crate::scalar::noise;

/// Largest gap of a redundant row that holds, in radians or cluster lengths: files are rounded.
const OPEN: f64 = 1e-6;
/// Directions of the independents, and steps along each, in radians or lengths of the cluster.
const DIRECTIONS: usize = 6;
const STEPS: usize = 8;
const STEP: f64 = 0.1;
/// Dependents of a cluster beyond which fewer poses are sampled.
const LARGE: usize = 100;
/// Choices of rows: dependents of a cluster up to which they are sought, steps of half a turn, how
/// many at most, and the part of the best clearance that the known ones keep.
const SMALL: usize = 30;
const WAY: usize = 24;
const MOST: usize = 8;
const NARROW: f64 = 0.3;
/// Sine of the angle between axes that count as parallel.
const PARALLEL: f64 = 1e-4;

/// Warns of redundant rows, and of those along which the loops open in motion.
pub(super) fn warn(
    subject: &Subject<'_>,
    cluster: &Cluster<f64>,
    generic: &Sample,
    used: &[usize],
    warnings: &mut Vec<Diagnostic>,
) {
    let dropped: Vec<usize> = (0..cluster.rows.len()).filter(|r| !used.contains(r)).collect();
    let names = joined(subject.row_names, &dropped);
    let n = cluster.dependent.len();
    let help = "they are left out of the solution; what the loop-closure forces share is the least \
        norm";
    let fitting = fitting_cuts(subject, generic, &dropped);
    warnings.push(Diagnostic::new(
        subject.site,
        format!("redundant constraint axes: {names}"),
        format!("{n} independent axes for {n} dependent joints"),
        if fitting.is_empty() { help.into() } else { format!("{fitting}; or leave it: {help}") },
    ));
    let gap = Gap::along(cluster, subject, used, &dropped);
    if gap.length > OPEN * cluster.length || gap.angle > OPEN {
        warnings.push(Diagnostic::new(
            subject.site,
            format!(
                "redundant axes that do not hold: open by up to {:.1e} m and {:.1e} rad at sampled \
                poses ({names})",
                gap.length, gap.angle
            ),
            format!(
                "at most {:.1e} m and {OPEN:.0e} rad, the rounding of a file",
                OPEN * cluster.length
            ),
            "correct axes and origins of the loop's joints, or take these axes out",
        ));
    }
}

/// Other choices of rows, each with a pose where it is much farther from a singular pose than all
/// before it, on the way of one independent after the other from zero, half a turn either way.
pub(super) fn choices(
    subject: &Subject<'_>,
    cluster: &Cluster<f64>,
    used: &[usize],
) -> Vec<(Vec<usize>, Sample)> {
    let m = cluster.dependent.len();
    let mut found: Vec<(Vec<usize>, Sample)> = Vec::new();
    if used.len() == cluster.rows.len() || m == 0 || m > SMALL {
        return found;
    }
    let ways = cluster.independent.iter().flat_map(|v| [(v, 1.0), (v, -1.0)]).take(2 * DIRECTIONS);
    for (&v, way) in ways {
        let mut q = subject.zero.to_vec();
        for _ in 0..WAY {
            let step = way * PI / WAY as f64 * column_unit(cluster, v);
            cluster.dofs[v].advance(&mut q, step);
            if !closed_near(cluster, subject.bodies, &mut q, &cluster.dependent) {
                break;
            }
            let at = Sample::at(cluster, subject.bodies, &q);
            let K_d = at.columns(&cluster.dependent, cluster);
            let best = independent_rows(&K_d, m);
            let known = std::iter::once(used).chain(found.iter().map(|(rows, _)| &rows[..]));
            let reached = known.map(|rows| clearance(&K_d, rows)).fold(0.0, f64::max);
            if reached < NARROW * clearance(&K_d, &best) && found.len() < MOST {
                found.push((best, at));
            }
        }
    }
    found
}

/// The least singular value of some rows.
fn clearance(K_d: &Mat<f64>, rows: &[usize]) -> f64 {
    let part = Mat::from_fn(rows.len(), K_d.ncols(), |i, a| K_d[(rows[i], a)]);
    thin_svd(&part).map_or(0.0, |svd| svd.S().column_vector()[K_d.ncols() - 1])
}

/// The largest gaps of some rows `[m]`, `[rad]`.
#[derive(Clone, Copy, Debug, Default)]
struct Gap {
    length: f64,
    angle: f64,
}

impl Gap {
    /// The gaps of the dropped rows where the used ones are closed, along some motions from zero.
    fn along(
        cluster: &Cluster<f64>,
        &Subject { bodies, zero, .. }: &Subject<'_>,
        used: &[usize],
        dropped: &[usize],
    ) -> Gap {
        let rows: Vec<_> = cluster.cuts.iter().flat_map(|cut| &cut.rows).collect();
        let (directions, steps) =
            if cluster.dependent.len() > LARGE { (2, 2) } else { (DIRECTIONS, STEPS) };
        let mut gap = Gap::default();
        for k in 0..directions {
            let mut q = zero.to_vec();
            let mut phi = vec![0.0; rows.len()];
            for _ in 0..steps {
                for (i, &v) in cluster.independent.iter().enumerate() {
                    // there and back again, along one or along all
                    let share =
                        if cluster.independent.len() == 1 { 1.0 } else { noise(k / 2 + 7 * i) };
                    let way = if k % 2 == 0 { share } else { -share };
                    let at = &cluster.dofs[v];
                    at.advance(&mut q, STEP * column_unit(cluster, v) * way);
                }
                if !close(cluster, bodies, used, &mut q, &mut phi) {
                    break;
                }
                for &r in dropped {
                    let worst =
                        if is_length(cluster, rows[r]) { &mut gap.length } else { &mut gap.angle };
                    *worst = worst.max(phi[r].abs());
                }
            }
        }
        gap
    }
}

/// Closes the used rows by Newton's method over the dependents; false where that leads away.
fn close(
    cluster: &Cluster<f64>,
    bodies: &[Body<f64>],
    used: &[usize],
    q: &mut [f64],
    phi: &mut [f64],
) -> bool {
    let n = cluster.n_v;
    let m = cluster.dependent.len();
    for _ in 0..10 {
        let Scratch { pose, K, .. } = Scratch::at(cluster, bodies, q);
        constraint_residual(cluster, &pose, q, phi);
        if used.iter().all(|r| phi[*r].abs() < 1e-12 * cluster.length.max(1.0)) {
            return true;
        }
        let K_d = Mat::from_fn(m, m, |r, a| K[used[r] * n + cluster.dependent[a]]);
        let right = Mat::from_fn(m, 1, |r, _| -phi[used[r]]);
        let step = solve(&K_d, &right);
        for (a, &v) in cluster.dependent.iter().enumerate() {
            let at = &cluster.dofs[v];
            let unit = column_unit(cluster, v);
            // a long step leads to another branch or from a singular pose
            if step[(a, 0)].is_nan() || step[(a, 0)].abs() >= unit {
                return false;
            }
            at.advance(q, step[(a, 0)]);
        }
    }
    false
}

/// Advice on cut joints without redundant rows; empty where none is known.
pub(super) fn fitting_cuts(subject: &Subject<'_>, at: &Sample, dropped: &[usize]) -> String {
    let cluster = subject.cluster;
    let mut first = 0;
    let mut found = Vec::new();
    for cut in &cluster.cuts {
        let rows: Vec<usize> = (first..first + cut.rows.len()).collect();
        first += cut.rows.len();
        let is_meant = rows.iter().any(|r| dropped.contains(r))
            && cut.rows.iter().all(|row| row.terms.is_empty());
        let Some(name) = rows.first().and_then(|r| subject.row_names[*r].rsplit_once('/')) else {
            continue;
        };
        if !is_meant {
            continue;
        }
        let path: Vec<usize> = cut.path.iter().map(|(v, _)| *v).collect();
        let all = matrix(&at.K, cluster.rows.len(), cluster.n_v, &path);
        let part = |of: &[usize]| rank(&Mat::from_fn(of.len(), path.len(), |i, a| all[(of[i], a)]));
        let points: Vec<usize> = rows
            .iter()
            .zip(&cut.rows)
            .filter(|(_, row)| row.angular.norm() == 0.0)
            .map(|(r, _)| *r)
            .collect();
        match plane(subject, at, &path) {
            Some(normal) if part(&rows) == 2 && part(&points) == 2 => {
                let axis = at.pose[cut.predecessor].R * cut.x_p_cut.R;
                let axis = axis.transpose() * normal;
                let digits = axis.map(|x| (x * 1e6).round() / 1e6 + 0.0);
                found.push(format!(
                    "write cut_joint_type: planar_revolute with axis: [{}, {}, {}] for {}",
                    digits[0], digits[1], digits[2], name.0
                ));
            }
            None if part(&rows) == 3 && part(&points) == 3 && rows.len() > 3 => {
                found.push(format!("write cut_joint_type: spherical for {}", name.0));
            }
            _ => {}
        }
    }
    found.join("; ")
}

/// The normal of the plane in which these velocities move bodies {cluster's parent}, if there is
/// one: all turns about it and all slides across it.
fn plane(subject: &Subject<'_>, at: &Sample, path: &[usize]) -> Option<Vector3<f64>> {
    let Subject { cluster, bodies, .. } = *subject;
    let axis = |v: &usize| at.pose[cluster.dofs[*v].body + 1].R.column(2).into_owned();
    let motion = |v: &usize| bodies[cluster.dofs[*v].body].motion;
    let normal = path.iter().find(|v| motion(v) == Motion::Revolute).map(axis)?;
    let fits = path.iter().all(|v| match motion(v) {
        Motion::Revolute => axis(v).cross(&normal).norm() < PARALLEL,
        Motion::Prismatic => axis(v).dot(&normal).abs() < PARALLEL,
        _ => false,
    });
    fits.then_some(normal)
}
