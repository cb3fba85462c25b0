//! Ten parameters of a body, its pseudo-inertia, and all bodies near it.
//!
//! J = [½ tr(I) 1 − I, h; hᵀ, m] is positive definite just for bodies of positive density [WKS18].
//! With J₀ = L Lᵀ of the model, J = L U Uᵀ Lᵀ, U an upper triangle with the exponentials of four
//! numbers on its diagonal and six numbers above it: U = 1 is the model, and |u|² the square of the
//! distance from it, in first order.

use nalgebra::{Matrix3, Matrix4, Vector3};
use sarrus_dynamics::description::{Inertial, Placement};

/// Places of the ten numbers in U: the diagonal first.
const PLACES: [[usize; 2]; 10] =
    [[0, 0], [1, 1], [2, 2], [3, 3], [0, 1], [0, 2], [1, 2], [0, 3], [1, 3], [2, 3]];

/// A body near that of the model.
#[derive(Clone, Debug)]
pub(crate) struct Near {
    /// L.
    factor: Matrix4<f64>,
}

impl Near {
    /// From m, h, Ixx, Ixy, Iyy, Ixz, Iyz, Izz; `None` where they are no body of positive density.
    pub(crate) fn new(parameters: &[f64]) -> Option<Near> {
        let J = pseudo_inertia(parameters)?;
        let mut factor = Matrix4::zeros();
        for i in 0..4 {
            for j in 0..=i {
                let sum: f64 = (0..j).map(|k| factor[(i, k)] * factor[(j, k)]).sum();
                let x = J[(i, j)] - sum;
                if i != j {
                    factor[(i, j)] = x / factor[(j, j)];
                } else if x > 1e-9 * J[(i, i)] && J[(i, i)] > 0.0 {
                    factor[(i, i)] = x.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(Near { factor })
    }

    /// The parameters at u, and their derivatives by each of its numbers.
    pub(crate) fn at(&self, u: &[f64]) -> ([f64; 10], [[f64; 10]; 10]) {
        let mut U = Matrix4::zeros();
        for ([i, j], u) in PLACES.into_iter().zip(u) {
            U[(i, j)] = if i == j { u.exp() } else { *u };
        }
        let LU = self.factor * U;
        let parameters = from_pseudo_inertia(&(LU * LU.transpose()));
        let by = PLACES.map(|[i, j]| {
            let mut E = Matrix4::zeros();
            E[(i, j)] = if i == j { U[(i, i)] } else { 1.0 };
            let half = self.factor * E * LU.transpose();
            from_pseudo_inertia(&(half + half.transpose()))
        });
        (parameters, by)
    }
}

fn pseudo_inertia(parameters: &[f64]) -> Option<Matrix4<f64>> {
    let &[m, hx, hy, hz, xx, xy, yy, xz, yz, zz] = parameters else { return None };
    let half = 0.5 * (xx + yy + zz);
    // symmetric: rows are columns
    Some(Matrix4::from([
        [half - xx, -xy, -xz, hx],
        [-xy, half - yy, -yz, hy],
        [-xz, -yz, half - zz, hz],
        [hx, hy, hz, m],
    ]))
}

fn from_pseudo_inertia(J: &Matrix4<f64>) -> [f64; 10] {
    let trace = J.m11 + J.m22 + J.m33;
    let [xx, yy, zz] = [J.m11, J.m22, J.m33].map(|x| trace - x);
    [J.m44, J.m14, J.m24, J.m34, xx, -J.m12, yy, -J.m13, -J.m23, zz]
}

/// The inertia of a point mass at c.
fn at_point(m: f64, c: Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose()) * m
}

fn rotation(of: &Placement) -> Matrix3<f64> {
    Matrix3::from(of.rotation()).transpose()
}

/// Ten parameters about the origin of the link.
pub(crate) fn parameters(inertial: &Inertial) -> [f64; 10] {
    let [xx, xy, xz, yy, yz, zz] = inertial.inertia;
    let R = rotation(&inertial.origin);
    let own = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let m = inertial.mass;
    let c = Vector3::from(inertial.origin.xyz);
    let I = R * own * R.transpose() + at_point(m, c);
    let h = c * m;
    [m, h.x, h.y, h.z, I.m11, I.m12, I.m22, I.m13, I.m23, I.m33]
}

/// The inertia as a file writes it, in axes of this roll, pitch and yaw.
pub(crate) fn inertial(parameters: &[f64; 10], rpy: [f64; 3]) -> Inertial {
    let [m, hx, hy, hz, xx, xy, yy, xz, yz, zz] = *parameters;
    let c = Vector3::new(hx, hy, hz) / m;
    let own = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - at_point(m, c);
    let mut inertial = Inertial::point(m, c.into());
    inertial.origin.rpy = rpy;
    let R = rotation(&inertial.origin);
    let I = R.transpose() * own * R;
    inertial.inertia = [I.m11, I.m12, I.m13, I.m22, I.m23, I.m33];
    inertial
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body() -> Inertial {
        let mut inertial = Inertial::point(2.0, [0.1, -0.2, 0.3]);
        inertial.origin.rpy = [0.3, -0.4, 1.1];
        inertial.inertia = [0.03, 0.001, -0.002, 0.04, 0.003, 0.05];
        inertial
    }

    #[test]
    fn parameters_and_what_a_file_writes_are_inverse_to_each_other() {
        let back = inertial(&parameters(&body()), body().origin.rpy);
        let numbers = |x: &Inertial| [&x.origin.xyz[..], &x.inertia[..], &[x.mass]].concat();
        for (a, b) in numbers(&back).into_iter().zip(numbers(&body())) {
            assert!((a - b).abs() < 1e-15, "{a} {b}");
        }
    }

    #[test]
    fn every_body_near_the_model_is_physical_and_has_its_derivatives() {
        let near = Near::new(&parameters(&body())).unwrap();
        let (at_zero, _) = near.at(&[0.0; 10]);
        for (a, b) in at_zero.into_iter().zip(parameters(&body())) {
            assert!((a - b).abs() < 1e-15);
        }
        let u = [0.3, -0.5, 0.2, 0.1, 0.4, -0.6, 0.7, -0.2, 0.9, 0.5];
        let (x, by) = near.at(&u);
        assert!(Near::new(&x).is_some());
        for k in 0..10 {
            let step = |h: f64| {
                let mut moved = u;
                moved[k] += h;
                near.at(&moved).0
            };
            let [ahead, back] = [step(1e-5), step(-1e-5)];
            for i in 0..10 {
                let slope = (ahead[i] - back[i]) / 2e-5;
                assert!((by[k][i] - slope).abs() < 1e-8, "{k} {i}: {} {slope}", by[k][i]);
            }
        }
        // a point mass has no density
        assert!(Near::new(&parameters(&Inertial::point(1.0, [0.1, 0.0, 0.0]))).is_none());
    }
}
