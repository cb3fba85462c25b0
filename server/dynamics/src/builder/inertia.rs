//! Inertias of simple shapes.

use crate::description::{Inertial, Placement};

impl Inertial {
    /// Mass `[kg]`, centre of mass `[m]` (3) {link} and ixx, ixy, ixz, iyy, iyz, izz about it
    /// `[kg m²]` {axes of the link}.
    pub fn new(mass: f64, centre: [f64; 3], inertia: [f64; 6]) -> Inertial {
        Inertial { origin: Placement { xyz: centre, rpy: [0.0; 3] }, mass, inertia }
    }

    /// All mass `[kg]` at a point `[m]` (3) {link}.
    pub fn point(mass: f64, at: [f64; 3]) -> Inertial {
        Inertial::new(mass, at, [0.0; 6])
    }

    /// A thin rod between two points `[m]` (3) {link}: I = m (l² 1 − l lᵀ) / 12.
    pub fn rod(mass: f64, from: [f64; 3], to: [f64; 3]) -> Inertial {
        let (centre, [x, y, z]) = span(from, to);
        let m = mass / 12.0;
        let inertia =
            [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y].map(|i| m * i);
        Inertial::new(mass, centre, inertia)
    }

    /// A box of these edges along the link's axes `[m]` (3) around a point `[m]` (3) {link}.
    pub fn cuboid(mass: f64, centre: [f64; 3], [a, b, c]: [f64; 3]) -> Inertial {
        let m = mass / 12.0;
        let inertia =
            [m * (b * b + c * c), 0.0, 0.0, m * (a * a + c * c), 0.0, m * (a * a + b * b)];
        Inertial::new(mass, centre, inertia)
    }

    /// A solid ball around a point `[m]` (3) {link}: I = 2/5 m r² 1.
    pub fn sphere(mass: f64, centre: [f64; 3], radius: f64) -> Inertial {
        let i = 0.4 * mass * radius * radius;
        Inertial::new(mass, centre, [i, 0.0, 0.0, i, 0.0, i])
    }

    /// A solid cylinder whose axis runs between two points `[m]` (3) {link}: the thin rod's inertia
    /// and m r² (1 + d dᵀ) / 4, where d is the direction of the axis.
    pub fn cylinder(mass: f64, from: [f64; 3], to: [f64; 3], radius: f64) -> Inertial {
        let rod = Inertial::rod(mass, from, to);
        let (_, v) = span(from, to);
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [x, y, z] = v.map(|x| x / length);
        let m = 0.25 * mass * radius * radius;
        let round = [1.0 + x * x, x * y, x * z, 1.0 + y * y, y * z, 1.0 + z * z];
        let inertia = std::array::from_fn(|k| rod.inertia[k] + m * round[k]);
        Inertial { inertia, ..rod }
    }
}

/// Middle and difference of two points.
fn span(from: [f64; 3], to: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let middle = std::array::from_fn(|k| 0.5 * (from[k] + to[k]));
    (middle, std::array::from_fn(|k| to[k] - from[k]))
}
