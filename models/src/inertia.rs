//! Checks whether a mass and an inertia can belong to a body.

/// An eigenvalue may lie this far below zero, relative to the largest: rounding of a file.
const NEGATIVE: f64 = 1e-9;
/// The triangle inequality may be violated by this much, relative to the largest: plates meet it
/// with equality, and files are rounded.
const TRIANGLE: f64 = 1e-6;

/// The reason why no body has this inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum InertiaFault {
    /// The least principal moment is negative.
    Negative { least: f64 },
    /// The largest principal moment exceeds the sum of the others.
    Triangle { moments: [f64; 3] },
}

/// Checks ixx, ixy, ixz, iyy, iyz, izz about the centre of mass.
pub(crate) fn check(inertia: &[f64; 6]) -> Result<(), InertiaFault> {
    let moments = principal_moments(inertia);
    let [least, middle, largest] = moments;
    let size = largest.abs().max(least.abs());
    if least < -NEGATIVE * size {
        return Err(InertiaFault::Negative { least });
    }
    if largest - (least + middle) > TRIANGLE * size {
        return Err(InertiaFault::Triangle { moments });
    }
    Ok(())
}

/// Eigenvalues in ascending order.
pub(crate) fn principal_moments(inertia: &[f64; 6]) -> [f64; 3] {
    let mut moments = principal(inertia).0;
    moments.sort_by(f64::total_cmp);
    moments
}

/// Eigenvalues and their directions, by cyclic Jacobi rotations: unlike the cubic's closed form
/// accurate to rounding. A diagonal inertia keeps its axes.
pub(crate) fn principal(inertia: &[f64; 6]) -> ([f64; 3], [[f64; 3]; 3]) {
    let [xx, xy, xz, yy, yz, zz] = *inertia;
    let mut a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..30 {
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            if a[p][q] == 0.0 {
                continue;
            }
            // the rotation by the angle with tangent t makes a[p][q] vanish
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            let rp = a[r][p];
            let rq = a[r][q];
            a[p][p] -= t * a[p][q];
            a[q][q] += t * a[p][q];
            (a[r][p], a[r][q]) = (c * rp - s * rq, s * rp + c * rq);
            (a[p][r], a[q][r]) = (a[r][p], a[r][q]);
            (a[p][q], a[q][p]) = (0.0, 0.0);
            for k in 0..3 {
                (axes[p][k], axes[q][k]) =
                    (c * axes[p][k] - s * axes[q][k], s * axes[p][k] + c * axes[q][k]);
            }
        }
    }
    ([a[0][0], a[1][1], a[2][2]], axes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_moments_are_those_of_the_rotated_box() {
        // diag(1, 2, 4) turned by an orthogonal matrix of thirds: columns (2,2,1)/3, (-2,1,2)/3,
        // (1,-2,2)/3
        let axes = [[2.0, 2.0, 1.0], [-2.0, 1.0, 2.0], [1.0, -2.0, 2.0]];
        let entry = |i: usize, j: usize| {
            (0..3).map(|k| [1.0, 2.0, 4.0][k] * axes[k][i] * axes[k][j] / 9.0).sum::<f64>()
        };
        let moments = principal_moments(&[
            entry(0, 0),
            entry(0, 1),
            entry(0, 2),
            entry(1, 1),
            entry(1, 2),
            entry(2, 2),
        ]);
        for (moment, exact) in moments.iter().zip([1.0, 2.0, 4.0]) {
            assert!((moment - exact).abs() < 1e-14, "{moments:?}");
        }
    }

    #[test]
    fn a_plate_and_a_rod_lie_on_the_bounds_and_pass() {
        assert_eq!(check(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.0]), Ok(()));
        assert_eq!(check(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.000001]), Ok(()));
        assert_eq!(check(&[0.0, 0.0, 0.0, 1.0, 0.0, 1.0]), Ok(()));
        assert_eq!(check(&[-0.9e-9, 0.0, 0.0, 1.0, 0.0, 1.0]), Ok(()));
        assert_eq!(check(&[0.0; 6]), Ok(()));
    }

    #[test]
    fn what_no_body_has_is_reported_with_its_moments() {
        assert_eq!(
            check(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.1]),
            Err(InertiaFault::Triangle { moments: [1.0, 1.0, 2.1] })
        );
        assert_eq!(
            check(&[-1e-3, 0.0, 0.0, 1.0, 0.0, 1.0]),
            Err(InertiaFault::Negative { least: -1e-3 })
        );
        assert!(matches!(
            check(&[1.0, 3.0, 0.0, 1.0, 0.0, 1.0]),
            Err(InertiaFault::Negative { .. })
        ));
    }
}
