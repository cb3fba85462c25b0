//! Sine, cosine and arc tangent in double-double.

use crate::scalar::double_double::{Dd, two_product, two_sum};
use crate::scalar::{Real, elementary};

/// π/2 in five doubles.
const HALF_PI: [f64; 5] = [
    core::f64::consts::FRAC_PI_2,
    6.123233995736766e-17,
    -1.4973849048591698e-33,
    5.562271104316826e-50,
    2.836115989820158e-66,
];

/// 1/k! for k = 2, 3, … 28, as hi and lo.
const INVERSE_FACTORIAL: [(f64, f64); 27] = [
    (0.5, 0.0),
    (0.16666666666666666, 9.25185853854297e-18),
    (0.041666666666666664, 2.3129646346357427e-18),
    (0.008333333333333333, 1.1564823173178714e-19),
    (0.001388888888888889, -5.300543954373577e-20),
    (0.0001984126984126984, 1.7209558293420705e-22),
    (2.48015873015873e-05, 2.1511947866775882e-23),
    (2.7557319223985893e-06, -1.858393274046472e-22),
    (2.755731922398589e-07, 2.3767714622250297e-23),
    (2.505210838544172e-08, -1.448814070935912e-24),
    (2.08767569878681e-09, -1.20734505911326e-25),
    (1.6059043836821613e-10, 1.2585294588752098e-26),
    (1.1470745597729725e-11, 2.0655512752830745e-28),
    (7.647163731819816e-13, 7.03872877733453e-30),
    (4.779477332387385e-14, 4.399205485834081e-31),
    (2.8114572543455206e-15, 1.6508842730861433e-31),
    (1.5619206968586225e-16, 1.1910679660273754e-32),
    (8.22063524662433e-18, 2.2141894119604265e-34),
    (4.110317623312165e-19, 1.4412973378659527e-36),
    (1.9572941063391263e-20, -1.3643503830087908e-36),
    (8.896791392450574e-22, -7.911402614872376e-38),
    (3.868170170630684e-23, -8.843177655482344e-40),
    (1.6117375710961184e-24, -3.6846573564509766e-41),
    (6.446950284384474e-26, -1.9330404233703465e-42),
    (2.4795962632247976e-27, -1.2953730964765229e-43),
    (9.183689863795546e-29, 1.4303150396787322e-45),
    (3.279889237069838e-30, 1.5117542744029879e-46),
];

/// 1/k!, k ≥ 2.
fn inverse_factorial(k: usize) -> Dd {
    let (hi, lo) = INVERSE_FACTORIAL[k - 2];
    Dd { hi, lo }
}

/// x − n π/2 and n mod 4, n the integer nearest to x / (π/2).
///
/// The parts are summed exactly enough that even next to a multiple of π/2 all bits of the
/// remainder count: error-free vector transformations \[ORO05\], SumK with K = 5.
fn reduce(x: Dd) -> (Dd, i64) {
    let n = (x.hi * core::f64::consts::FRAC_2_PI).round_ties_even();

    let mut terms = [0.0; 12];
    (terms[0], terms[1]) = (x.hi, x.lo);
    for i in 0..5 {
        (terms[2 * i + 2], terms[2 * i + 3]) = two_product(-n, HALF_PI[i]);
    }

    for _ in 0..4 {
        for i in (1..terms.len()).rev() {
            (terms[i - 1], terms[i]) = two_sum(terms[i - 1], terms[i]);
        }
    }
    let (hi, lo) = two_sum(terms[0], terms[1..].iter().sum());
    (Dd { hi, lo }, n.rem_euclid(4.0) as i64)
}

/// (sin x, cos x) to about 2⁻¹⁰⁴; NaN from 2⁴⁵ on, as in the `f64` kernel.
pub(super) fn sin_cos(x: Dd) -> (Dd, Dd) {
    let x = if x.hi.abs() < elementary::RANGE { x } else { Dd::from(f64::NAN) };
    let (r, quadrant) = reduce(x);

    // the Taylor series of (sin r − r) / r³ and (cos r − 1 + r²/2) / r⁴ in −z = −r², |r| ≤ π/4
    let z = r * r;
    let mut s = inverse_factorial(27);
    let mut c = inverse_factorial(28);
    for k in (3..26).rev().step_by(2) {
        s = inverse_factorial(k) - z * s;
        c = inverse_factorial(k + 1) - z * c;
    }
    let sin = if r.hi == 0.0 { x } else { r - r * z * s };
    let cos = Dd::ONE + (z * z * c - z * 0.5);

    match quadrant {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The angle of the point (x, y): the double angle θ and one Newton step, tan(true − θ) = (y cos θ
/// − x sin θ) / (x cos θ + y sin θ), whose arc tangent is itself to three times the digits.
pub(super) fn atan2(y: Dd, x: Dd) -> Dd {
    // signed zeros and infinities: the point of the unit square in the same direction
    let unit = |v: Dd| Dd::from(if v.hi.is_infinite() { 1.0_f64 } else { 0.0 }.copysign(v.hi));
    let (y, x) = match (y.hi, x.hi) {
        (b, a) if b.is_nan() || a.is_nan() => return Dd::from(f64::NAN),
        (b, a) if b.is_infinite() || a.is_infinite() => (unit(y), unit(x)),
        (0.0, 0.0) => (y, Dd::from(1.0_f64.copysign(x.hi))),
        _ => (y, x),
    };

    let theta = elementary::atan2(y.hi, x.hi);
    if theta == 0.0 {
        return Dd::from(theta);
    }

    // away from overflow and from the underflow of trailing parts
    let scale = match y.hi.abs().max(x.hi.abs()) {
        size if size > 1e300 => 2.0_f64.powi(-10),
        size if size < 1e-200 => 2.0_f64.powi(600),
        _ => 1.0,
    };
    let y = y * scale;
    let x = x * scale;
    let (s, c) = sin_cos(Dd::from(theta));
    Dd::from(theta) + (y * c - x * s) / (x * c + y * s)
}

#[cfg(test)]
mod tests {
    use super::super::for_tests::{Random, angles, relative, sines};
    use super::*;

    const SEED: u64 = 20_250_119;
    const EPSILON: f64 = Dd::EPSILON;
    const PI: Dd = Dd { hi: 2.0 * HALF_PI[0], lo: 2.0 * HALF_PI[1] };

    #[test]
    fn sine_and_cosine_agree_with_the_table() {
        for [x, sh, sl, ch, cl] in sines() {
            let (s, c) = sin_cos(Dd::from(x));
            let es = relative(s, Dd { hi: sh, lo: sl });
            let ec = relative(c, Dd { hi: ch, lo: cl });
            assert!(es <= 2.0 * EPSILON && ec <= 2.0 * EPSILON, "x = {x:e}: {es:e} and {ec:e}");
        }
    }

    #[test]
    fn arc_tangent_agrees_with_the_table() {
        for [y, x, hi, lo] in angles() {
            // below 1e-270 the trailing parts underflow
            let bound = if hi != 0.0 && hi.abs() < 1e-270 || y.abs() < 1e-270 {
                1e-15
            } else {
                4.0 * EPSILON
            };
            let error = relative(atan2(Dd::from(y), Dd::from(x)), Dd { hi, lo });
            assert!(error <= bound, "atan2({y:e}, {x:e}): {error:e}");
        }
    }

    #[test]
    fn angles_and_their_functions_undo_each_other() {
        let mut random = Random(SEED);
        let mut worst = [0.0_f64; 3];
        for _ in 0..20_000 {
            let x = random.unit_dd() * PI;
            let (s, c) = x.sin_cos();
            let (s2, c2) = (x + x).sin_cos();
            worst[0] = worst[0].max((s * s + c * c - Dd::ONE).hi.abs());
            worst[1] = worst[1].max(relative(s.atan2(c), x));
            worst[2] =
                worst[2].max((s2 - s * c * 2.0).hi.abs().max((c2 - (c * c - s * s)).hi.abs()));
        }
        println!("seed {SEED}, largest errors in 2⁻¹⁰⁴: {:?}", worst.map(|e| e / EPSILON));
        assert!(worst.iter().all(|&e| e <= 4.0 * EPSILON));
    }

    #[test]
    fn the_remainder_next_to_multiples_of_half_pi_keeps_all_bits() {
        // the sine of the double-double nearest to π is the part of π beyond it
        let (s, c) = sin_cos(PI);
        assert!(relative(s, Dd { hi: 2.0 * HALF_PI[2], lo: 2.0 * HALF_PI[3] }) <= EPSILON);
        assert_eq!(c.hi, -1.0);
        assert_eq!(sin_cos(-PI), (-s, c));
    }

    #[test]
    fn special_values_are_those_of_ieee_754() {
        let values = [0.0, 1.0, f64::INFINITY, f64::NAN].map(|v: f64| [v, -v]);
        for (&y, &x) in
            values.iter().flatten().flat_map(|y| values.iter().flatten().map(move |x| (y, x)))
        {
            let own = atan2(Dd::from(y), Dd::from(x));
            let std = f64::atan2(y, x);
            assert!(
                own.hi.to_bits() == std.to_bits() || (own.hi.is_nan() && std.is_nan()),
                "atan2({y}, {x}) = {own:?}, not {std}"
            );
        }
        assert!(
            sin_cos(Dd::from(f64::NAN)).0.hi.is_nan()
                && sin_cos(Dd::from(f64::INFINITY)).1.hi.is_nan()
        );
        assert!(sin_cos(Dd::from(elementary::RANGE)).0.hi.is_nan());
    }
}
