//! Poses of a description in double-double, and the rotation of a joint's axis onto z.

use nalgebra::{Matrix3, Vector3};

use crate::description::{Description, Inertial, Placement};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::{Matrix, Pose};

/// A vector of doubles.
pub(crate) fn vector(x: [f64; 3]) -> Vector3<Dd> {
    Vector3::new(Dd::from_f64(x[0]), Dd::from_f64(x[1]), Dd::from_f64(x[2]))
}

impl Placement {
    /// The rows of R = Rz(yaw) Ry(pitch) Rx(roll), as URDF has it.
    pub fn rotation<T: Real>(&self) -> [[T; 3]; 3] {
        let [(sr, cr), (sp, cp), (sy, cy)] = self.rpy.map(|angle| T::from_f64(angle).sin_cos());
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    }
}

pub(crate) fn pose(placement: &Placement) -> Pose<Dd> {
    let [[a, b, c], [d, e, f], [g, h, i]] = placement.rotation();
    Pose { R: Matrix3::new(a, b, c, d, e, f, g, h, i), p: vector(placement.xyz) }
}

/// Pose of a link at zero {root}; `None` for links in a cycle.
pub(crate) fn link_pose(description: &Description, mut link: usize) -> Option<Pose<Dd>> {
    let mut x = Pose::identity();
    for _ in 0..=description.joints.len() {
        let Some(joint) = description.joints.iter().find(|joint| joint.child == link) else {
            return Some(x);
        };
        x = pose(&joint.origin).then(&x);
        link = joint.parent;
    }
    None
}

/// |v|.
pub(crate) fn norm(v: &Vector3<Dd>) -> Dd {
    (*v).dot(*v).sqrt()
}

/// v / |v|; `None` for a vector without direction.
pub(crate) fn unit(v: &Vector3<Dd>) -> Option<Vector3<Dd>> {
    let length = norm(v);
    (length > Dd::ZERO && length.is_finite()).then(|| v.map(|x| x / length))
}

/// A direction as written, of unit length.
pub(crate) fn unit_of(x: [f64; 3]) -> Option<Vector3<Dd>> {
    unit(&vector(x))
}

/// A rotation whose third column is the unit vector z; a permutation where z is along an axis.
pub(crate) fn onto_z(z: &Vector3<Dd>) -> Matrix3<Dd> {
    // start from the axis that is farthest from z
    let k = (1..3).fold(0, |k, i| if z[i].abs() < z[k].abs() { i } else { k });
    let axis = |i: usize| Dd::from_f64(if i == k { 1.0 } else { 0.0 });
    let e = Vector3::new(axis(0), axis(1), axis(2));
    let y = (*z).cross(e);
    let y = unit(&y).unwrap_or(y);
    let x = y.cross(*z);
    Matrix3::from_columns(&[x, y, *z])
}

/// Mass, first moment and inertia about a body's origin of a link's inertial, the link at
/// `x_body_link`.
pub(crate) fn inertia(
    inertial: &Inertial,
    x_body_link: &Pose<Dd>,
) -> (Dd, Vector3<Dd>, Matrix3<Dd>) {
    let at = x_body_link.then(&pose(&inertial.origin));
    let [xx, xy, xz, yy, yz, zz] = inertial.inertia.map(Dd::from_f64);
    let of_center = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let mass = Dd::from_f64(inertial.mass);
    let c = at.p;
    let turned = at.R.times(of_center).times(at.R.transpose());
    let square = c.dot(c);
    let steiner = Matrix3::from_fn(|i, j| (if i == j { square } else { Dd::ZERO }) - c[i] * c[j]);
    (mass, c.map(|x| x * mass), Matrix3::from_fn(|i, j| turned[(i, j)] + steiner[(i, j)] * mass))
}

/// z axis of a pose.
pub(crate) fn axis(pose: &Pose<Dd>) -> Vector3<Dd> {
    pose.R.col(2)
}

/// A direction of a frame, seen from outside.
pub(crate) fn direction(pose: &Pose<Dd>, x: &Vector3<Dd>) -> Vector3<Dd> {
    pose.R.apply(*x)
}
