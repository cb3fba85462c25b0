//! Curves of couplings as pieces of degree 5.

use nalgebra::{Matrix2, Matrix2x4, Vector2, Vector6};

use crate::description::Curve;
use crate::mechanism::values;

/// Most points of a table: a state looks at each.
const MOST_POINTS: usize = 256;

/// f and its first three derivatives at x; not finite where points of a table are too close.
pub(crate) fn curve_at(curve: &Curve, x: f64) -> [f64; 4] {
    values(&pieces(curve), x)
}

/// How far the curve of a table is from its points at most, and the size of its second derivative
/// there.
pub fn table_fit(curve: &Curve) -> Option<[f64; 2]> {
    let Curve::Table(points) = curve else { return None };
    let pieces = pieces(curve);
    Some(points.iter().fold([0.0, 0.0], |[off, bend], [x, y]| {
        let [f, _, second, _] = values(&pieces, *x);
        [f64::max(off, (f - y).abs()), f64::max(bend, second.abs())]
    }))
}

/// Numbers that a curve must have and has not.
pub fn curve_fault(curve: &Curve) -> Option<&'static str> {
    let rises = |points: &[[f64; 2]]| points.windows(2).all(|pair| pair[0][0] < pair[1][0]);
    let expected = match curve {
        Curve::Polynomial { coefficients, .. } if !(1..=6).contains(&coefficients.len()) => {
            "a polynomial of 1 to 6 coefficients"
        }
        Curve::Table(points) if !(3..=MOST_POINTS).contains(&points.len()) || !rises(points) => {
            "a table of 3 to 256 points q f with rising q, or a polynomial"
        }
        _ if pieces(curve).as_flattened().iter().all(|x| x.is_finite()) => return None,
        _ => "finite numbers, and points that are not too close",
    };
    Some(expected)
}

/// x₀ and the coefficients of powers of x − x₀ of each piece. The curve through a table has four
/// derivatives that do not jump, and the least square of the third one [Schoenberg: the natural
/// spline of degree 5]; it goes on by the second derivatives at its ends.
pub(crate) fn pieces(curve: &Curve) -> Vec<[f64; 7]> {
    let points = match curve {
        Curve::Polynomial { about, coefficients } => {
            let mut piece = [0.0; 7];
            piece[0] = *about;
            piece[1..].iter_mut().zip(coefficients).for_each(|(to, c)| *to = *c);
            return vec![piece];
        }
        Curve::Table(points) => points,
    };
    let slopes = slopes(points);
    let piece = |x: f64, c: [f64; 6]| [x, c[0], c[1], c[2], c[3], c[4], c[5]];
    let beyond = |at: usize| {
        let [x, y] = points[at];
        piece(x, [y, slopes[at][0], 0.5 * slopes[at][1], 0.0, 0.0, 0.0])
    };
    let mut pieces = vec![beyond(0)];
    for (pair, slopes) in points.windows(2).zip(slopes.windows(2)) {
        let h = pair[1][0] - pair[0][0];
        let c = hermite(h, [pair[0][1], pair[1][1]], [slopes[0], slopes[1]]);
        pieces.push(piece(pair[0][0], c.into()));
    }
    pieces.push(beyond(points.len() - 1));
    pieces
}

/// The coefficients of degree 0 to 5 between two points at 0 and h, from their values and first two
/// derivatives.
fn hermite(h: f64, [y0, y1]: [f64; 2], [s0, s1]: [Vector2<f64>; 2]) -> Vector6<f64> {
    let [a1, a2] = [h * s0[0], 0.5 * h * h * s0[1]];
    let d = y1 - y0 - a1 - a2;
    let e = h * s1[0] - a1 - 2.0 * a2;
    let f = 0.5 * h * h * s1[1] - a2;
    let c =
        [y0, a1, a2, 10.0 * d - 4.0 * e + f, -15.0 * d + 7.0 * e - 2.0 * f, 6.0 * d - 3.0 * e + f];
    Vector6::from_fn(|k, _| c[k] / h.powi(k as i32))
}

/// Third and fourth derivative at both ends.
fn ends(h: f64, c: &Vector6<f64>) -> [Vector2<f64>; 2] {
    let at = |x: f64| {
        let third = 6.0 * c[3] + 24.0 * c[4] * x + 60.0 * c[5] * x * x;
        Vector2::new(third, 24.0 * c[4] + 120.0 * c[5] * x)
    };
    [at(0.0), at(h)]
}

/// First and second derivative at each point, such that third and fourth do not jump and are zero
/// at both ends: a block tridiagonal system.
fn slopes(points: &[[f64; 2]]) -> Vec<Vector2<f64>> {
    let n = points.len();
    // [to the point before | own] and [own | to the point after], and right-hand sides
    let mut own = vec![Matrix2::zeros(); n];
    let mut after = vec![Matrix2::zeros(); n];
    let mut before = vec![Matrix2::zeros(); n];
    let mut rest = vec![Vector2::zeros(); n];
    for (k, pair) in points.windows(2).enumerate() {
        let h = pair[1][0] - pair[0][0];
        let none = [Vector2::zeros(); 2];
        let [start, end] = ends(h, &hermite(h, [pair[0][1], pair[1][1]], none));
        rest[k] -= start;
        rest[k + 1] += end;
        let mut first: Matrix2x4<f64> = Matrix2x4::zeros();
        let mut last: Matrix2x4<f64> = Matrix2x4::zeros();
        for i in 0..4 {
            let mut unit = none;
            unit[i / 2][i % 2] = 1.0;
            let [start, end] = ends(h, &hermite(h, [0.0; 2], unit));
            first.set_column(i, &start);
            last.set_column(i, &end);
        }
        own[k] += first.fixed_columns::<2>(0);
        after[k] += first.fixed_columns::<2>(2);
        before[k + 1] -= last.fixed_columns::<2>(0);
        own[k + 1] -= last.fixed_columns::<2>(2);
    }
    for k in 1..n {
        let factor = before[k] * own[k - 1].try_inverse().unwrap_or_default();
        own[k] -= factor * after[k - 1];
        let less = factor * rest[k - 1];
        rest[k] -= less;
    }
    for k in (0..n).rev() {
        let next = if k + 1 < n { after[k] * rest[k + 1] } else { Vector2::zeros() };
        rest[k] = own[k].try_inverse().unwrap_or_default() * (rest[k] - next);
    }
    rest
}

#[cfg(test)]
mod tests;
