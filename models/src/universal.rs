//! The turn that a universal cut forbids, as a linear row: the point one metre out along the second axis stays across the first.

use sarrus_dynamics::description::{Cut, Joint, Loop, Placement, Row};
use sarrus_dynamics::scalar::{Dd, Real, Scalar};

type Vector = [Dd; 3];
type Matrix = [Vector; 3];

/// A frame: x of it is R x + p outside.
#[derive(Clone, Copy)]
struct Frame {
    rotation: Matrix,
    origin: Vector,
}

/// The row u of a universal cut whose three other rows are `spherical`; the axes stand in its cut frames.
pub(crate) fn turn(spherical: &Loop, axis: [f64; 3], axis2: [f64; 3], joints: &[Joint]) -> Loop {
    let [predecessor, successor] = cut_frames(spherical, joints);
    let first = unit(vector(axis));
    // what is perpendicular to the first axis up to rounding is so
    let second = vector(axis2);
    let along = dot(&first, &second);
    let second = unit(core::array::from_fn(|i| second[i] - along * first[i]));
    let out = successor.then(&Frame { rotation: identity(), origin: second }).origin;
    let [x, y, z] = rotated(&predecessor.rotation, &first).map(Dd::to_f64);
    let placed = |origin: Vector| Placement { xyz: origin.map(Dd::to_f64), rpy: [0.0; 3] };
    Loop {
        name: spherical.name.clone(),
        predecessor: spherical.predecessor,
        successor: spherical.successor,
        cut: Cut::Placed { predecessor: placed(predecessor.origin), successor: placed(out) },
        rows: vec![Row { name: "u".to_owned(), axis: [0.0, 0.0, 0.0, x, y, z] }],
    }
}

/// The cut frames on the predecessor and on the successor.
fn cut_frames(each: &Loop, joints: &[Joint]) -> [Frame; 2] {
    let ends = [each.predecessor, each.successor];
    let at = |link: usize| ends.map(|end| at_zero(joints, end).inverse().then(&at_zero(joints, link)));
    match &each.cut {
        Cut::Placed { predecessor, successor } => [frame(predecessor), frame(successor)],
        Cut::AtLink(link) => at(*link),
        Cut::AtJoint(joint) => at(joints.get(*joint).map_or(each.predecessor, |joint| joint.child)),
        _ => at(each.predecessor),
    }
}

/// The frame of a link at zero {root}.
fn at_zero(joints: &[Joint], mut link: usize) -> Frame {
    let mut x = Frame { rotation: identity(), origin: [Dd::ZERO; 3] };
    // a tree has no longer way
    for _ in 0..=joints.len() {
        let Some(joint) = joints.iter().find(|joint| joint.child == link) else { break };
        x = frame(&joint.origin).then(&x);
        link = joint.parent;
    }
    x
}

impl Frame {
    fn then(&self, next: &Frame) -> Frame {
        let moved = rotated(&self.rotation, &next.origin);
        Frame {
            rotation: core::array::from_fn(|i| core::array::from_fn(|j| dot(&self.rotation[i], &next.rotation.map(|row| row[j])))),
            origin: core::array::from_fn(|i| moved[i] + self.origin[i]),
        }
    }

    fn inverse(&self) -> Frame {
        let rotation: Matrix = core::array::from_fn(|i| core::array::from_fn(|j| self.rotation[j][i]));
        Frame { rotation, origin: rotated(&rotation, &self.origin).map(|x| -x) }
    }
}

/// R = Rz(yaw) Ry(pitch) Rx(roll), as URDF has it.
fn frame(placement: &Placement) -> Frame {
    let [(sr, cr), (sp, cp), (sy, cy)] = placement.rpy.map(|angle| Dd::from_f64(angle).sin_cos());
    let rotation = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ];
    Frame { rotation, origin: vector(placement.xyz) }
}

fn identity() -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| if i == j { Dd::ONE } else { Dd::ZERO }))
}

fn vector(x: [f64; 3]) -> Vector {
    x.map(Dd::from_f64)
}

fn rotated(rotation: &Matrix, v: &Vector) -> Vector {
    core::array::from_fn(|i| dot(&rotation[i], v))
}

fn dot(a: &Vector, b: &Vector) -> Dd {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A vector of some length, made one long.
fn unit(v: Vector) -> Vector {
    let length = dot(&v, &v).sqrt();
    v.map(|x| x / length)
}
