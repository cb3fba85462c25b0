//! Curves of couplings: powers of the coordinate, and for a table besides the fifth powers of its
//! distances from the points.

use sarrus_dynamics::description::Curve;
use sarrus_dynamics::scalar::{Dd, Real};

use crate::pairs::algebra::{Matrix, eliminate};

/// f(q) = Σ p_k x^k + Σ c_i |x − x_i|⁵ with x = (q − about) / unit.
pub(super) struct Bend {
    about: f64,
    unit: f64,
    powers: Vec<Dd>,
    points: Vec<(Dd, Dd)>,
}

impl Bend {
    /// Of a polynomial, or of the natural spline through a table: Σ c_i q_i^k = 0 for k < 3.
    pub(super) fn new(curve: &Curve) -> Bend {
        let table = match curve {
            Curve::Polynomial { about, coefficients } => {
                let powers = coefficients.iter().map(|c| Dd::from(*c)).collect();
                return Bend { about: *about, unit: 1.0, powers, points: Vec::new() };
            }
            Curve::Table(points) => points,
        };
        let n = table.len();
        let about = table[0][0];
        let unit = table[n - 1][0] - about;
        let place = |q: f64| (Dd::from(q) - Dd::from(about)) / Dd::from(unit);
        let mut A = Matrix::new(n + 3, n + 3);
        let mut b = Matrix::new(n + 3, 1);
        for (j, [x, y]) in table.iter().enumerate() {
            *b.at(j, 0) = Dd::from(*y);
            for (i, [knot, _]) in table.iter().enumerate() {
                *A.at(j, i) = power((place(*x) - place(*knot)).abs(), 5);
            }
            for k in 0..3 {
                let entry = power(place(*x), k);
                (*A.at(j, n + k), *A.at(n + k, j)) = (entry, entry);
            }
        }
        let (x, pivot) = eliminate(A, b);
        assert!(pivot > 0.0);
        let points = table.iter().enumerate().map(|(i, of)| (place(of[0]), x.get(i, 0))).collect();
        Bend { about, unit, powers: (0..3).map(|k| x.get(n + k, 0)).collect(), points }
    }

    /// f, f', f''.
    pub(super) fn at<T: Real>(&self, q: T) -> [T; 3] {
        let number =
            |x: &Dd| T::from_f64(x.to_f64()) + T::from_f64((*x - Dd::from(x.to_f64())).to_f64());
        let at = (q - T::from_f64(self.about)) / T::from_f64(self.unit);
        let mut f = [T::ZERO; 3];
        let mut add = |c: T, x: T, degree: usize, sense: T| {
            for (k, f) in f.iter_mut().enumerate().take(degree + 1) {
                let falling = (0..k).map(|i| (degree - i) as f64).product::<f64>();
                let sign = if k == 1 { sense } else { T::ONE };
                *f += c * T::from_f64(falling) * sign * power(x, degree - k);
            }
        };
        for (k, c) in self.powers.iter().enumerate() {
            add(number(c), at, k, T::ONE);
        }
        for (knot, c) in &self.points {
            let x = at - number(knot);
            let sense = T::select_lt(x, T::ZERO, -T::ONE, T::ONE);
            add(number(c), x.abs(), 5, sense);
        }
        let one = T::ONE / T::from_f64(self.unit);
        [f[0], f[1] * one, f[2] * one * one]
    }
}

fn power<T: Real>(x: T, k: usize) -> T {
    (0..k).fold(T::ONE, |y, _| y * x)
}
