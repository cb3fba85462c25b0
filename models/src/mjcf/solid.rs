//! Shapes: volume or area, centre of mass and inertia.

use core::f64::consts::PI;

use crate::pose::Pose;

/// Symmetric matrices are xx, xy, xz, yy, yz, zz.
pub(super) type Tensor = [f64; 6];

/// Volume or area, centre, and the inertia about it of unit density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solid {
    pub(super) size: f64,
    pub(super) centre: [f64; 3],
    pub(super) inertia: Tensor,
}

/// A solid of this volume or area, with its inertia as that of one kilogram.
fn solid(size: f64, [x, y, z]: [f64; 3]) -> Solid {
    let inertia = [x, 0.0, 0.0, y, 0.0, z].map(|of| of * size);
    Solid { size, centre: [0.0; 3], inertia }
}

pub(super) fn sphere(r: f64, is_shell: bool) -> Solid {
    let (size, factor) =
        if is_shell { (4.0 * PI * r * r, 2.0 / 3.0) } else { (4.0 / 3.0 * PI * r * r * r, 0.4) };
    solid(size, [factor * r * r; 3])
}

/// Radius and length without the caps.
pub(super) fn capsule(r: f64, length: f64, is_shell: bool) -> Solid {
    let square = r * r;
    // mass of the two halves of a sphere, and of the cylinder between them
    let (size, ball) = if is_shell {
        (2.0 * PI * r * (2.0 * r + length), 2.0 * r / (2.0 * r + length))
    } else {
        (PI * square * (length + 4.0 / 3.0 * r), 4.0 * r / (4.0 * r + 3.0 * length))
    };
    let tube = 1.0 - ball;
    let (across, along) = if is_shell {
        let of_ball = 2.0 / 3.0 * ball * square;
        let off = ball * length * (length + 2.0 * r) / 4.0;
        (tube * (6.0 * square + length * length) / 12.0 + of_ball + off, tube * square + of_ball)
    } else {
        let of_ball = 0.4 * ball * square;
        let off = ball * length * (3.0 * r + 2.0 * length) / 8.0;
        (
            tube * (3.0 * square + length * length) / 12.0 + of_ball + off,
            tube * square / 2.0 + of_ball,
        )
    };
    solid(size, [across, across, along])
}

pub(super) fn cylinder(r: f64, length: f64, is_shell: bool) -> Solid {
    let square = r * r;
    if !is_shell {
        let across = (3.0 * square + length * length) / 12.0;
        return solid(PI * square * length, [across, across, square / 2.0]);
    }
    // the mantle, and the two discs at its ends
    let discs = r / (r + length);
    let mantle = 1.0 - discs;
    let across = mantle * (6.0 * square + length * length) / 12.0
        + discs * (square / 4.0 + length * length / 4.0);
    let along = mantle * square + discs * square / 2.0;
    solid(2.0 * PI * r * (r + length), [across, across, along])
}

/// Lengths of the edges.
pub(super) fn cuboid([x, y, z]: [f64; 3], is_shell: bool) -> Solid {
    let sum = |a: f64, b: f64| (a * a + b * b) / 12.0;
    if !is_shell {
        return solid(x * y * z, [sum(y, z), sum(x, z), sum(x, y)]);
    }
    // pairs of faces across each axis: at a distance of half the edge, flat along it
    let edges = [x, y, z];
    let areas = [2.0 * y * z, 2.0 * x * z, 2.0 * x * y];
    let size: f64 = areas.iter().sum();
    let mut second = [0.0; 3];
    for (k, moment) in second.iter_mut().enumerate() {
        for (face, area) in areas.iter().enumerate() {
            let factor = if face == k { 0.25 } else { 1.0 / 12.0 };
            *moment += area / size * factor * edges[k] * edges[k];
        }
    }
    let [x, y, z] = second;
    solid(size, [y + z, x + z, x + y])
}

pub(super) fn ellipsoid([x, y, z]: [f64; 3]) -> Solid {
    let sum = |a: f64, b: f64| (a * a + b * b) / 5.0;
    solid(4.0 / 3.0 * PI * x * y * z, [sum(y, z), sum(x, z), sum(x, y)])
}

/// The tensor of an inertia in the axes outside of a pose.
pub(super) fn turned(pose: Pose, [xx, xy, xz, yy, yz, zz]: Tensor) -> Tensor {
    let columns = pose.axes();
    let inner = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let entry = |i: usize, j: usize| {
        let mut sum = 0.0;
        for (a, row) in inner.iter().enumerate() {
            for (b, value) in row.iter().enumerate() {
                sum += columns[a][i] * value * columns[b][j];
            }
        }
        sum
    };
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

/// The inertia of a unit point mass about the origin.
pub(super) fn of_point([x, y, z]: [f64; 3]) -> Tensor {
    [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y]
}
