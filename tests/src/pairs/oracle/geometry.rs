//! Rotations, poses and the lines of cuts are computed without the library under test.

use sarrus_dynamics::description::{self as written, JointKind, Placement};
use sarrus_dynamics::scalar::{Dd, Real};

use super::Pose;
use crate::pairs::algebra::{M3, V3, add, apply, cross, dot, scaled};

pub(super) fn vector<T: Real>(x: [f64; 3]) -> V3<T> {
    x.map(T::from_f64)
}

pub(super) fn placement<T: Real>(of: &Placement) -> Pose<T> {
    let [r, p, y] = of.rpy.map(|angle| T::from_f64(angle).sin_cos());
    let R = [
        [y.1 * p.1, y.1 * p.0 * r.0 - y.0 * r.1, y.1 * p.0 * r.1 + y.0 * r.0],
        [y.0 * p.1, y.0 * p.0 * r.0 + y.1 * r.1, y.0 * p.0 * r.1 - y.1 * r.0],
        [-p.0, p.1 * r.0, p.1 * r.1],
    ];
    Pose { R, p: vector(of.xyz) }
}

pub(super) fn product<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    let column = |k: usize| apply(a, [b[0][k], b[1][k], b[2][k]]);
    let [x, y, z] = [column(0), column(1), column(2)];
    [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]]
}

pub(super) fn then<T: Real>(a: &Pose<T>, b: &Pose<T>) -> Pose<T> {
    Pose { R: product(&a.R, &b.R), p: add(a.p, apply(&a.R, b.p)) }
}

pub(super) fn inverse<T: Real>(a: &Pose<T>) -> Pose<T> {
    let R: M3<T> = std::array::from_fn(|i| std::array::from_fn(|j| a.R[j][i]));
    Pose { R, p: scaled(apply(&R, a.p), -T::ONE) }
}

/// Rotation by an angle about a unit axis.
pub(super) fn about<T: Real>(axis: V3<T>, angle: T) -> M3<T> {
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
pub(super) fn quaternion<T: Real>(q: &[T]) -> M3<T> {
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
pub(super) fn log<T: Real>(R: &M3<T>) -> V3<T> {
    let half = T::from_f64(0.5);
    let s = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]].map(|x| x * half);
    let sine = dot(s, s).sqrt();
    let cosine = (R[0][0] + R[1][1] + R[2][2] - T::ONE) * half;
    if sine.to_f64() < 1e-30 { s } else { scaled(s, sine.atan2(cosine) / sine) }
}

/// A number in another scalar.
pub(super) fn number<T: Real>(x: Dd) -> T {
    let hi = x.to_f64();
    T::from_f64(hi) + T::from_f64((x - Dd::from(hi)).to_f64())
}

/// A pose in another scalar.
pub(super) fn converted<T: Real>(of: &Pose<Dd>) -> Pose<T> {
    Pose { R: of.R.map(|row| row.map(number)), p: of.p.map(number) }
}

/// The line about which the angular rows of a cut leave turns, if it is one.
pub(super) fn line_of(rows: &[written::Row]) -> Option<[f64; 3]> {
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
pub(super) fn counts(kind: JointKind) -> (usize, usize) {
    match kind {
        JointKind::Fixed => (0, 0),
        JointKind::Spherical => (4, 3),
        JointKind::Floating => (7, 6),
        _ => (1, 1),
    }
}
