//! Which of some coordinates are quaternions, and how coordinates move with their velocities.
//!
//! A ball joint has q = x y z w and q̇ = ω in the body, a floating one q = [p; x y z w] and q̇ =
//! [ω; v] in the body; every other coordinate is its own velocity's integral.

use sarrus_dynamics::scalar::Real;

/// Coordinates of a joint: the first of each. A floating joint is a place and a ball after it; its
/// quaternion stands behind the position, its ω before the velocity of the place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Single { q: usize, v: usize },
    Ball { q: usize, v: usize },
    Place { q: usize, v: usize },
}

/// The make-up of q or y.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Coordinates {
    parts: Vec<Part>,
    pub(crate) n_q: usize,
    pub(crate) n_v: usize,
}

/// Where names stand among others, each of which is there.
pub(crate) fn places(names: &[String], among: &[String]) -> Vec<usize> {
    names.iter().filter_map(|name| among.iter().position(|other| other == name)).collect()
}

/// The numbers at some places.
pub(crate) fn pick(from: &[f64], places: &[usize]) -> Vec<f64> {
    places.iter().map(|place| from[*place]).collect()
}

/// The largest absolute value.
pub(crate) fn largest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    numbers.into_iter().fold(0.0, |largest: f64, x| largest.max(x.abs()))
}

const FLOATING: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

impl Coordinates {
    /// From the names of the coordinates and of the velocities of a model.
    pub(crate) fn of(names: &[String], rates: &[String]) -> Coordinates {
        let mut parts = Vec::new();
        let mut q = 0;
        let mut v = 0;
        while q < names.len() {
            // the joint whose parts the next names are
            let joint = rates.get(v).and_then(|name| name.strip_suffix("/rx"));
            let follows = |parts: &[&str]| {
                joint.is_some_and(|joint| {
                    let is = |(name, part): (&String, &&str)| {
                        name.strip_prefix(joint).and_then(|rest| rest.strip_prefix('/'))
                            == Some(part)
                    };
                    names
                        .get(q..q + parts.len())
                        .is_some_and(|names| names.iter().zip(parts).all(is))
                })
            };
            if follows(&FLOATING) {
                parts.extend([Part::Place { q, v: v + 3 }, Part::Ball { q: q + 3, v }]);
                (q, v) = (q + 7, v + 6);
            } else if follows(&FLOATING[3..]) {
                parts.push(Part::Ball { q, v });
                (q, v) = (q + 4, v + 3);
            } else {
                parts.push(Part::Single { q, v });
                (q, v) = (q + 1, v + 1);
            }
        }
        Coordinates { parts, n_q: q, n_v: v }
    }

    /// The coordinate of a velocity whose integral it is.
    pub(crate) fn coordinate(&self, velocity: usize) -> Option<usize> {
        self.parts.iter().find_map(|part| match part {
            Part::Single { q, v } if *v == velocity => Some(*q),
            _ => None,
        })
    }

    /// Puts each quaternion to unit length.
    pub(crate) fn normalise<T: Real>(&self, q: &mut [T]) {
        for at in self.quaternions() {
            let length = (at..at + 4).fold(T::ZERO, |sum, i| q[i].mul_add(q[i], sum)).sqrt();
            (at..at + 4).for_each(|i| q[i] = q[i] / length);
        }
    }

    /// How far the longest or shortest quaternion is from unit length.
    pub(crate) fn off_unit(&self, q: &[f64]) -> f64 {
        let length = |at: usize| q[at..at + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
        self.quaternions().map(|at| (length(at) - 1.0).abs()).fold(0.0, f64::max)
    }

    fn quaternions(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().filter_map(|part| match part {
            Part::Ball { q, .. } => Some(*q),
            _ => None,
        })
    }

    /// Coordinates at zero: quaternions at rest.
    pub(crate) fn zero(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.n_q];
        self.quaternions().for_each(|at| q[at + 3] = 1.0);
        q
    }

    /// dq/dt: R v of a position, ½ q ω of an orientation, with R of the same coordinates at unit
    /// length. The rate of a quaternion is that of `raw` itself, so that its direction turns
    /// correctly at any length.
    pub(crate) fn rate<T: Real>(&self, raw: &[T], unit: &[T], v: &[T], rate: &mut [T]) {
        for part in &self.parts {
            match *part {
                Part::Single { q: i, v: k } => rate[i] = v[k],
                Part::Ball { q: i, v: k } => {
                    quaternion_rate(&raw[i..i + 4], &v[k..k + 3], &mut rate[i..i + 4])
                }
                Part::Place { q: i, v: k } => {
                    let moved = turned(&unit[i + 3..i + 7], [v[k], v[k + 1], v[k + 2]]);
                    rate[i..i + 3].copy_from_slice(&moved);
                }
            }
        }
    }

    /// Moves q along v for a time h by the exponential map of each joint.
    pub(crate) fn advance(&self, q: &mut [f64], v: &[f64], h: f64) {
        for part in &self.parts {
            match *part {
                Part::Single { q: i, v: k } => q[i] += h * v[k],
                Part::Ball { q: i, v: k } => {
                    turn(&mut q[i..i + 4], [0, 1, 2].map(|j| h * v[k + j]))
                }
                Part::Place { q: i, v: k } => {
                    let [w, step] = [k - 3, k].map(|k| [0, 1, 2].map(|j| h * v[k + j]));
                    let moved = turned(&q[i + 3..i + 7], screw(w, step));
                    (0..3).for_each(|j| q[i + j] += moved[j]);
                }
            }
        }
    }

    /// The velocity that leads from `from` to `to` in unit time, to first order in their distance;
    /// a half turn at most.
    pub(crate) fn difference(&self, from: &[f64], to: &[f64], v: &mut [f64]) {
        for part in &self.parts {
            match *part {
                Part::Single { q: i, v: k } => v[k] = to[i] - from[i],
                Part::Ball { q: i, v: k } => {
                    v[k..k + 3].copy_from_slice(&between(&from[i..i + 4], &to[i..i + 4]))
                }
                Part::Place { q: i, v: k } => {
                    let back = [-from[i + 3], -from[i + 4], -from[i + 5], from[i + 6]];
                    let moved = turned(&back, [0, 1, 2].map(|j| to[i + j] - from[i + j]));
                    v[k..k + 3].copy_from_slice(&moved);
                }
            }
        }
    }
}

/// ½ q ω with ω in the body.
fn quaternion_rate<T: Real>(q: &[T], w: &[T], rate: &mut [T]) {
    let half = T::from_f64(0.5);
    rate[0] = half * (q[3] * w[0] + q[1] * w[2] - q[2] * w[1]);
    rate[1] = half * (q[3] * w[1] + q[2] * w[0] - q[0] * w[2]);
    rate[2] = half * (q[3] * w[2] + q[0] * w[1] - q[1] * w[0]);
    rate[3] = -half * (q[0] * w[0] + q[1] * w[1] + q[2] * w[2]);
}

/// q := q exp(½ θ), θ a turn in the body.
fn turn(q: &mut [f64], angle: [f64; 3]) {
    let size = angle.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (s, c) = Real::sin_cos(0.5 * size);
    // sin(½ θ)/θ
    let share = if size > 1e-8 { s / size } else { 0.5 };
    let [x, y, z] = angle.map(|a| share * a);
    let [a, b, d, w] = [q[0], q[1], q[2], q[3]];
    q[0] = w * x + a * c + b * z - d * y;
    q[1] = w * y + b * c + d * x - a * z;
    q[2] = w * z + d * c + a * y - b * x;
    q[3] = w * c - a * x - b * y - d * z;
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.iter_mut().for_each(|x| *x /= length);
}

/// Where a body that turns by θ while it moves by `step`, both in its own axes, comes from its
/// origin: V(θ) step.
fn screw(angle: [f64; 3], step: [f64; 3]) -> [f64; 3] {
    let square = angle.iter().map(|x| x * x).sum::<f64>();
    // (1 − cos θ)/θ² and (θ − sin θ)/θ³
    let (a, b) = if square > 1e-6 {
        let size = square.sqrt();
        let (s, c) = Real::sin_cos(size);
        ((1.0 - c) / square, (size - s) / (square * size))
    } else {
        (0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0)
    };
    let once = cross(angle, step);
    let twice = cross(angle, once);
    [0, 1, 2].map(|k| step[k] + a * once[k] + b * twice[k])
}

/// The turn in the body from one orientation to another.
fn between(from: &[f64], to: &[f64]) -> [f64; 3] {
    let [a, b, c, w] = [-from[0], -from[1], -from[2], from[3]];
    let [x, y, z, s] = [to[0], to[1], to[2], to[3]];
    let axis = [
        w * x + a * s + b * z - c * y,
        w * y + b * s + c * x - a * z,
        w * z + c * s + a * y - b * x,
    ];
    let real = w * s - a * x - b * y - c * z;
    let size = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let sign = if real < 0.0 { -1.0 } else { 1.0 };
    let share = if size > 1e-12 { 2.0 * Real::atan2(size, real.abs()) / size } else { 2.0 };
    axis.map(|x| sign * share * x)
}

/// R(q) v.
pub(crate) fn turned<T: Real>(q: &[T], v: [T; 3]) -> [T; 3] {
    let axis = [q[0], q[1], q[2]];
    let inner = cross(axis, v);
    let twice = cross(axis, std::array::from_fn(|k| inner[k] + q[3] * v[k]));
    std::array::from_fn(|k| v[k] + twice[k] + twice[k])
}

/// a × b.
pub(crate) fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split_whitespace().map(str::to_owned).collect()
    }

    /// A slider, a floating joint, a ball, and a joint whose name only looks like a part of one.
    fn coordinates() -> Coordinates {
        let q = "slide base/x base/y base/z base/qx base/qy base/qz base/qw ball/qx ball/qy \
            ball/qz ball/qw a/x";
        let v = "slide base/rx base/ry base/rz base/tx base/ty base/tz ball/rx ball/ry ball/rz a/x";
        Coordinates::of(&names(q), &names(v))
    }

    fn pose() -> Vec<f64> {
        let mut q = vec![0.3, 1.0, -2.0, 0.5, 0.1, 0.7, -0.5, 0.5, -0.1, 0.2, 0.3, 0.9, 4.0];
        coordinates().normalise(&mut q);
        q
    }

    #[test]
    fn joints_are_told_apart_by_their_names() {
        let of = coordinates();
        assert_eq!((of.n_q, of.n_v), (13, 11));
        let singles: Vec<_> = (0..11).map(|v| of.coordinate(v)).collect();
        assert_eq!((singles[0], singles[10]), (Some(0), Some(12)));
        assert!(singles[1..10].iter().all(Option::is_none));
        assert_eq!(of.zero(), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn moving_for_a_short_time_is_the_rate_and_keeps_unit_length() {
        let of = coordinates();
        let q = pose();
        let v: Vec<f64> = (0..11).map(|k| 0.3 * f64::from(k) - 1.0).collect();
        let mut rate = vec![0.0; 13];
        of.rate(&q, &q, &v, &mut rate);
        let h = 1e-5;
        let [mut ahead, mut back] = [q.clone(), q.clone()];
        of.advance(&mut ahead, &v, h);
        of.advance(&mut back, &v, -h);
        for k in 0..13 {
            assert!(((ahead[k] - back[k]) / (2.0 * h) - rate[k]).abs() < 1e-9, "{k}");
        }
        assert!(of.off_unit(&ahead) < 1e-15);
    }

    #[test]
    fn two_moves_along_a_constant_velocity_are_one_twice_as_long() {
        // a screw goes on as it was
        let of = coordinates();
        let v: Vec<f64> = (0..11).map(|k| 0.7 * f64::from(k) - 2.0).collect();
        let [mut twice, mut once] = [pose(), pose()];
        of.advance(&mut twice, &v, 0.2);
        of.advance(&mut twice, &v, 0.2);
        of.advance(&mut once, &v, 0.4);
        assert!(twice.iter().zip(&once).all(|(a, b)| (a - b).abs() < 1e-14), "{twice:?} {once:?}");
    }

    #[test]
    fn the_difference_of_two_poses_leads_from_one_to_the_other() {
        let of = coordinates();
        let from = pose();
        let mut to = pose();
        let v: Vec<f64> = (0..11).map(|k| 1e-4 * (f64::from(k) - 5.0)).collect();
        of.advance(&mut to, &v, 1.0);
        let mut found = vec![0.0; 11];
        of.difference(&from, &to, &mut found);
        // of a position to first order
        assert!(found.iter().zip(&v).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        // q and −q are the same orientation
        to[8..12].iter_mut().for_each(|x| *x = -*x);
        of.difference(&from, &to, &mut found);
        assert!(found[7..10].iter().zip(&v[7..10]).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
