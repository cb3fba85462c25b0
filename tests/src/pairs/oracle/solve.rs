//! Newton steps close the loops, and elimination solves for the dependents.

use std::f64::consts::PI;

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::scalar::Real;

use super::geometry::{counts, quaternion};
use super::{Oracle, Rates, Row};
use crate::pairs::algebra::{Matrix, apply, dot, eliminate};

/// Residual of a row that a pose satisfies, in units of its row.
const CLOSED: f64 = 1e-9;
/// Longest step of one Newton correction, in radians or lengths.
const LONGEST: f64 = 0.25;
/// Smallest part of the longest step of a path.
const SHORTEST: f64 = 1.0 / 64.0;

impl Oracle<'_> {
    /// Unit of a velocity: a length where it is of a slide.
    fn unit(&self, v: usize) -> f64 {
        let of = |j: &usize| self.v[*j] <= v && v < self.v[*j] + counts(self.of.joints[*j].kind).1;
        let Some(j) = (0..self.v.len()).find(of) else { return 1.0 };
        let slides = match self.of.joints[j].kind {
            JointKind::Prismatic => true,
            JointKind::Floating => v - self.v[j] >= 3,
            _ => false,
        };
        if slides { self.length } else { 1.0 }
    }

    /// Unit of a coordinate, likewise; of a floating base there is none, as no loop holds it.
    fn unit_of_q(&self, q: usize) -> f64 {
        // a fixed joint has no coordinate of its own
        let moves = |j: &usize| counts(self.of.joints[*j].kind).0 > 0;
        let at = (0..self.q.len()).filter(moves).find(|j| self.q[*j] == q);
        at.map_or(f64::INFINITY, |j| match self.of.joints[j].kind {
            JointKind::Prismatic => self.length,
            JointKind::Revolute | JointKind::Continuous => 1.0,
            _ => f64::INFINITY,
        })
    }

    /// Unit of a row: its largest part, in lengths of the loop where it is linear.
    fn row_unit(&self, row: &Row) -> f64 {
        match row {
            Row::Coupling(j, masters, ..) => masters
                .iter()
                .map(|(k, ratio)| ratio.abs() * self.unit(self.v[*k]))
                .fold(self.unit(self.v[*j]), f64::max),
            Row::Cut { axis, against, .. } => {
                let size = |x: &[f64]| x.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
                if against.is_some() {
                    size(&axis[..3])
                } else {
                    size(&axis[..3]).max(size(&axis[3..]) * self.length)
                }
            }
        }
    }

    /// Solves K_d x = b (columns of b side by side) in scaled form; the least pivot.
    fn solve<T: Real>(&self, K: &Matrix<T>, b: &Matrix<T>) -> (Matrix<T>, f64) {
        let of = self.dependents();
        let mut A = Matrix::new(self.rows.len(), of.len());
        let mut B = Matrix::new(self.rows.len(), b.columns);
        for (r, row) in self.rows.iter().enumerate() {
            let unit = T::from_f64(1.0 / self.row_unit(row));
            for (c, v) in of.iter().enumerate() {
                *A.at(r, c) = K.get(r, *v) * unit * T::from_f64(self.unit(*v));
            }
            for c in 0..b.columns {
                *B.at(r, c) = b.get(r, c) * unit;
            }
        }
        let (x, pivot) = eliminate(A, B);
        let mut all = Matrix::new(self.n_v, b.columns);
        for (c, v) in of.iter().enumerate() {
            for k in 0..b.columns {
                *all.at(*v, k) = x.get(c, k) * T::from_f64(self.unit(*v));
            }
        }
        (all, pivot)
    }

    /// Moves q by a velocity over unit time.
    pub fn advance<T: Real>(&self, q: &mut [T], by: &[T]) {
        for (j, joint) in self.of.joints.iter().enumerate() {
            let q = &mut q[self.q[j]..];
            let by = &by[self.v[j]..];
            let turn = |q: &mut [T], by: &[T]| {
                let half = [by[0], by[1], by[2]].map(|x| x * T::from_f64(0.5));
                let [x, y, z, w] = [q[0], q[1], q[2], q[3]];
                let size = dot(half, half).sqrt();
                let (s, c) = size.sin_cos();
                let s = if size.to_f64() < 1e-30 { T::ONE } else { s / size };
                let [a, b, d] = half.map(|h| h * s);
                q[0] = x * c + w * a + y * d - z * b;
                q[1] = y * c + w * b + z * a - x * d;
                q[2] = z * c + w * d + x * b - y * a;
                q[3] = w * c - x * a - y * b - z * d;
            };
            match joint.kind {
                JointKind::Fixed => {}
                JointKind::Spherical => turn(q, by),
                JointKind::Floating => {
                    let step = apply(&quaternion(&q[3..7]), [by[3], by[4], by[5]]);
                    (0..3).for_each(|k| q[k] += step[k]);
                    turn(&mut q[3..7], by);
                }
                _ => q[0] += by[0],
            }
        }
    }

    /// Closes the loops from a pose near by, dependents only; the number of steps and the least
    /// pivot, or none.
    pub fn close<T: Real>(&self, q: &mut [T], steps: usize) -> Option<(usize, f64)> {
        let still = vec![T::ZERO; self.n_v];
        if self.rows.is_empty() {
            return Some((0, 1.0));
        }
        let mut before = f64::INFINITY;
        for k in 0..steps {
            let poses = self.poses(q);
            let phi = self.rows(q, &poses, &still, &still)[0].clone();
            let mut b = Matrix::new(self.rows.len(), 1);
            phi.iter().enumerate().for_each(|(r, x)| *b.at(r, 0) = -*x);
            let (x, pivot) = self.solve(&self.jacobian(q, &poses), &b);
            let by: Vec<T> = (0..self.n_v).map(|v| x.get(v, 0)).collect();
            let size = by
                .iter()
                .enumerate()
                .fold(0.0, |size: f64, (v, x)| size.max(x.to_f64().abs() / self.unit(v)));
            if size.is_nan() || size >= LONGEST {
                return None;
            }
            self.advance(q, &by);
            // the last step doubles the digits; at the rounding of the given numbers, where
            // redundant rows disagree, no step is smaller than the one before
            if size < T::EPSILON.sqrt() * 0.1 || size < 1e3 * f64::EPSILON && size >= before {
                let phi = self.rows(q, &self.poses(q), &still, &still)[0].clone();
                let open = phi.iter().zip(&self.rows).fold(0.0, |open: f64, (x, row)| {
                    open.max(x.to_f64().abs() / self.row_unit(row))
                });
                return (open < CLOSED).then_some((k + 1, pivot));
            }
            before = size;
        }
        None
    }

    /// G and g of a closed state.
    pub fn rates<T: Real>(&self, q: &[T], yd: &[T]) -> Rates<T> {
        let of = self.independents();
        let n = of.len();
        let still = vec![T::ZERO; self.n_v];
        let poses = self.poses(q);
        let K = self.jacobian(q, &poses);
        let mut b = Matrix::new(self.rows.len(), n);
        for r in 0..self.rows.len() {
            for (c, v) in of.iter().enumerate() {
                *b.at(r, c) = -K.get(r, *v);
            }
        }
        let (x, pivot) = self.solve(&K, &b);
        let mut G = vec![T::ZERO; self.n_v * n];
        for v in 0..self.n_v {
            (0..n).for_each(|c| G[v * n + c] = x.get(v, c));
        }
        of.iter().enumerate().for_each(|(c, v)| G[*v * n + c] = T::ONE);
        let qd = self.rate(&G, yd);
        let bias = self.rows(q, &poses, &qd, &still)[2].clone();
        let mut b = Matrix::new(self.rows.len(), 1);
        bias.iter().enumerate().for_each(|(r, x)| *b.at(r, 0) = -*x);
        let (x, _) = self.solve(&K, &b);
        Rates { G, g: (0..self.n_v).map(|v| x.get(v, 0)).collect(), pivot }
    }

    /// G x.
    pub fn rate<T: Real>(&self, G: &[T], x: &[T]) -> Vec<T> {
        if x.is_empty() {
            return vec![T::ZERO; self.n_v];
        }
        G.chunks(x.len())
            .map(|row| row.iter().zip(x).fold(T::ZERO, |sum, (g, x)| sum + *g * *x))
            .collect()
    }

    /// Follows the loops from the zero pose to values of joints of one freedom and of quaternions,
    /// all at once along a line; the pose and the least pivot on the way, or none where it cannot.
    /// A step moves no independent by more than this, in radians or lengths.
    pub fn follow(
        &self,
        start: &[f64],
        targets: &[(usize, f64)],
        longest_step: f64,
    ) -> Option<(Vec<f64>, f64)> {
        let mut q = start.to_vec();
        let begin: Vec<f64> = targets.iter().map(|(k, _)| q[*k]).collect();
        let mut least = f64::INFINITY;
        let mut at = 0.0;
        let far = |(to, from): (&(usize, f64), &f64)| (to.1 - from).abs() / self.unit_of_q(to.0);
        let longest = targets.iter().zip(&begin).map(far).fold(0.0, f64::max);
        let most = (longest_step / longest).min(0.25);
        let mut step = most;
        while at < 1.0 {
            let next = (at + step).min(1.0);
            let mut there = q.clone();
            for ((k, to), from) in targets.iter().zip(&begin) {
                there[*k] = if next == 1.0 { *to } else { from + next * (to - from) };
            }
            // dependents go on along their rates
            let closed = self.predict(&mut there, &q).and_then(|()| self.close(&mut there, 5));
            match closed {
                Some((_, pivot)) if self.is_near(&there, &q) => {
                    least = least.min(pivot);
                    (at, q) = (next, there);
                    step = (step * 1.6).min(most);
                }
                _ => {
                    step *= 0.5;
                    if step < SHORTEST * most {
                        return None;
                    }
                }
            }
        }
        Some((q, least))
    }

    /// True where no dependent moved by more than a part of a turn.
    fn is_near(&self, to: &[f64], from: &[f64]) -> bool {
        self.of.joints.iter().enumerate().all(|(j, joint)| {
            let k = self.q[j];
            let free = self.independent.contains(&j) || self.held.contains(&j);
            let turns = matches!(joint.kind, JointKind::Revolute | JointKind::Continuous);
            free || !turns || (to[k] - from[k]).abs() < 0.1 * PI
        })
    }

    /// Adds to the dependents of `to` their motion with the independents from `from`.
    fn predict(&self, to: &mut [f64], from: &[f64]) -> Option<()> {
        if self.rows.is_empty() {
            return Some(());
        }
        let mut by = vec![0.0; self.n_v];
        for (j, joint) in self.of.joints.iter().enumerate() {
            if counts(joint.kind) == (1, 1) {
                by[self.v[j]] = to[self.q[j]] - from[self.q[j]];
            }
        }
        let K = self.jacobian(from, &self.poses(from));
        let mut b = Matrix::new(self.rows.len(), 1);
        for r in 0..self.rows.len() {
            *b.at(r, 0) = -(0..self.n_v).fold(0.0, |sum, v| sum + K.get(r, v) * by[v]);
        }
        let (x, pivot) = self.solve(&K, &b);
        let x: Vec<f64> = (0..self.n_v).map(|v| x.get(v, 0)).collect();
        let longest =
            x.iter().enumerate().fold(0.0, |l: f64, (v, x)| l.max(x.abs() / self.unit(v)));
        if !(longest < 0.2 && pivot > 1e-6) {
            return None;
        }
        self.advance(to, &x);
        Some(())
    }
}
