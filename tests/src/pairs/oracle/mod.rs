//! The equations of a described robot, written down a second time: no cluster, no closed form, no
//! recursion over clusters. Every link moves by the formulas of relative motion in root axes, loops
//! are rows over all joints, and dependents follow from them by elimination with full pivoting.

mod curves;
mod geometry;
mod loops;
mod motion;
mod solve;

use sarrus_dynamics::description::{self as written, Description, JointKind};
use sarrus_dynamics::scalar::{Dd, Real};

use super::algebra::{M3, V3, dot, scaled};
use curves::Bend;
use geometry::{counts, line_of, placement, vector};

/// A robot as equations.
pub struct Oracle<'a> {
    of: &'a Description,
    /// Joints from the root outwards.
    order: Vec<usize>,
    root: usize,
    /// First coordinate and first velocity of each joint, and the numbers of all.
    q: Vec<usize>,
    v: Vec<usize>,
    n_q: usize,
    n_v: usize,
    /// Joints that stay where they are told.
    held: Vec<usize>,
    /// Independent joints, in the order of the description.
    independent: Vec<usize>,
    /// A length that is typical of the loops `[m]`.
    length: f64,
    rows: Vec<Row>,
    /// Pose of each joint frame on its parent, and the unit axis in it.
    joints: Vec<(Pose<Dd>, V3<Dd>)>,
    /// Of each joint the links that it moves.
    carries: Vec<Vec<bool>>,
    /// Ends of each cut, and its frame on both.
    cuts: Vec<(usize, usize, Pose<Dd>, Pose<Dd>)>,
}

/// A row of the loops.
enum Row {
    /// `axis`, `against` and the frames of a cut.
    Cut { cut: usize, axis: [f64; 6], against: Option<[f64; 3]>, line: Option<[f64; 3]> },
    /// Joint, masters, offset, curves.
    Coupling(usize, Vec<(usize, f64)>, f64, Vec<(usize, Bend)>),
}

/// A pose: rotation and origin.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T> {
    /// Rotation.
    pub R: M3<T>,
    /// Origin.
    pub p: V3<T>,
}

/// Motion of a link in root axes.
#[derive(Clone, Copy, Debug)]
pub struct Link<T> {
    /// Orientation and origin.
    pub R: M3<T>,
    /// Origin.
    pub p: V3<T>,
    /// Angular velocity, velocity of the origin, angular acceleration, acceleration of the origin.
    pub w: V3<T>,
    /// Velocity of the origin.
    pub d: V3<T>,
    /// Angular acceleration.
    pub a: V3<T>,
    /// Acceleration of the origin.
    pub e: V3<T>,
}

/// Positions, velocities, accelerations of all joints.
pub struct Motion<T> {
    /// Coordinates.
    pub q: Vec<T>,
    /// Velocities.
    pub qd: Vec<T>,
    /// Accelerations.
    pub qdd: Vec<T>,
}

/// Rates of the closed loops at a pose.
pub struct Rates<T> {
    /// q̇ = G ẏ (n_v × n_vy), row by row.
    pub G: Vec<T>,
    /// q̈ = G ÿ + g.
    pub g: Vec<T>,
    /// The least pivot of the scaled elimination.
    pub pivot: f64,
}

impl<'a> Oracle<'a> {
    /// The equations of a robot of which some joints are held, with these independent joints.
    pub fn new(of: &'a Description, independent: &[usize], held: &[usize], length: f64) -> Self {
        let mut has_parent = vec![false; of.links.len()];
        of.joints.iter().for_each(|joint| has_parent[joint.child] = true);
        let root = has_parent.iter().position(|has| !has).unwrap_or(0);
        let mut order = Vec::new();
        let mut reached = vec![root];
        while let Some(link) = reached.pop() {
            for (j, joint) in of.joints.iter().enumerate().filter(|(_, x)| x.parent == link) {
                order.push(j);
                reached.push(joint.child);
            }
        }
        let mut q = Vec::new();
        let mut v = Vec::new();
        let mut n_q = 0;
        let mut n_v = 0;
        for joint in &of.joints {
            q.push(n_q);
            v.push(n_v);
            let (of_q, of_v) = counts(joint.kind);
            (n_q, n_v) = (n_q + of_q, n_v + of_v);
        }
        let cuts = of.submechanisms.iter().flat_map(|part| &part.loops);
        let mut rows: Vec<Row> = cuts
            .enumerate()
            .flat_map(|(cut, x)| {
                let line = line_of(&x.rows);
                x.rows.iter().map(move |row| (cut, row, line))
            })
            .map(|(cut, row, line)| Row::Cut { cut, axis: row.axis, against: row.against, line })
            .collect();
        rows.extend(of.joints.iter().enumerate().filter_map(|(j, joint)| {
            let coupling = joint.coupling.as_ref()?;
            let bends = coupling.curves.iter().map(|(of, curve)| (*of, Bend::new(curve)));
            Some(Row::Coupling(j, coupling.terms.clone(), coupling.offset, bends.collect()))
        }));
        let held = held.to_vec();
        let independent = independent.to_vec();
        let joint = |joint: &written::Joint| {
            let axis: V3<Dd> = vector(joint.axis);
            (placement(&joint.origin), scaled(axis, Dd::ONE / dot(axis, axis).sqrt()))
        };
        let joints = of.joints.iter().map(joint).collect();
        let mut carries = vec![vec![false; of.links.len()]; of.joints.len()];
        for &j in order.iter().rev() {
            let child = of.joints[j].child;
            carries[j][child] = true;
            for k in (0..of.joints.len()).filter(|k| of.joints[*k].parent == child) {
                for link in 0..of.links.len() {
                    carries[j][link] |= carries[k][link];
                }
            }
        }
        let cuts = Vec::new();
        let mut made = Oracle {
            of,
            order,
            root,
            q,
            v,
            n_q,
            n_v,
            held,
            independent,
            length,
            rows,
            joints,
            carries,
            cuts,
        };
        made.cuts = made.frames();
        made
    }

    /// Number of velocities.
    pub fn n_v(&self) -> usize {
        self.n_v
    }

    /// Number of rows of the loops.
    pub fn n_rows(&self) -> usize {
        self.rows.len()
    }

    /// Names of the coordinates and of the velocities, as the model calls them.
    pub fn names(&self) -> (Vec<String>, Vec<String>) {
        let mut q = Vec::new();
        let mut v = Vec::new();
        for joint in &self.of.joints {
            let name = &joint.name;
            let with = |ends: &[&str]| ends.iter().map(|x| format!("{name}/{x}")).collect();
            let (of_q, of_v): (Vec<String>, Vec<String>) = match joint.kind {
                JointKind::Fixed => continue,
                JointKind::Spherical => {
                    (with(&["qx", "qy", "qz", "qw"]), with(&["rx", "ry", "rz"]))
                }
                JointKind::Floating => (
                    with(&["x", "y", "z", "qx", "qy", "qz", "qw"]),
                    with(&["rx", "ry", "rz", "tx", "ty", "tz"]),
                ),
                _ => (vec![name.clone()], vec![name.clone()]),
            };
            q.extend(of_q);
            v.extend(of_v);
        }
        (q, v)
    }

    /// The zero pose.
    pub fn zero<T: Real>(&self) -> Vec<T> {
        let mut q = vec![T::ZERO; self.n_q];
        for (j, joint) in self.of.joints.iter().enumerate() {
            let n = counts(joint.kind).0;
            if n > 1 {
                q[self.q[j] + n - 1] = T::ONE;
            }
        }
        q
    }

    /// Velocities of the independent joints.
    pub fn independents(&self) -> Vec<usize> {
        let of = |j: &usize| self.v[*j]..self.v[*j] + counts(self.of.joints[*j].kind).1;
        self.independent.iter().flat_map(of).collect()
    }

    /// Coordinates of the independent joints.
    pub fn independent_q(&self) -> Vec<usize> {
        let of = |j: &usize| self.q[*j]..self.q[*j] + counts(self.of.joints[*j].kind).0;
        self.independent.iter().flat_map(of).collect()
    }

    /// The coordinate of a joint of one freedom.
    pub fn coordinate(&self, joint: usize) -> usize {
        self.q[joint]
    }

    /// The coordinate of a velocity of a joint of one freedom.
    pub fn coordinate_of(&self, v: usize) -> usize {
        self.v.iter().position(|of| *of == v).map_or(0, |j| self.q[j])
    }

    fn dependents(&self) -> Vec<usize> {
        let mut free = vec![true; self.n_v];
        for j in self.independent.iter().chain(&self.held) {
            free[self.v[*j]..self.v[*j] + counts(self.of.joints[*j].kind).1].fill(false);
        }
        (0..self.n_v).filter(|v| free[*v]).collect()
    }
}
