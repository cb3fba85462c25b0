//! The registers of several doubles as arguments of the elementary functions.

use wide::{bytemuck, f64x4, f64x8, u64x4, u64x8};

use crate::scalar::elementary::Lane;

/// True if every register operation is a single instruction that rounds like the scalar one;
/// otherwise a fused product is two operations.
pub(crate) const FUSED: bool = cfg!(any(
    all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"),
    target_arch = "aarch64"
));

macro_rules! register {
    ($register:ident, $bits:ident) => {
        /// Each lane has the bits of `f64` alone if [`FUSED`] holds.
        impl Lane for $register {
            type Mask = $register;

            #[inline(always)]
            fn of(x: f64) -> $register {
                $register::splat(x)
            }
            #[inline(always)]
            fn fused(self, a: $register, b: $register) -> $register {
                self.mul_add(a, b)
            }
            #[inline(always)]
            fn absolute(self) -> $register {
                self.abs()
            }
            #[inline(always)]
            fn less(self, other: $register) -> $register {
                self.simd_lt(other)
            }
            #[inline(always)]
            fn blend(mask: $register, a: $register, b: $register) -> $register {
                mask.select(a, b)
            }
            #[inline(always)]
            fn sign_from_bit(self, k: u32) -> $register {
                let bits: $bits = bytemuck::cast(self);
                bytemuck::cast(bits << u64::from(63 - k))
            }
            #[inline(always)]
            fn xor_sign(self, sign: $register) -> $register {
                self ^ (sign & $register::splat(-0.0))
            }
        }
    };
}

register!(f64x4, u64x4);
register!(f64x8, u64x8);

#[cfg(test)]
mod tests {
    use super::super::Real;
    use super::super::double_double::for_tests::Random;
    use super::super::elementary;
    use super::*;

    const SEED: u64 = 20_251_122;
    const ARGUMENTS: usize = 1_000_000;

    /// Equal bits, or both NaN.
    fn same(a: f64, b: f64) -> bool {
        a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
    }

    /// Sizes of every kind, turns, and the special values.
    fn arguments() -> impl FnMut() -> f64 {
        let special = [
            0.0,
            -0.0,
            5e-324,
            1.0,
            -1.0,
            f64::MAX,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            elementary::RANGE,
        ];
        let mut random = Random(SEED);
        println!("seed {SEED}");
        let mut count = 0_usize;
        move || {
            count += 1;
            match count % 7 {
                0 => special[count / 7 % special.len()],
                1 | 2 => random.spread(-1000.0, 1000.0),
                3 => random.unit() * 1e6,
                _ => random.unit() * 3.2,
            }
        }
    }

    macro_rules! every_function {
        ($register:ident, $lanes:literal) => {{
            type R = $register;
            let mut next = arguments();
            let mut compare = |together: fn(R, R) -> R, single: fn(f64, f64) -> f64| {
                for _ in 0..ARGUMENTS / $lanes {
                    let a = [(); $lanes].map(|()| next());
                    let b = [(); $lanes].map(|()| next());
                    let found = together(R::new(a), R::new(b)).to_array();
                    for k in 0..$lanes {
                        let alone = single(a[k], b[k]);
                        let a = a[k];
                        let b = b[k];
                        let found = found[k];
                        assert!(same(found, alone), "({a:e}, {b:e}): {alone:e}, {found:e}");
                    }
                }
            };
            compare(|a, _| elementary::sin_cos(a).0, |a, _| Real::sin_cos(a).0);
            compare(|a, _| elementary::sin_cos(a).1, |a, _| Real::sin_cos(a).1);
            compare(elementary::atan2, Real::atan2);
            compare(|a, b| a.fused(b, a - b), |a, b| f64::mul_add(a, b, a - b));
            compare(|a, b| -(a / b) + a * b, |a, b| -(a / b) + a * b);
            compare(|a, _| a.sqrt(), |a, _| a.sqrt());
            // and the sign of zero, which a sum with it hides
            compare(|a, _| -a, |a, _| -a);
            compare(|a, b| a.xor_sign(b), |a, b| a.xor_sign(b));
            let chosen = |a: R, b: R| <R as Lane>::blend(a.less(b), R::of(1.0), R::of(2.0));
            compare(chosen, |a, b| if a < b { 1.0 } else { 2.0 });
        }};
    }

    #[test]
    fn each_of_four_lanes_has_the_bits_of_a_double_alone() {
        if FUSED {
            every_function!(f64x4, 4);
        }
    }

    #[test]
    fn each_of_eight_lanes_has_the_bits_of_a_double_alone() {
        if FUSED {
            every_function!(f64x8, 8);
        }
    }
}
