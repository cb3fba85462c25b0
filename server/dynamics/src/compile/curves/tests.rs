use super::*;

/// f and its first four derivatives at x by piece k.
fn by_piece(pieces: &[[f64; 7]], k: usize, x: f64) -> [f64; 5] {
    let [start, c @ ..] = pieces[k];
    std::array::from_fn(|n| {
        let term = |(k, c): (usize, &f64)| {
            let falling: f64 = (0..n).map(|i| k as f64 - i as f64).product();
            if k < n { 0.0 } else { c * falling * (x - start).powi((k - n) as i32) }
        };
        c.iter().enumerate().map(term).sum()
    })
}

#[test]
fn a_table_gives_the_natural_spline_of_degree_5() {
    let at = [-0.7, -0.4, 0.0, 0.15, 0.5, 1.1];
    let points: Vec<[f64; 2]> = at.iter().map(|x| [*x, f64::sin(3.0 * x)]).collect();
    let curve = Curve::Table(points.clone());
    let pieces = pieces(&curve);
    assert_eq!(pieces.len(), points.len() + 1);
    for (k, [x, y]) in points.iter().enumerate() {
        assert!((curve_at(&curve, *x)[0] - y).abs() < 1e-15, "{x}");
        let [before, after] = [k, k + 1].map(|piece| by_piece(&pieces, piece, *x));
        for (n, (a, b)) in before.iter().zip(after).enumerate() {
            // the fourth derivative is of size 81
            assert!((a - b).abs() < 1e-9, "derivative {n} at {x}: {a} {b}");
        }
    }
    // beyond the ends it is a parabola
    for x in [-2.0, 3.0] {
        assert_eq!(curve_at(&curve, x)[3], 0.0);
    }
}

#[test]
fn a_table_of_a_parabola_is_that_parabola_and_values_are_derivatives() {
    let parabola = |x: f64| 3.0 * x * x - x + 1.0;
    let points = [-1.0, -0.2, 0.1, 0.9].map(|x| [x, parabola(x)]);
    let curve = Curve::Table(points.to_vec());
    for x in [-3.0, -0.5, 0.0, 0.4, 2.0] {
        let found = curve_at(&curve, x);
        let wanted = [parabola(x), 6.0 * x - 1.0, 6.0, 0.0];
        let off = found.iter().zip(wanted).fold(0.0, |off: f64, (a, b)| off.max((a - b).abs()));
        assert!(off < 1e-11, "{x}: {found:?}");
    }
    let curve = Curve::Polynomial { about: 0.5, coefficients: vec![1.0, -2.0, 3.0, 4.0, 5.0, 6.0] };
    let x: f64 = 0.25;
    let sum = |c: [f64; 6]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let wanted = [
        sum([1.0, -2.0, 3.0, 4.0, 5.0, 6.0]),
        sum([-2.0, 6.0, 12.0, 20.0, 30.0, 0.0]),
        sum([6.0, 24.0, 60.0, 120.0, 0.0, 0.0]),
        sum([24.0, 120.0, 360.0, 0.0, 0.0, 0.0]),
    ];
    assert_eq!(curve_at(&curve, 0.75), wanted);
}

#[test]
fn numbers_that_make_no_curve_are_told() {
    let polynomial = |coefficients: &[f64]| Curve::Polynomial {
        about: 0.0,
        coefficients: coefficients.to_vec(),
    };
    let table = |points: &[[f64; 2]]| Curve::Table(points.to_vec());
    let sound = [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]];
    assert_eq!(curve_fault(&table(&sound)), None);
    assert_eq!(curve_fault(&polynomial(&[0.0; 6])), None);
    for curve in [
        polynomial(&[]),
        polynomial(&[0.0; 7]),
        polynomial(&[f64::NAN]),
        table(&sound[..2]),
        table(&[[0.0, 0.0], [0.0, 1.0], [2.0, 0.0]]),
        table(&[[0.0, 0.0], [f64::NAN, 1.0], [2.0, 0.0]]),
        table(&[[0.0, 0.0], [1.0, f64::INFINITY], [2.0, 0.0]]),
        table(&[[0.0, 0.0], [1e-300, 1.0], [2.0, 0.0]]),
        table(&[[0.0, 0.0], [1e100, 1.0], [2e100, 0.0]]),
        table(&[[0.0, 0.0], [1e-6, 1.0], [2.0, 0.0]]),
        table(&vec![[0.0; 2]; MOST_POINTS + 1]),
        Curve::Polynomial { about: 1e300, coefficients: vec![0.0, 1.0, 1.0] },
    ] {
        assert!(curve_fault(&curve).is_some(), "{curve:?}");
    }
}

#[test]
fn points_that_are_close_cost_no_digits() {
    // of the sine at -1, 0, h and 1; by fractions
    for (h, exact) in [(1e-3, 0.474_418_208_561_987_74), (1.1e-5, 0.474_404_323_823_096_4)] {
        let sine = |x: f64| [x, f64::sin(x)];
        let curve = Curve::Table([-1.0, 0.0, h, 1.0].map(sine).to_vec());
        let found = curve_at(&curve, 0.5)[0];
        assert!((found - exact).abs() < 1e-14, "{h}: {found}");
        let pieces = pieces(&curve);
        for (k, x) in [-1.0, 0.0, h, 1.0].into_iter().enumerate() {
            let [before, after] = [k, k + 1].map(|piece| by_piece(&pieces, piece, x));
            for n in 0..3 {
                assert!((before[n] - after[n]).abs() < 1e-12, "{h}, {x}: {before:?} {after:?}");
            }
        }
        let [off, bend] = table_fit(&curve).unwrap();
        assert!(off < 1e-15 && bend < 1.0, "{h}: {off:e} {bend}");
    }
}
