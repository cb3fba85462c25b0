//! Shared by the tests of this folder: true values, a measure of error, and random numbers.

use crate::scalar::double_double::Dd;

/// x, sin x, cos x as hi and lo (mpmath, 1400 bits): tiny, common, next to multiples of π/2, the
/// nearest such doubles of some binades.
pub(crate) fn sines() -> Vec<[f64; 5]> {
    table(include_str!("sines.tsv"))
}

/// y, x, the angle of (x, y) as hi and lo (mpmath, 1400 bits): axes, diagonals, extreme sizes,
/// octant borders, common.
pub(crate) fn angles() -> Vec<[f64; 4]> {
    table(include_str!("angles.tsv"))
}

/// The rows of a table; a number that cannot be read is NaN, which no test accepts.
fn table<const N: usize>(text: &str) -> Vec<[f64; N]> {
    let row = |line: &str| {
        let mut numbers = line.split('\t').map(|number| number.parse().unwrap_or(f64::NAN));
        core::array::from_fn(|_| numbers.next().unwrap_or(f64::NAN))
    };
    text.lines().map(row).collect()
}

/// |value − truth| in units in the last place of the truth.
pub(crate) fn ulps(value: f64, truth: Dd) -> f64 {
    let exponent = (truth.hi.abs().to_bits() >> 52).max(1) as i32;
    let error = (value - truth.hi) - truth.lo;
    error.abs() * 2.0_f64.powi(1000 - exponent) * 2.0_f64.powi(75)
}

/// |value − truth| / |truth|.
pub(crate) fn relative(value: Dd, truth: Dd) -> f64 {
    if value == truth { 0.0 } else { ((value - truth).hi / truth.hi).abs() }
}

/// SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Uniform in [−1, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A random double-double in [−1, 1), both parts full.
    pub(crate) fn unit_dd(&mut self) -> Dd {
        Dd::fast(self.unit(), self.unit() * 2.0_f64.powi(-56))
    }

    /// A random sign and a size evenly spread over the powers of two from 2^low to 2^high.
    pub(crate) fn spread(&mut self, low: f64, high: f64) -> f64 {
        let size = ((self.unit() + 1.0) / 2.0 * (high - low) + low).exp2();
        size.copysign(self.unit())
    }
}
