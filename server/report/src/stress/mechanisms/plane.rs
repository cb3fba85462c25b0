//! Points in the plane.

pub(crate) type Point = [f64; 2];

pub(crate) fn distance(a: Point, b: Point) -> f64 {
    f64::hypot(b[0] - a[0], b[1] - a[1])
}

/// The point at a distance from another one.
pub(crate) fn along(from: Point, heading: f64, length: f64) -> Point {
    [from[0] + length * heading.cos(), from[1] + length * heading.sin()]
}

/// A point turned about a pivot.
pub(crate) fn about(pivot: Point, p: Point, turn: f64) -> Point {
    let (s, c) = turn.sin_cos();
    let [x, y] = [p[0] - pivot[0], p[1] - pivot[1]];
    [pivot[0] + c * x - s * y, pivot[1] + s * x + c * y]
}

/// Positive where c lies to the left of the way from a to b.
pub(crate) fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
}

/// Both intersections of two circles, the first to the left of the way between their centres;
/// none where the square of half their distance is below `least`.
pub(crate) fn intersections(
    (a, of_a): (Point, f64),
    (c, of_c): (Point, f64),
    least: f64,
) -> Option<[Point; 2]> {
    let d = distance(a, c);
    let x = (d * d + of_a * of_a - of_c * of_c) / (2.0 * d);
    let square = of_a * of_a - x * x;
    if square < least {
        return None;
    }
    let h = square.max(0.0).sqrt();
    let [ux, uy] = [0, 1].map(|k| (c[k] - a[k]) / d);
    Some([h, -h].map(|h| [a[0] + x * ux - h * uy, a[1] + x * uy + h * ux]))
}
