//! Poses as a translation and a quaternion.

use sarrus_dynamics::description::Placement;

use crate::rotation::{cross, dot, product, quaternion, rotated, rpy};

/// A translation and a unit quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    pub(crate) p: [f64; 3],
    pub(crate) r: [f64; 4],
}

impl Pose {
    pub(crate) const NONE: Pose = Pose { p: [0.0; 3], r: [0.0, 0.0, 0.0, 1.0] };

    pub(crate) fn at(p: [f64; 3]) -> Pose {
        Pose { p, ..Pose::NONE }
    }

    /// This pose, then `inner` in its axes.
    pub(crate) fn then(self, inner: Pose) -> Pose {
        Pose { p: self.apply(inner.p), r: unit(product(self.r, inner.r)).unwrap_or(self.r) }
    }

    /// A point of the inner frame in the outer one.
    pub(crate) fn apply(self, point: [f64; 3]) -> [f64; 3] {
        plus(self.p, rotated(self.r, point))
    }

    pub(crate) fn inverse(self) -> Pose {
        let [x, y, z, w] = self.r;
        let r = [-x, -y, -z, w];
        Pose { p: rotated(r, self.p).map(|x| -x), r }
    }

    pub(crate) fn of(of: &Placement) -> Pose {
        Pose { p: of.xyz, r: quaternion(of.rpy) }
    }

    pub(crate) fn placement(self) -> Placement {
        Placement { xyz: self.p, rpy: rpy(self.r) }
    }

    /// The rotation by an angle about a unit axis.
    pub(crate) fn turn([x, y, z]: [f64; 3], angle: f64) -> [f64; 4] {
        let sine = (angle / 2.0).sin();
        [sine * x, sine * y, sine * z, (angle / 2.0).cos()]
    }

    /// The three columns of the rotation.
    pub(crate) fn axes(self) -> [[f64; 3]; 3] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| rotated(self.r, axis))
    }
}

pub(crate) fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + b[k])
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// A vector of length one; `None` of a vanishing one.
pub(crate) fn unit<const N: usize>(v: [f64; N]) -> Option<[f64; N]> {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 1e-14).then(|| v.map(|x| x / length))
}

/// The least rotation that turns z into a direction.
pub(crate) fn from_z(to: [f64; 3]) -> [f64; 4] {
    let to = unit(to).unwrap_or([0.0, 0.0, 1.0]);
    let [x, y, _] = to;
    let sine = x.hypot(y);
    let axis = if sine < 1e-10 { [1.0, 0.0, 0.0] } else { [-y / sine, x / sine, 0.0] };
    Pose::turn(axis, sine.atan2(to[2]))
}

/// The rotation whose x axis is `x`, and whose y axis is `y` made perpendicular to it.
pub(crate) fn of_axes(x: [f64; 3], y: [f64; 3]) -> Option<[f64; 4]> {
    let x = unit(x)?;
    let along = dot(x, y);
    let y = unit(std::array::from_fn(|k| y[k] - along * x[k]))?;
    let z = cross(x, y);
    // four times the product of two components, from the largest diagonal part
    let d = [x[0], y[1], z[2]];
    let all = [
        [1.0 + d[0] - d[1] - d[2], x[1] + y[0], x[2] + z[0], y[2] - z[1]],
        [x[1] + y[0], 1.0 - d[0] + d[1] - d[2], y[2] + z[1], z[0] - x[2]],
        [x[2] + z[0], y[2] + z[1], 1.0 - d[0] - d[1] + d[2], x[1] - y[0]],
        [y[2] - z[1], z[0] - x[2], x[1] - y[0], 1.0 + d[0] + d[1] + d[2]],
    ];
    let largest = (0..4).fold(0, |best, k| if all[k][k] > all[best][best] { k } else { best });
    unit(all[largest])
}
