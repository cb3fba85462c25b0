//! An independent path follower, which solves the loop equations of the description in small steps.
//!
//! It shares no code with the program's kinematics: φ is evaluated from its definition and K by
//! differences; the dependents follow from least squares, so that rows may be redundant. A step is
//! halved until its correction and the change of the determinant are small. A fold, or a crossing
//! of branches, straight on or by a bend, stops the path.

use sarrus_dynamics::Model;
use sarrus_dynamics::description::{Cut, Description, Joint, JointKind, Placement};

use crate::rigid::{Pose, Vector, add, dot, norm, unit};

/// Longest and shortest step, as shares of the path.
const LONGEST: f64 = 0.02;
const SHORTEST: f64 = 1e-9;
/// Differences for K, in radians or lengths.
const DIFFERENCE: f64 = 1e-6;

/// The loops and couplings of a robot.
#[derive(Clone, Debug)]
pub struct Paths<'a> {
    description: &'a Description,
    /// Joints from the root outwards, each with its index in q if it has one degree of freedom.
    joints: Vec<(&'a Joint, Option<usize>)>,
    rows: Vec<Row>,
    /// Indices in q.
    independent: Vec<usize>,
    /// Independent groups of rows and the dependents that they determine.
    components: Vec<Component>,
    length: f64,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "a robot has few rows, most of them loops")]
enum Row {
    Loop {
        predecessor: (usize, Pose),
        successor: (usize, Pose),
        axis: [f64; 6],
        against: Option<Vector>,
    },
    Coupling {
        joint: usize,
        terms: Vec<(usize, f64)>,
        offset: f64,
    },
}

#[derive(Clone, Debug)]
struct Component {
    rows: Vec<usize>,
    dependent: Vec<usize>,
}

/// End of a path.
#[derive(Clone, Debug)]
pub enum End {
    /// Closed pose at the target.
    Reached(Vec<f64>),
    /// Share of the path at which a singularity stopped it.
    Blocked(f64),
}

impl<'a> Paths<'a> {
    /// The loops of a robot; `None` if a type defines them or a quaternion takes part.
    pub fn new<C>(
        description: &'a Description,
        model: &Model<C>,
        length: f64,
    ) -> Option<Paths<'a>> {
        let place = |joint: usize| {
            model.tree_q_names().iter().position(|name| *name == description.joints[joint].name)
        };
        let mut joints: Vec<(&Joint, Option<usize>)> = Vec::new();
        let is_child = |link: usize| description.joints.iter().any(|joint| joint.child == link);
        let mut reached: Vec<usize> =
            (0..description.links.len()).filter(|link| !is_child(*link)).collect();
        let mut k = 0;
        while k < reached.len() {
            let link = reached[k];
            for (j, joint) in
                description.joints.iter().enumerate().filter(|(_, joint)| joint.parent == link)
            {
                joints.push((joint, place(j)));
                reached.push(joint.child);
            }
            k += 1;
        }
        let independent: Vec<usize> = model
            .independent_names()
            .iter()
            .filter_map(|name| model.tree_q_names().iter().position(|x| x == name))
            .collect();
        let mut paths = Paths {
            description,
            joints,
            rows: Vec::new(),
            independent,
            components: Vec::new(),
            length,
        };
        let zero = paths.poses(&vec![0.0; model.sizes().n_q]);
        for submechanism in &description.submechanisms {
            let coupled = submechanism
                .spanning_tree
                .iter()
                .filter(|j| description.joints[**j].coupling.is_some())
                .count();
            if submechanism.loops.is_empty()
                && submechanism.independent.len() + coupled < submechanism.spanning_tree.len()
            {
                return None;
            }
            let turns = submechanism
                .spanning_tree
                .iter()
                .any(|j| description.joints[*j].kind == JointKind::Spherical);
            if turns && !submechanism.loops.is_empty() {
                return None;
            }
            for of in &submechanism.loops {
                let on = |frame: Pose| {
                    [of.predecessor, of.successor].map(|link| zero[link].inverse().then(&frame))
                };
                let [p, s] = match &of.cut {
                    Cut::AtJoint(joint) => on(zero[description.joints[*joint].child]),
                    Cut::AtLink(link) => on(zero[*link]),
                    Cut::Placed { predecessor, successor } => [pose(predecessor), pose(successor)],
                    _ => return None,
                };
                let row = |axis, against| Row::Loop {
                    predecessor: (of.predecessor, p),
                    successor: (of.successor, s),
                    axis,
                    against,
                };
                paths.rows.extend(of.rows.iter().map(|x| row(x.axis, x.against)));
            }
        }
        for (j, joint) in description.joints.iter().enumerate() {
            if let Some(coupling) = &joint.coupling {
                let terms = coupling
                    .terms
                    .iter()
                    .map(|(j, c)| place(*j).map(|q| (q, *c)))
                    .collect::<Option<_>>()?;
                paths.rows.push(Row::Coupling { joint: place(j)?, terms, offset: coupling.offset });
            }
        }
        paths.find_components(model.sizes().n_q);
        Some(paths)
    }

    /// Groups rows and dependents that are coupled in K at a generic pose.
    fn find_components(&mut self, n_q: usize) {
        let dependent: Vec<usize> = (0..n_q).filter(|q| !self.independent.contains(q)).collect();
        let generic: Vec<f64> = (0..n_q).map(|q| 0.3 * (1.0 + 1.7 * q as f64).sin()).collect();
        let rows: Vec<usize> = (0..self.rows.len()).collect();
        let K = self.jacobian(&generic, &rows, &dependent);
        let mut of_row: Vec<usize> = rows.clone();
        let touches = |r: usize, a: usize| K[r * dependent.len() + a].abs() > 1e-7;
        for a in 0..dependent.len() {
            let labels: Vec<usize> =
                rows.iter().filter(|r| touches(**r, a)).map(|r| of_row[*r]).collect();
            let Some(least) = labels.iter().min().copied() else { continue };
            of_row
                .iter_mut()
                .filter(|label| labels.contains(label))
                .for_each(|label| *label = least);
        }
        for label in rows.iter().filter(|r| of_row[**r] == **r) {
            let rows: Vec<usize> = rows.iter().copied().filter(|r| of_row[*r] == *label).collect();
            let tied = (0..dependent.len()).filter(|a| rows.iter().any(|r| touches(*r, *a)));
            let dependent = tied.map(|a| dependent[a]).collect();
            self.components.push(Component { rows, dependent });
        }
    }

    /// Pose of every link in the root; quaternion joints stay at zero.
    fn poses(&self, q: &[f64]) -> Vec<Pose> {
        let mut poses = vec![Pose::IDENTITY; self.description.links.len()];
        for (joint, place) in &self.joints {
            let at = poses[joint.parent].then(&pose(&joint.origin));
            let axis = if norm(joint.axis) > 0.0 { unit(joint.axis) } else { joint.axis };
            poses[joint.child] = match (joint.kind, place) {
                (JointKind::Prismatic, Some(k)) => {
                    at.then(&Pose { p: add([0.0; 3], q[*k], axis), ..Pose::IDENTITY })
                }
                (JointKind::Revolute | JointKind::Continuous, Some(k)) => {
                    at.then(&turned(axis, q[*k]))
                }
                _ => at,
            };
        }
        poses
    }

    /// φ of the given rows, with lengths in units of the robot.
    fn residual(&self, q: &[f64], rows: &[usize]) -> Vec<f64> {
        let poses = self.poses(q);
        let of = |r: &usize| match &self.rows[*r] {
            Row::Coupling { joint, terms, offset } => {
                q[*joint] - offset - terms.iter().map(|(k, c)| c * q[*k]).sum::<f64>()
            }
            Row::Loop { predecessor, successor, axis, against } => {
                let p = poses[predecessor.0].then(&predecessor.1);
                let s = poses[successor.0].then(&successor.1);
                let between = p.inverse().then(&s);
                if let Some(b) = against {
                    return dot([axis[0], axis[1], axis[2]], between.direction(*b));
                }
                let angles = if axis[..3] == [0.0; 3] { [0.0; 3] } else { log(&between) };
                dot([axis[0], axis[1], axis[2]], angles)
                    + dot([axis[3], axis[4], axis[5]], between.p) / self.length
            }
        };
        rows.iter().map(of).collect()
    }

    /// The largest |φ| of all rows.
    pub fn open_by(&self, q: &[f64]) -> f64 {
        let rows: Vec<usize> = (0..self.rows.len()).collect();
        self.residual(q, &rows).iter().fold(0.0, |worst, x| worst.max(x.abs()))
    }

    /// K of the given rows and columns.
    fn jacobian(&self, q: &[f64], rows: &[usize], columns: &[usize]) -> Vec<f64> {
        let mut K = vec![0.0; rows.len() * columns.len()];
        for (a, &k) in columns.iter().enumerate() {
            let at = |h: f64| {
                let mut q = q.to_vec();
                q[k] += h;
                self.residual(&q, rows)
            };
            let slides = self
                .joints
                .iter()
                .any(|(joint, place)| *place == Some(k) && joint.kind == JointKind::Prismatic);
            let h = if slides { DIFFERENCE * self.length } else { DIFFERENCE };
            let after = at(h);
            let before = at(-h);
            // sliders in units of the robot as well
            (0..rows.len()).for_each(|r| {
                K[r * columns.len() + a] = (after[r] - before[r]) / (2.0 * DIFFERENCE)
            });
        }
        K
    }

    /// Follows the straight line of the independents from the closed pose q to `goal`, which is
    /// indexed as q.
    pub fn follow(&self, q: &[f64], goal: &[f64]) -> End {
        let start = q.to_vec();
        let mut q = q.to_vec();
        let unit: Vec<f64> =
            (0..q.len())
                .map(|k| {
                    if self.joints.iter().any(|(joint, place)| {
                        *place == Some(k) && joint.kind == JointKind::Prismatic
                    }) {
                        self.length
                    } else {
                        1.0
                    }
                })
                .collect();
        let matrices = |q: &[f64]| -> Vec<Vec<f64>> {
            self.components.iter().map(|c| self.jacobian(q, &c.rows, &c.dependent)).collect()
        };
        let mut last = matrices(&q);
        let mut before: Option<(Vec<f64>, f64)> = None;
        let mut at = 0.0;
        let mut step = LONGEST;
        while at < 1.0 {
            let next = f64::min(1.0, at + step);
            let mut trial = q.clone();
            if let Some((before, size)) = &before {
                // along the secant
                (0..q.len()).for_each(|k| trial[k] += (q[k] - before[k]) * (next - at) / size);
            }
            for &k in &self.independent {
                trial[k] = start[k] + (goal[k] - start[k]) * next;
            }
            // the path is smooth, so the correction is of second order
            let travelled =
                (0..q.len()).map(|k| (trial[k] - q[k]).abs() / unit[k]).fold(0.0, f64::max);
            let allowed = if before.is_some() { 0.3 * travelled + 1e-9 } else { 0.05 };
            match self.closed(&mut trial, &unit, &last, allowed.min(0.05)) {
                Some(matrices) => {
                    before = Some((q, next - at));
                    (q, last, at, step) = (trial, matrices, next, (1.5 * step).min(LONGEST));
                }
                None => step *= 0.5,
            }
            if step < SHORTEST {
                return End::Blocked(at);
            }
        }
        End::Reached(q)
    }

    /// Closes the loops near q on the same branch, within the allowed distance.
    fn closed(
        &self,
        q: &mut [f64],
        unit: &[f64],
        last: &[Vec<f64>],
        allowed: f64,
    ) -> Option<Vec<Vec<f64>>> {
        let mut matrices = Vec::new();
        for (component, last) in self.components.iter().zip(last) {
            let m = component.dependent.len();
            let mut moved = 0.0;
            let mut fine = false;
            for _ in 0..8 {
                let phi = self.residual(q, &component.rows);
                let K = self.jacobian(q, &component.rows, &component.dependent);
                let normal = product(&K, &K, m);
                let right = product(&K, &phi, 1);
                let (step, _) = eliminated(normal, right, m)?;
                let size = step.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
                moved += size;
                component.dependent.iter().zip(&step).for_each(|(k, x)| q[*k] -= x * unit[*k]);
                if size < 1e-9 {
                    fine = true;
                    break;
                }
            }
            if !fine || moved > allowed {
                return None;
            }
            let K = self.jacobian(q, &component.rows, &component.dependent);
            let det = |A: &[f64], B: &[f64]| {
                eliminated(product(A, B, m), vec![0.0; m], m).map_or(0.0, |x| x.1)
            };
            let old = det(last, last);
            let new = det(&K, &K);
            let both = det(last, &K);
            // the determinant keeps its sign and changes by a bounded factor
            if both <= 0.3 * (old * new).sqrt() || !(0.25..4.0).contains(&(new / old)) {
                return None;
            }
            matrices.push(K);
        }
        Some(matrices)
    }
}

/// Aᵀ B of two matrices with the same number of rows; B has `columns` columns.
fn product(A: &[f64], B: &[f64], columns: usize) -> Vec<f64> {
    let rows = B.len() / columns.max(1);
    let n = A.len() / rows.max(1);
    (0..n * columns)
        .map(|k| (0..rows).map(|r| A[r * n + k / columns] * B[r * columns + k % columns]).sum())
        .collect()
}

/// Solution and determinant of a square system.
pub fn eliminated(mut A: Vec<f64>, mut b: Vec<f64>, n: usize) -> Option<(Vec<f64>, f64)> {
    let mut det = 1.0;
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| A[i * n + k].abs().total_cmp(&A[j * n + k].abs()))?;
        if pivot != k {
            (0..n).for_each(|j| A.swap(k * n + j, pivot * n + j));
            b.swap(k, pivot);
            det = -det;
        }
        det *= A[k * n + k];
        if A[k * n + k] == 0.0 {
            return None;
        }
        for i in k + 1..n {
            let factor = A[i * n + k] / A[k * n + k];
            (k..n).for_each(|j| A[i * n + j] -= factor * A[k * n + j]);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| A[k * n + j] * b[j]).sum();
        b[k] = (b[k] - sum) / A[k * n + k];
    }
    Some((b, det))
}

fn pose(placement: &Placement) -> Pose {
    Pose::from_rpy(placement.rpy, placement.xyz)
}

/// Rotation about an axis (Rodrigues).
fn turned(axis: Vector, angle: f64) -> Pose {
    let ((s, c), [x, y, z]) = (angle.sin_cos(), axis);
    let v = 1.0 - c;
    let R = [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
        [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
        [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
    ];
    Pose { R, p: [0.0; 3] }
}

/// Rotation vector.
fn log(of: &Pose) -> Vector {
    let R = &of.R;
    let twice = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]];
    let s = 0.5 * norm(twice);
    let c = 0.5 * (R[0][0] + R[1][1] + R[2][2] - 1.0);
    if s < 1e-9 { add([0.0; 3], 0.5, twice) } else { add([0.0; 3], s.atan2(c) / (2.0 * s), twice) }
}
