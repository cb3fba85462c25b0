//! The equations of a described robot, written down a second time: no cluster, no closed form, no
//! recursion over clusters. Every link moves by the formulas of relative motion in root axes, loops
//! are rows over all joints, and dependents follow from them by elimination with full pivoting.

use std::f64::consts::PI;

use sarrus_dynamics::description::{self as written, Cut, Description, JointKind, Placement};
use sarrus_dynamics::scalar::{Dd, Real};

use super::algebra::{M3, Matrix, V3, add, apply, cross, dot, eliminate, scaled, sub, turned};

/// Residual of a row that a pose satisfies, in units of its row.
const CLOSED: f64 = 1e-9;
/// Longest step of one Newton correction, in radians or lengths.
const LONGEST: f64 = 0.25;
/// Smallest part of the longest step of a path.
const SHORTEST: f64 = 1.0 / 64.0;

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
    /// Joint, masters, offset.
    Coupling(usize, Vec<(usize, f64)>, f64),
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

fn vector<T: Real>(x: [f64; 3]) -> V3<T> {
    x.map(T::from_f64)
}

fn placement<T: Real>(of: &Placement) -> Pose<T> {
    let [r, p, y] = of.rpy.map(|angle| T::from_f64(angle).sin_cos());
    let R = [
        [y.1 * p.1, y.1 * p.0 * r.0 - y.0 * r.1, y.1 * p.0 * r.1 + y.0 * r.0],
        [y.0 * p.1, y.0 * p.0 * r.0 + y.1 * r.1, y.0 * p.0 * r.1 - y.1 * r.0],
        [-p.0, p.1 * r.0, p.1 * r.1],
    ];
    Pose { R, p: vector(of.xyz) }
}

fn product<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    let column = |k: usize| apply(a, [b[0][k], b[1][k], b[2][k]]);
    let [x, y, z] = [column(0), column(1), column(2)];
    [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]]
}

fn then<T: Real>(a: &Pose<T>, b: &Pose<T>) -> Pose<T> {
    Pose { R: product(&a.R, &b.R), p: add(a.p, apply(&a.R, b.p)) }
}

fn inverse<T: Real>(a: &Pose<T>) -> Pose<T> {
    let R: M3<T> = std::array::from_fn(|i| std::array::from_fn(|j| a.R[j][i]));
    Pose { R, p: scaled(apply(&R, a.p), -T::ONE) }
}

/// Rotation by an angle about a unit axis.
fn about<T: Real>(axis: V3<T>, angle: T) -> M3<T> {
    let (s, c) = angle.sin_cos();
    let e = T::ONE - c;
    let [x, y, z] = axis;
    [
        [c + x * x * e, x * y * e - z * s, x * z * e + y * s],
        [y * x * e + z * s, c + y * y * e, y * z * e - x * s],
        [z * x * e - y * s, z * y * e + x * s, c + z * z * e],
    ]
}

/// Rotation of a quaternion x y z w of any length.
fn quaternion<T: Real>(q: &[T]) -> M3<T> {
    let square = q.iter().fold(T::ZERO, |sum, x| sum + *x * *x);
    let [x, y, z, w] = [q[0], q[1], q[2], q[3]];
    let two = T::from_f64(2.0) / square;
    [
        [T::ONE - two * (y * y + z * z), two * (x * y - z * w), two * (x * z + y * w)],
        [two * (x * y + z * w), T::ONE - two * (x * x + z * z), two * (y * z - x * w)],
        [two * (x * z - y * w), two * (y * z + x * w), T::ONE - two * (x * x + y * y)],
    ]
}

/// log of a rotation.
fn log<T: Real>(R: &M3<T>) -> V3<T> {
    let half = T::from_f64(0.5);
    let s = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]].map(|x| x * half);
    let sine = dot(s, s).sqrt();
    let cosine = (R[0][0] + R[1][1] + R[2][2] - T::ONE) * half;
    if sine.to_f64() < 1e-30 { s } else { scaled(s, sine.atan2(cosine) / sine) }
}

/// A number in another scalar.
fn number<T: Real>(x: Dd) -> T {
    let hi = x.to_f64();
    T::from_f64(hi) + T::from_f64((x - Dd::from(hi)).to_f64())
}

/// A pose in another scalar.
fn converted<T: Real>(of: &Pose<Dd>) -> Pose<T> {
    Pose { R: of.R.map(|row| row.map(number)), p: of.p.map(number) }
}

/// The line about which the angular rows of a cut leave turns, if it is one.
fn line_of(rows: &[written::Row]) -> Option<[f64; 3]> {
    let of = rows.iter().filter(|row| row.against.is_none());
    let axes: Vec<[f64; 3]> = of
        .map(|row| [row.axis[0], row.axis[1], row.axis[2]])
        .filter(|axis| dot(*axis, *axis) > 0.0)
        .map(|axis| scaled(axis, 1.0 / dot(axis, axis).sqrt()))
        .collect();
    let across = axes.iter().flat_map(|a| axes.iter().map(|b| cross(*a, *b)));
    let line = across.max_by(|a, b| f64::total_cmp(&dot(*a, *a), &dot(*b, *b)))?;
    let size = dot(line, line).sqrt();
    if size < 1e-6 {
        return None;
    }
    let line = scaled(line, 1.0 / size);
    axes.iter().all(|axis| dot(*axis, line).abs() < 1e-9).then_some(line)
}

/// n_q and n_v of a joint.
fn counts(kind: JointKind) -> (usize, usize) {
    match kind {
        JointKind::Fixed => (0, 0),
        JointKind::Spherical => (4, 3),
        JointKind::Floating => (7, 6),
        _ => (1, 1),
    }
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
            Some(Row::Coupling(j, coupling.terms.clone(), coupling.offset))
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

    fn dependents(&self) -> Vec<usize> {
        let mut free = vec![true; self.n_v];
        for j in self.independent.iter().chain(&self.held) {
            free[self.v[*j]..self.v[*j] + counts(self.of.joints[*j].kind).1].fill(false);
        }
        (0..self.n_v).filter(|v| free[*v]).collect()
    }

    /// The pose of every link.
    pub fn poses<T: Real>(&self, q: &[T]) -> Vec<Pose<T>> {
        let o = T::ZERO;
        let I = [[T::ONE, o, o], [o, T::ONE, o], [o, o, T::ONE]];
        let mut poses = vec![Pose { R: I, p: [o; 3] }; self.of.links.len()];
        for &j in &self.order {
            let joint = &self.of.joints[j];
            let (origin, axis) = &self.joints[j];
            let mut x = then(&poses[joint.parent], &converted(origin));
            let axis = axis.map(number);
            let q = &q[self.q[j]..];
            match joint.kind {
                JointKind::Revolute | JointKind::Continuous => {
                    x.R = product(&x.R, &about(axis, q[0]));
                }
                JointKind::Prismatic => x.p = add(x.p, apply(&x.R, scaled(axis, q[0]))),
                JointKind::Spherical => x.R = product(&x.R, &quaternion(&q[..4])),
                JointKind::Floating => {
                    x.p = add(x.p, apply(&x.R, [q[0], q[1], q[2]]));
                    x.R = product(&x.R, &quaternion(&q[3..7]));
                }
                _ => {}
            }
            poses[joint.child] = x;
        }
        poses
    }

    /// The motion of every link.
    pub fn links<T: Real>(&self, poses: &[Pose<T>], qd: &[T], qdd: &[T]) -> Vec<Link<T>> {
        let o = [T::ZERO; 3];
        let still = |x: &Pose<T>| Link { R: x.R, p: x.p, w: o, d: o, a: o, e: o };
        let mut links: Vec<Link<T>> = poses.iter().map(still).collect();
        let two = T::from_f64(2.0);
        for &j in &self.order {
            let joint = &self.of.joints[j];
            let parent = links[joint.parent];
            let mut x = links[joint.child];
            // an axis is the same before and after the turn about it
            let axis = apply(&x.R, self.joints[j].1.map(number));
            let qd = &qd[self.v[j]..];
            let qdd = &qdd[self.v[j]..];
            // velocity and acceleration against the parent, seen from it
            let [mut w, mut a, mut d, mut e] = [o; 4];
            match joint.kind {
                JointKind::Revolute | JointKind::Continuous => {
                    (w, a) = (scaled(axis, qd[0]), scaled(axis, qdd[0]));
                }
                JointKind::Prismatic => (d, e) = (scaled(axis, qd[0]), scaled(axis, qdd[0])),
                JointKind::Spherical | JointKind::Floating => {
                    w = apply(&x.R, [qd[0], qd[1], qd[2]]);
                    a = apply(&x.R, [qdd[0], qdd[1], qdd[2]]);
                }
                _ => {}
            }
            if joint.kind == JointKind::Floating {
                d = apply(&x.R, [qd[3], qd[4], qd[5]]);
                e = add(cross(w, d), apply(&x.R, [qdd[3], qdd[4], qdd[5]]));
            }
            let r = sub(x.p, parent.p);
            let W = parent.w;
            x.w = add(W, w);
            x.a = add(add(parent.a, a), cross(W, w));
            x.d = add(add(parent.d, d), cross(W, r));
            let carried = add(cross(parent.a, r), cross(W, cross(W, r)));
            x.e = add(add(parent.e, carried), add(e, scaled(cross(W, d), two)));
            links[joint.child] = x;
        }
        links
    }

    /// Forces of the tree: M q̈ + C, with springs, dampers and rotors.
    pub fn forces<T: Real>(&self, q: &[T], poses: &[Pose<T>], qd: &[T], qdd: &[T]) -> Vec<T> {
        let links = self.links(poses, qd, qdd);
        let gravity = vector(self.of.gravity);
        let o = [T::ZERO; 3];
        // force and moment about the origin of each link, from the leaves inwards
        let mut force = vec![(o, o); links.len()];
        for (k, link) in self.of.links.iter().enumerate() {
            let Some(inertial) = &link.inertial else { continue };
            let x = &links[k];
            let frame = then(&Pose { R: x.R, p: o }, &placement(&inertial.origin));
            let r = frame.p;
            let at = add(add(x.e, cross(x.a, r)), cross(x.w, cross(x.w, r)));
            let f = scaled(sub(at, gravity), T::from_f64(inertial.mass));
            let [xx, xy, xz, yy, yz, zz] = inertial.inertia.map(T::from_f64);
            let I = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
            let of = |v: V3<T>| apply(&frame.R, apply(&I, turned(&frame.R, v)));
            let n = add(of(x.a), cross(x.w, of(x.w)));
            force[k] = (f, add(n, cross(r, f)));
        }
        let mut tau = vec![T::ZERO; self.n_v];
        for &j in self.order.iter().rev() {
            let joint = &self.of.joints[j];
            let x = &links[joint.child];
            let (f, n) = force[joint.child];
            let r = sub(x.p, links[joint.parent].p);
            let parent = &mut force[joint.parent];
            *parent = (add(parent.0, f), add(parent.1, add(n, cross(r, f))));
            let axis = apply(&x.R, self.joints[j].1.map(number));
            let [fb, nb] = [turned(&x.R, f), turned(&x.R, n)];
            let v = self.v[j];
            let tau = &mut tau[v..];
            let terms = &joint.terms;
            let number = T::from_f64;
            match joint.kind {
                JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => {
                    let along = if joint.kind == JointKind::Prismatic { f } else { n };
                    let rotor = number(terms.gear_ratio)
                        * number(terms.gear_ratio)
                        * number(terms.rotor_inertia);
                    let spring = number(terms.stiffness) * (q[self.q[j]] - number(terms.rest));
                    tau[0] =
                        dot(axis, along) + rotor * qdd[v] + number(terms.damping) * qd[v] + spring;
                }
                JointKind::Spherical => {
                    for k in 0..3 {
                        tau[k] = nb[k] + number(terms.damping) * qd[v + k];
                    }
                }
                JointKind::Floating => {
                    for k in 0..3 {
                        (tau[k], tau[3 + k]) = (nb[k], fb[k]);
                    }
                }
                _ => {}
            }
        }
        tau
    }

    /// Poses of the cut frames on their links.
    fn frames(&self) -> Vec<(usize, usize, Pose<Dd>, Pose<Dd>)> {
        let poses = self.poses(&self.zero::<Dd>());
        let pose = |link: usize| poses[link];
        let loops = self.of.submechanisms.iter().flat_map(|part| &part.loops);
        loops
            .map(|of| {
                let both = |world: Pose<Dd>| {
                    let on = |link: usize| then(&inverse(&pose(link)), &world);
                    (on(of.predecessor), on(of.successor))
                };
                let (p, s) = match &of.cut {
                    Cut::AtJoint(j) => both(pose(self.of.joints[*j].child)),
                    Cut::AtLink(link) => both(pose(*link)),
                    Cut::Placed { predecessor, successor } => {
                        (placement(predecessor), placement(successor))
                    }
                    _ => both(pose(self.root)),
                };
                (of.predecessor, of.successor, p, s)
            })
            .collect()
    }

    /// φ, K q̇ and their rates −k at q̈ = 0 of every row; q̈ counts where it is not zero.
    pub fn rows<T: Real>(&self, q: &[T], poses: &[Pose<T>], qd: &[T], qdd: &[T]) -> [Vec<T>; 3] {
        let links = self.links(poses, qd, qdd);
        let two = T::from_f64(2.0);
        let mut all = [vec![], vec![], vec![]];
        for row in &self.rows {
            let values = match row {
                Row::Coupling(j, masters, offset) => {
                    let sum = |of: &[T], at: &[usize]| {
                        masters.iter().fold(of[at[*j]], |sum, (master, ratio)| {
                            sum - T::from_f64(*ratio) * of[at[*master]]
                        })
                    };
                    [sum(q, &self.q) - T::from_f64(*offset), sum(qd, &self.v), sum(qdd, &self.v)]
                }
                Row::Cut { cut, axis, against, line } => {
                    let (p, s, on_p, on_s) = &self.cuts[*cut];
                    let [on_p, on_s] = [on_p, on_s].map(converted::<T>);
                    let [P, S] = [p, s].map(|link| &links[*link]);
                    let R_P = product(&P.R, &on_p.R);
                    let R_S = product(&S.R, &on_s.R);
                    let [angular, linear] =
                        [vector([axis[0], axis[1], axis[2]]), vector([axis[3], axis[4], axis[5]])];
                    if let Some(against) = against {
                        let a = apply(&R_P, angular);
                        let b = apply(&R_S, vector(*against));
                        let [da, db] = [cross(P.w, a), cross(S.w, b)];
                        let dda = add(cross(P.a, a), cross(P.w, da));
                        let ddb = add(cross(S.a, b), cross(S.w, db));
                        [
                            dot(a, b),
                            dot(da, b) + dot(a, db),
                            dot(dda, b) + two * dot(da, db) + dot(a, ddb),
                        ]
                    } else {
                        let at = |x: &Link<T>, r: V3<T>| {
                            let r = apply(&x.R, r);
                            let d = add(x.d, cross(x.w, r));
                            let e = add(x.e, add(cross(x.a, r), cross(x.w, cross(x.w, r))));
                            (add(x.p, r), d, e)
                        };
                        let from = at(P, on_p.p);
                        let to = at(S, on_s.p);
                        let [x, d, e] = [sub(to.0, from.0), sub(to.1, from.1), sub(to.2, from.2)];
                        let rel = sub(d, cross(P.w, x));
                        let acc = sub(
                            sub(e, cross(P.a, x)),
                            add(cross(P.w, cross(P.w, x)), scaled(cross(P.w, rel), two)),
                        );
                        let w = sub(S.w, P.w);
                        let a = sub(sub(S.a, P.a), cross(P.w, w));
                        let R = product(&inverse(&Pose { R: R_P, p: x }).R, &R_S);
                        // of the same zeros as log R, with the rate ω at each
                        let theta = match line {
                            Some(line) => {
                                let line = vector(*line);
                                cross(line, apply(&R, line))
                            }
                            None => log(&R),
                        };
                        let along = |v: V3<T>| dot(linear, turned(&R_P, v));
                        let turn = |v: V3<T>| dot(angular, turned(&R_P, v));
                        [along(x) + dot(angular, theta), along(rel) + turn(w), along(acc) + turn(a)]
                    }
                }
            };
            all.iter_mut().zip(values).for_each(|(all, value)| all.push(value));
        }
        all
    }

    /// K (n_rows × n_v).
    pub fn jacobian<T: Real>(&self, poses: &[Pose<T>]) -> Matrix<T> {
        let mut K = Matrix::new(self.rows.len(), self.n_v);
        for (r, row) in self.rows.iter().enumerate() {
            let (cut, axis, against) = match row {
                Row::Coupling(j, masters, _) => {
                    *K.at(r, self.v[*j]) = T::ONE;
                    for (master, ratio) in masters {
                        *K.at(r, self.v[*master]) += -T::from_f64(*ratio);
                    }
                    continue;
                }
                Row::Cut { cut, axis, against, .. } => (*cut, axis, against),
            };
            let (p, s, on_p, on_s) = &self.cuts[cut];
            let P = then(&poses[*p], &converted(on_p));
            let S = then(&poses[*s], &converted(on_s));
            let x = sub(S.p, P.p);
            let turns = apply(&P.R, vector([axis[0], axis[1], axis[2]]));
            let (linear, angular) = match against {
                // d(a·b) = (b × a) · ω
                Some(b) => ([T::ZERO; 3], cross(apply(&S.R, vector(*b)), turns)),
                None => (apply(&P.R, vector([axis[3], axis[4], axis[5]])), turns),
            };
            for (j, joint) in self.of.joints.iter().enumerate() {
                let [on_p, on_s] = [self.carries[j][*p], self.carries[j][*s]];
                if on_p == on_s {
                    // the ends move with each other, and the row in its own axes
                    continue;
                }
                let sign = if on_s { T::ONE } else { -T::ONE };
                let at = &poses[joint.child];
                let axis = apply(&at.R, self.joints[j].1.map(number));
                // of S against P, at the point of S: P's turn carries x with it
                let turn = |w: V3<T>| {
                    let d = cross(w, sub(if on_s { S.p } else { P.p }, at.p));
                    let d = if on_s { d } else { add(d, cross(w, x)) };
                    sign * (dot(linear, d) + dot(angular, w))
                };
                let slide = |d: V3<T>| sign * dot(linear, d);
                let v = self.v[j];
                let column = |k: usize| [at.R[0][k], at.R[1][k], at.R[2][k]];
                match joint.kind {
                    JointKind::Fixed => {}
                    JointKind::Prismatic => *K.at(r, v) = slide(axis),
                    JointKind::Spherical | JointKind::Floating => {
                        (0..3).for_each(|k| *K.at(r, v + k) = turn(column(k)));
                        if joint.kind == JointKind::Floating {
                            (0..3).for_each(|k| *K.at(r, v + 3 + k) = slide(column(k)));
                        }
                    }
                    _ => *K.at(r, v) = turn(axis),
                }
            }
        }
        K
    }

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
            Row::Coupling(j, masters, _) => masters
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
            let (x, pivot) = self.solve(&self.jacobian(&poses), &b);
            let by: Vec<T> = (0..self.n_v).map(|v| x.get(v, 0)).collect();
            let size = by
                .iter()
                .enumerate()
                .fold(0.0, |size: f64, (v, x)| size.max(x.to_f64().abs() / self.unit(v)));
            if !(size < LONGEST) {
                return None;
            }
            self.advance(q, &by);
            // the last step doubles the digits; at rounding no step is smaller than the one before
            if size < T::EPSILON.sqrt() * 0.1 || size < 1e3 * T::EPSILON && size >= before {
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
        let K = self.jacobian(&poses);
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
        let K = self.jacobian(&self.poses(from));
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
