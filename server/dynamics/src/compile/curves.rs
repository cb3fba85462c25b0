//! Curves of couplings as pieces of degree 5.

use crate::description::Curve;
use crate::mechanism::values;
use crate::scalar::{Dd, Real};

/// Most points of a table: a state looks at each.
const MOST_POINTS: usize = 256;
/// Largest distance of neighbours, and least one as a part of the largest, at which the spline
/// keeps the digits of doubles.
const STEPS: [f64; 2] = [1e9, 1e-5];

/// f and its first three derivatives at x.
pub(crate) fn curve_at(curve: &Curve, x: f64) -> [f64; 4] {
    values(&pieces(curve), x)
}

/// How far the curve of a table is from its points at most, and the size of its second derivative
/// there.
pub fn table_fit(curve: &Curve) -> Option<[f64; 2]> {
    let Curve::Table(points) = curve else { return None };
    let pieces = pieces(curve);
    Some(points.iter().enumerate().fold([0.0, 0.0], |[off, bend], (k, [x, y])| {
        // by the piece that ends there
        let [f, _, second, _] = values(&pieces[..=k], *x);
        [f64::max(off, (f - y).abs()), f64::max(bend, second.abs())]
    }))
}

/// Numbers that a curve must have and has not.
pub fn curve_fault(curve: &Curve) -> Option<&'static str> {
    let rises = |points: &[[f64; 2]]| {
        let steps = || points.windows(2).map(|pair| pair[1][0] - pair[0][0]);
        let most = steps().fold(0.0, f64::max);
        most > 0.0 && most <= STEPS[0] && steps().all(|step| step >= STEPS[1] * most)
    };
    match curve {
        Curve::Polynomial { coefficients, .. } if !(1..=6).contains(&coefficients.len()) => {
            Some("a polynomial of 1 to 6 coefficients")
        }
        Curve::Table(points) if !(3..=MOST_POINTS).contains(&points.len()) || !rises(points) => {
            Some("a table of 3 to 256 points q f with rising q, no step below 1e-5 of the largest")
        }
        _ => {
            let pieces = pieces(curve);
            let at_zero = values(&pieces, 0.0);
            let mut numbers = pieces.as_flattened().iter().chain(&at_zero);
            let is_finite = numbers.all(|x| x.is_finite());
            (!is_finite).then_some("finite numbers, also of the curve at zero")
        }
    }
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
    let beyond = |at: usize| {
        let [x, y] = points[at];
        let [slope, bend] = slopes[at].map(Dd::to_f64);
        [x, y, slope, 0.5 * bend, 0.0, 0.0, 0.0]
    };
    let mut pieces = vec![beyond(0)];
    for (pair, slopes) in points.windows(2).zip(slopes.windows(2)) {
        let [[x, y0], [end, y1]] = [pair[0], pair[1]].map(|of| of.map(Dd::from));
        let c = hermite(end - x, [y0, y1], [slopes[0], slopes[1]]).map(Dd::to_f64);
        pieces.push([pair[0][0], c[0], c[1], c[2], c[3], c[4], c[5]]);
    }
    pieces.push(beyond(points.len() - 1));
    pieces
}

/// The coefficients of degree 0 to 5 between two points at 0 and h, from their values and first two
/// derivatives.
fn hermite(h: Dd, [y0, y1]: [Dd; 2], [s0, s1]: [[Dd; 2]; 2]) -> [Dd; 6] {
    let half = Dd::from(0.5) * h * h;
    let [a1, a2] = [h * s0[0], half * s0[1]];
    let d = y1 - y0 - a1 - a2;
    let e = h * s1[0] - a1 - a2 - a2;
    let f = half * s1[1] - a2;
    let of = |x: [f64; 3]| Dd::from(x[0]) * d + Dd::from(x[1]) * e + Dd::from(x[2]) * f;
    let mut power = Dd::ONE / h;
    [y0, a1, a2, of([10.0, -4.0, 1.0]), of([-15.0, 7.0, -2.0]), of([6.0, -3.0, 1.0])].map(|c| {
        power *= h;
        c / power
    })
}

/// First and second derivative at each point, such that third and fourth do not jump and are zero
/// at both ends; a band of equations, in double-double as points may be close.
fn slopes(points: &[[f64; 2]]) -> Vec<[Dd; 2]> {
    let n = 2 * points.len();
    let mut rows = vec![vec![Dd::ZERO; n + 1]; n];
    for (k, pair) in points.windows(2).enumerate() {
        let [[x, y0], [end, y1]] = [pair[0], pair[1]].map(|of| of.map(Dd::from));
        let h = end - x;
        // both derivatives at both ends of the piece by each unknown, and without any
        for i in 0..5 {
            let unit = |j: usize| if i == j { Dd::ONE } else { Dd::ZERO };
            let y = if i == 4 { [y0, y1] } else { [Dd::ZERO; 2] };
            let c = hermite(h, y, [[unit(0), unit(1)], [unit(2), unit(3)]]);
            let column = if i == 4 { n } else { 2 * k + i };
            let [c3, c4, c5] =
                [(6.0, c[3]), (24.0, c[4]), (60.0, c[5])].map(|(a, c)| Dd::from(a) * c);
            rows[2 * k][column] += c3;
            rows[2 * k + 1][column] += c4;
            rows[2 * k + 2][column] -= c3 + (c4 + c5 * h) * h;
            rows[2 * k + 3][column] -= c4 + (c5 + c5) * h;
        }
    }
    for k in 0..n {
        let last = n.min(k + 4);
        let size = |i: &usize| rows[*i][k].abs().to_f64();
        let pivot = (k..last).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(k);
        rows.swap(k, pivot);
        let (done, rest) = rows.split_at_mut(k + 1);
        for row in &mut rest[..last - k - 1] {
            let l = row[k] / done[k][k];
            (k..n.min(k + 7)).chain([n]).for_each(|j| row[j] -= l * done[k][j]);
        }
    }
    let mut found = vec![[Dd::ZERO; 2]; points.len()];
    for k in (0..n).rev() {
        let known = (k + 1..n.min(k + 7)).map(|j| rows[k][j] * found[j / 2][j % 2]);
        found[k / 2][k % 2] = -known.fold(rows[k][n], |sum, x| sum + x) / rows[k][k];
    }
    found
}

#[cfg(test)]
mod tests;
