//! One cluster in comparable units: its rows, the distance of a pose from the given one, and steps.

use nalgebra::Vector3;
use sarrus_factorisations::Mat;

use crate::closure::{
    Scratch, column_unit, constraint_residual, largest_residual, local_poses, row_unit,
};
use crate::mechanism::{Body, Cluster, Motion};
use crate::scalar::Triple;
use crate::spatial::{Matrix, Pose, from_quaternion};

/// Relative singular value that counts as zero, for rows of full rank.
const GAP_OF_USED: f64 = 1e-10;
/// Relative singular value that counts as zero if every row counts: files are rounded.
const GAP_OF_ALL: f64 = 1e-4;
/// Residual up to which a loop is closed, of rows that do not contradict each other and of rows
/// that may.
const CLOSED: f64 = 1e-12;
const CLOSED_OF_ALL: f64 = 1e-6;
/// Weight of a free joint, relative to the heaviest, in the choice of a step.
const LEAST: f64 = 1e-6;

/// A cluster near a pose.
pub(crate) struct Problem<'a> {
    pub(super) cluster: &'a Cluster<f64>,
    bodies: &'a [Body<f64>],
    near: &'a [f64],
    /// Local velocities that may move, their weights, the heaviest being 1, and the same with a
    /// floor.
    pub(super) free: Vec<usize>,
    pub(super) weight: Vec<f64>,
    pub(super) metric: Vec<f64>,
    /// Unit of each local velocity (n_v).
    unit: Vec<f64>,
    /// Local rows that count and their scales.
    rows: Vec<usize>,
    scale: Vec<f64>,
    /// Relative singular value that counts as zero, and residual that counts as closed.
    pub(super) gap: f64,
    pub(super) closed: f64,
    /// True where all rows count, so that they may contradict each other by the rounding of a file.
    pub(super) all: bool,
}

/// A pose of the cluster with its scaled residuals.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) q: Vec<f64>,
    pub(super) phi: Vec<f64>,
    /// Largest residual of all rows, in lengths of the cluster.
    pub(super) residual: f64,
}

impl Candidate {
    pub(super) fn new(problem: &Problem<'_>, q: Vec<f64>) -> Candidate {
        let cluster = problem.cluster;
        let mut phi = vec![0.0; cluster.rows.len()];
        constraint_residual(cluster, &problem.poses(&q), &q, &mut phi);
        let residual = largest_residual(cluster, &phi);
        let phi =
            problem.rows.iter().zip(&problem.scale).map(|(r, scale)| phi[*r] * scale).collect();
        Candidate { q, phi, residual }
    }

    /// |φ|², infinite where it is not a number.
    pub(super) fn square(&self) -> f64 {
        let square: f64 = self.phi.iter().map(|x| x * x).sum();
        if square.is_nan() { f64::INFINITY } else { square }
    }

    /// The largest of the rows that count.
    pub(super) fn largest(&self) -> f64 {
        self.phi.iter().fold(0.0, |largest, x| if x.abs() <= largest { largest } else { x.abs() })
    }
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        cluster: &'a Cluster<f64>,
        bodies: &'a [Body<f64>],
        near: &'a [f64],
        weights: &[f64],
    ) -> Problem<'a> {
        let unit = units(cluster);
        let free: Vec<usize> = (0..cluster.n_v).filter(|v| weights[*v].is_finite()).collect();
        let heaviest = free.iter().map(|v| weights[*v]).fold(0.0, f64::max);
        let weight: Vec<f64> = free
            .iter()
            .map(|v| if heaviest > 0.0 { weights[*v] / heaviest } else { 0.0 })
            .collect();
        let metric = weight.iter().map(|w| w.max(LEAST)).collect();

        // the rows that a valid model uses; all of them in an open model
        let all = cluster.used.is_empty();
        let rows = if all { (0..cluster.rows.len()).collect() } else { cluster.used.clone() };
        let scales: Vec<f64> = cluster
            .cuts
            .iter()
            .flat_map(|cut| &cut.rows)
            .map(|row| row_unit(cluster, row))
            .collect();
        let scale = rows.iter().map(|r: &usize| scales[*r]).collect();
        let (gap, closed) = if all { (GAP_OF_ALL, CLOSED_OF_ALL) } else { (GAP_OF_USED, CLOSED) };
        Problem { cluster, bodies, near, free, weight, metric, unit, rows, scale, gap, closed, all }
    }

    fn poses(&self, q: &[f64]) -> Vec<Pose<f64>> {
        let mut pose = vec![Pose::identity(); self.cluster.n + 1];
        local_poses(self.cluster, self.bodies, q, &mut vec![(1.0, 0.0); self.cluster.n], &mut pose);
        pose
    }

    /// K of all rows, unscaled (rows × n_v).
    pub(super) fn jacobian(&self, q: &[f64]) -> Vec<f64> {
        Scratch::at(self.cluster, self.bodies, q).K
    }

    /// K of the rows that count and the velocities that may move, scaled.
    pub(super) fn scaled_jacobian(&self, q: &[f64]) -> Mat<f64> {
        let K = self.jacobian(q);
        Mat::from_fn(self.rows.len(), self.free.len(), |r, a| {
            K[self.rows[r] * self.cluster.n_v + self.free[a]]
                * self.scale[r]
                * self.unit[self.free[a]]
        })
    }

    /// The displacement from the given pose, scaled (n_v).
    pub(super) fn away(&self, q: &[f64]) -> Vec<f64> {
        let mut d = vec![0.0; self.cluster.n_v];
        for body in self.bodies {
            let at = body.q - self.cluster.q;
            let v = body.v - self.cluster.v;
            let first = at + body.motion.n_q().saturating_sub(4);
            match body.motion {
                Motion::Revolute | Motion::Prismatic => {
                    d[v] = (q[at] - self.near[at]) / self.unit[v]
                }
                Motion::Spherical | Motion::Floating => {
                    let turn = turned(&self.near[first..first + 4], &q[first..first + 4]);
                    d[v..v + 3].copy_from_slice(&turn);
                    for i in 3..body.motion.n_v() {
                        d[v + i] = (q[at + i - 3] - self.near[at + i - 3]) / self.unit[v + 3];
                    }
                }
            }
        }
        d
    }

    /// ½ Σ w d² and its slope along each velocity that may move.
    pub(super) fn cost(&self, q: &[f64]) -> (f64, Vec<f64>) {
        let d = self.away(q);
        let mut pull = vec![0.0; self.cluster.n_v];
        self.free.iter().zip(&self.weight).for_each(|(v, w)| pull[*v] = w * d[*v]);
        let cost = 0.5 * self.free.iter().map(|v| pull[*v] * d[*v]).sum::<f64>();
        for body in self.bodies {
            let at = body.q - self.cluster.q;
            let v = body.v - self.cluster.v;
            let first = at + body.motion.n_q().saturating_sub(4);
            if body.motion.n_v() > 1 {
                let moment = from_rates(&d[v..v + 3], &pull[v..v + 3]);
                pull[v..v + 3].copy_from_slice(moment.as_slice());
            }
            if body.motion == Motion::Floating {
                let R = from_quaternion(q[first], q[first + 1], q[first + 2], q[first + 3]);
                let along = R.apply_transposed(Vector3::new(pull[v + 3], pull[v + 4], pull[v + 5]));
                pull[v + 3..v + 6].copy_from_slice(along.as_slice());
            }
        }
        (cost, self.free.iter().map(|v| pull[*v]).collect())
    }

    /// The pose after a scaled step of the velocities that may move.
    pub(super) fn moved(&self, q: &[f64], step: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut x = vec![0.0; self.cluster.n_v];
        self.free.iter().enumerate().for_each(|(a, v)| x[*v] = step(a) * self.unit[*v]);
        let mut next = q.to_vec();
        for body in self.bodies {
            let at = body.q - self.cluster.q;
            let v = body.v - self.cluster.v;
            let first = at + body.motion.n_q().saturating_sub(4);
            match body.motion {
                Motion::Revolute | Motion::Prismatic => next[at] += x[v],
                Motion::Spherical => rotate(&mut next[first..first + 4], &x[v..v + 3]),
                Motion::Floating => {
                    let R = from_quaternion(q[first], q[first + 1], q[first + 2], q[first + 3]);
                    let along = R.apply(Vector3::new(x[v + 3], x[v + 4], x[v + 5]));
                    (0..3).for_each(|i| next[at + i] += along[i]);
                    rotate(&mut next[first..first + 4], &x[v..v + 3]);
                }
            }
        }
        next
    }
}

/// Unit of each local velocity.
pub(super) fn units(cluster: &Cluster<f64>) -> Vec<f64> {
    (0..cluster.n_v).map(|v| column_unit(cluster, v)).collect()
}

/// a · b of quaternions x y z w.
fn times(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let x = Vector3::new(a[0], a[1], a[2]);
    let y = Vector3::new(b[0], b[1], b[2]);
    let v = y * a[3] + x * b[3] + x.cross(y);
    [v[0], v[1], v[2], a[3] * b[3] - Vector3::dot(&x, &y)]
}

/// Rotation vector from one quaternion to another, in the axes of either.
fn turned(from: &[f64], to: &[f64]) -> [f64; 3] {
    let [x, y, z, w] = times([-from[0], -from[1], -from[2], from[3]], [to[0], to[1], to[2], to[3]]);
    let sine = Vector3::new(x, y, z).norm();
    let factor = if sine > 0.0 { 2.0 * sine.atan2(w.abs()) / sine } else { 2.0 };
    [x, y, z].map(|x| x * factor.copysign(factor * w))
}

/// Turns a quaternion by a rotation vector in the body.
fn rotate(q: &mut [f64], by: &[f64]) {
    let by = Vector3::new(by[0], by[1], by[2]);
    let angle = by.norm();
    let v = by * if angle > 0.0 { (0.5 * angle).sin() / angle } else { 0.5 };
    let next = times([q[0], q[1], q[2], q[3]], [v[0], v[1], v[2], (0.5 * angle).cos()]);
    let length = next.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.iter_mut().zip(next).for_each(|(q, x)| *q = x / length);
}

/// Aᵀ x for θ̇ = A ω with ω in the body: A = 1 + ½ [θ]× + c [θ]×², c = (1 − (θ/2) cot(θ/2)) / θ².
fn from_rates(theta: &[f64], x: &[f64]) -> Vector3<f64> {
    let theta = Vector3::new(theta[0], theta[1], theta[2]);
    let x = Vector3::new(x[0], x[1], x[2]);
    let square = Vector3::dot(&theta, &theta);
    let half = 0.5 * square.sqrt();
    let c =
        if square < 1e-8 { 1.0 / 12.0 } else { (1.0 - half * half.cos() / half.sin()) / square };
    let once = theta.cross(x);
    x - once * 0.5 + theta.cross(once) * c
}
