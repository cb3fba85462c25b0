//! Three doubles in one register of four. The fourth place is unused.

use core::ops::{Add, AddAssign, Index, IndexMut, Neg, Sub, SubAssign};

use wide::f64x4;

use crate::scalar::{Symmetric, Triple};

/// Three doubles.
#[derive(Clone, Copy, Debug)]
pub struct Packed(f64x4);

/// Numbers of a register in another order. A sum with −0 changes no number and costs no
/// instruction; it makes the compiler load them together instead of one by one.
#[inline(always)]
fn places<const A: usize, const B: usize, const C: usize, const D: usize>(x: f64x4) -> f64x4 {
    let x = (x + f64x4::splat(-0.0)).to_array();
    f64x4::new([x[A], x[B], x[C], x[D]])
}

impl Index<usize> for Packed {
    type Output = f64;
    #[inline(always)]
    fn index(&self, k: usize) -> &f64 {
        &self.0.as_array()[k]
    }
}

impl IndexMut<usize> for Packed {
    #[inline(always)]
    fn index_mut(&mut self, k: usize) -> &mut f64 {
        &mut self.0.as_mut_array()[k]
    }
}

impl Add for Packed {
    type Output = Packed;
    #[inline(always)]
    fn add(self, b: Packed) -> Packed {
        Packed(self.0 + b.0)
    }
}

impl Sub for Packed {
    type Output = Packed;
    #[inline(always)]
    fn sub(self, b: Packed) -> Packed {
        Packed(self.0 - b.0)
    }
}

impl Neg for Packed {
    type Output = Packed;
    #[inline(always)]
    fn neg(self) -> Packed {
        Packed(-self.0)
    }
}

impl AddAssign for Packed {
    #[inline(always)]
    fn add_assign(&mut self, b: Packed) {
        self.0 += b.0;
    }
}

impl SubAssign for Packed {
    #[inline(always)]
    fn sub_assign(&mut self, b: Packed) {
        self.0 -= b.0;
    }
}

impl Triple<f64> for Packed {
    #[inline(always)]
    fn new(x: f64, y: f64, z: f64) -> Packed {
        Packed(f64x4::new([x, y, z, z]))
    }
    #[inline(always)]
    fn splat(x: f64) -> Packed {
        Packed(f64x4::splat(x))
    }
    #[inline(always)]
    fn columns_from(m: [f64; 9]) -> [Packed; 3] {
        let last = f64x4::new([m[5], m[6], m[7], m[8]]);
        [
            Packed(f64x4::new([m[0], m[1], m[2], m[3]])),
            Packed(f64x4::new([m[3], m[4], m[5], m[6]])),
            Packed(places::<1, 2, 3, 3>(last)),
        ]
    }
    #[inline(always)]
    fn times(self, a: Packed) -> Packed {
        Packed(self.0 * a.0)
    }
    #[inline(always)]
    fn mul_add(self, a: Packed, b: Packed) -> Packed {
        Packed(self.0.mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn mul_sub(self, a: Packed, b: Packed) -> Packed {
        Packed(self.0.mul_sub(a.0, b.0))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Packed, b: Packed) -> Packed {
        Packed(self.0.mul_neg_add(a.0, b.0))
    }
    #[inline(always)]
    fn rotate_left(self) -> Packed {
        Packed(places::<1, 2, 0, 3>(self.0))
    }
    #[inline(always)]
    fn rotate_right(self) -> Packed {
        Packed(places::<2, 0, 1, 3>(self.0))
    }
    #[inline(always)]
    fn transposed([a, b, c]: &[Packed; 3]) -> [Packed; 3] {
        let a = a.0.to_array();
        let b = b.0.to_array();
        let c = c.0.to_array();
        [
            Packed(f64x4::new([a[0], b[0], c[0], c[1]])),
            Packed(f64x4::new([a[1], b[1], c[1], c[1]])),
            Packed(f64x4::new([a[2], b[2], c[2], c[3]])),
        ]
    }
}

/// A symmetric matrix of doubles by its columns, each down to the diagonal; the entries
/// below it are unused.
#[derive(Clone, Copy, Debug)]
pub struct Upper([f64x4; 3]);

impl Upper {
    /// An entry on either side of the diagonal.
    #[inline(always)]
    fn entry(&self, i: usize, j: usize) -> f64 {
        self.0[i.max(j)].as_array()[i.min(j)]
    }
}

impl AddAssign for Upper {
    #[inline(always)]
    fn add_assign(&mut self, other: Upper) {
        for (x, y) in self.0.iter_mut().zip(other.0) {
            *x += y;
        }
    }
}

impl Symmetric<f64> for Upper {
    const ZERO: Upper = Upper([f64x4::new([0.0; 4]); 3]);

    #[inline(always)]
    fn new([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Upper {
        // as they stand in memory, but for one
        Upper([
            f64x4::new([xx, xy, xz, yy]),
            f64x4::new([xy, yy, yz, zz]),
            f64x4::new([xz, yz, zz, zz]),
        ])
    }

    #[inline(always)]
    fn column(&self, k: usize) -> Packed {
        match k {
            2 => Packed(self.0[2]),
            _ => Packed::new(self.entry(0, k), self.entry(1, k), self.entry(2, k)),
        }
    }

    #[inline(always)]
    fn add_to_diagonal(&mut self, x: f64) {
        for (k, column) in self.0.iter_mut().enumerate() {
            column.as_mut_array()[k] += x;
        }
    }

    #[inline(always)]
    fn add_upper(&mut self, columns: &[Packed; 3]) {
        for (x, column) in self.0.iter_mut().zip(columns) {
            *x += column.0;
        }
    }

    #[inline(always)]
    fn add_product(&mut self, a: &Packed, b: &Packed) {
        for (k, x) in self.0.iter_mut().enumerate() {
            *x = a.0.mul_add(f64x4::splat(b[k]), *x);
        }
    }

    #[inline(always)]
    fn rotate(&self, R: &[Packed; 3]) -> Upper {
        // R A, then columns of (R A) Rᵀ
        let by = |of: &[f64x4; 3], x: f64, y: f64, z: f64| {
            let [x, y, z] = [x, y, z].map(f64x4::splat);
            of[0].mul_add(x, of[1].mul_add(y, of[2] * z))
        };
        let axes = [R[0].0, R[1].0, R[2].0];
        let column = |k: usize| by(&axes, self.entry(0, k), self.entry(1, k), self.entry(2, k));
        let half = [column(0), column(1), column(2)];
        Upper([0, 1, 2].map(|j: usize| by(&half, R[0][j], R[1][j], R[2][j])))
    }

    #[inline(always)]
    fn parallel_axis(&self, b: &Packed, p: &Packed) -> Upper {
        let products = b.times(*p);
        let sums = products.rotate_left() + products.rotate_right();
        Upper([0, 1, 2].map(|j: usize| {
            let entries = self.0[j];
            let mixed = b.0.mul_add(f64x4::splat(p[j]), p.0 * f64x4::splat(b[j]));
            let beside = entries - mixed;
            let on = f64x4::splat(2.0).mul_add(sums.0, entries);
            let mut column = beside.to_array();
            let on = on.to_array();
            column[j] = on[j];
            f64x4::new(column)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::double_double::for_tests::Random;
    use super::*;
    use crate::scalar::{Dual, Plain, Real, Six};

    const SEED: u64 = 20_261_123;

    /// Values of duals are computed as plain doubles beside each other.
    type Alone = Dual<f64>;
    type Pair = (Packed, Plain<Alone>);

    /// True for the same bits, and for two that are no numbers.
    fn alike(a: f64, b: f64) -> bool {
        a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
    }

    /// Every number of both, to the bit.
    fn same((a, b): Pair) {
        (0..3).for_each(|k| assert!(alike(a[k], b[k].re), "{a:?} {b:?}"));
    }

    /// Compares the upper triangles.
    fn same_matrix(a: &Upper, b: &Six<Alone>) {
        (0..3).for_each(|k| same((a.column(k), b.column(k))));
    }

    fn pair(x: [f64; 3]) -> Pair {
        let [a, b, c] = x.map(Alone::constant);
        (Packed::new(x[0], x[1], x[2]), Plain::new(a, b, c))
    }

    /// How often numbers are drawn; every other time there are special ones among them.
    const DRAWS: usize = 20_000;

    /// A number of any size; where `special`, one of three is a zero, infinite, no number, tiny or
    /// one, so that sums vanish with either sign and products are no numbers.
    fn number(random: &mut Random, special: bool) -> f64 {
        const SPECIAL: [f64; 8] =
            [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324, 1.0, -1.0];
        let mut below = |n: usize| ((random.unit() + 1.0) / 2.0 * n as f64) as usize;
        match special && below(3) == 0 {
            true => SPECIAL[below(SPECIAL.len())],
            false => random.spread(-20.0, 20.0),
        }
    }

    #[test]
    fn three_in_a_register_have_the_bits_of_three_alone() {
        println!("seed {SEED}");
        let mut random = Random(SEED);
        for draw in 0..DRAWS {
            let mut next = || number(&mut random, draw % 2 == 1);
            let [a, b, c] = [(); 3].map(|()| pair([next(), next(), next()]));
            let x = next();
            same((a.0 + b.0, a.1 + b.1));
            same((a.0 - b.0, a.1 - b.1));
            same((-a.0, -a.1));
            same((a.0.times(b.0), a.1.times(b.1)));
            same((a.0.times(Packed::splat(x)), a.1.times(Plain::splat(Alone::constant(x)))));
            same((a.0.mul_add(b.0, c.0), a.1.mul_add(b.1, c.1)));
            same((a.0.mul_sub(b.0, c.0), a.1.mul_sub(b.1, c.1)));
            same((a.0.neg_mul_add(b.0, c.0), a.1.neg_mul_add(b.1, c.1)));
            same((a.0.rotate_left(), a.1.rotate_left()));
            same((a.0.rotate_right(), a.1.rotate_right()));
            let in_one = [a.0, b.0, c.0];
            let alone = [a.1, b.1, c.1];
            let rows = Packed::transposed(&in_one).into_iter().zip(Plain::transposed(&alone));
            rows.for_each(same);
            let numbers = [(); 9].map(|()| next());
            let columns = Packed::columns_from(numbers).into_iter();
            columns.zip(Plain::columns_from(numbers.map(Alone::constant))).for_each(same);
        }
    }

    #[test]
    fn symmetric_matrices_in_registers_have_the_bits_of_six_numbers() {
        println!("seed {SEED}");
        let mut random = Random(SEED);
        for draw in 0..DRAWS {
            let mut next = || number(&mut random, draw % 2 == 1);
            let six = [(); 6].map(|()| next());
            let [a, b, c] = [(); 3].map(|()| pair([next(), next(), next()]));
            let in_one = [a.0, b.0, c.0];
            let alone = [a.1, b.1, c.1];
            let mut A = Upper::new(six);
            let mut B = Six::<Alone>::new(six.map(Alone::constant));
            same_matrix(&A, &B);
            same_matrix(&A.rotate(&in_one), &B.rotate(&alone));
            same_matrix(&A.parallel_axis(&a.0, &b.0), &B.parallel_axis(&a.1, &b.1));
            A.add_product(&a.0, &b.0);
            B.add_product(&a.1, &b.1);
            A.add_upper(&in_one);
            B.add_upper(&alone);
            A.add_to_diagonal(six[0]);
            B.add_to_diagonal(Alone::constant(six[0]));
            same_matrix(&A, &B);
            let other = A.rotate(&in_one);
            let of_other = B.rotate(&alone);
            A += other;
            B += of_other;
            same_matrix(&A, &B);
        }
    }

    #[test]
    fn angles_together_have_the_bits_of_each_alone() {
        println!("seed {SEED}");
        let mut random = Random(SEED);
        for draw in 0..DRAWS {
            let special = draw % 2 == 1;
            let mut next = |scale: f64| match special {
                true => number(&mut random, true),
                false => random.unit() * scale,
            };
            let points = [(); 4].map(|()| (next(3.0), next(1.0)));
            let [a, b, c, d] = points;
            let alone = points.map(|(x, y)| Real::atan2(y, x));
            let turned = points.map(|(x, _)| Real::sin_cos(x));
            for (found, turns) in [
                (f64::angles_of([a, b]).to_vec(), f64::sin_cos_of([a.0, b.0]).to_vec()),
                (f64::angles_of([a, b, c]).to_vec(), f64::sin_cos_of([a.0, b.0, c.0]).to_vec()),
                (f64::angles_of(points).to_vec(), f64::sin_cos_of([a.0, b.0, c.0, d.0]).to_vec()),
            ] {
                assert!(found.iter().zip(alone).all(|(x, y)| alike(*x, y)), "{points:?}");
                let mut turns = turns.iter().zip(turned);
                assert!(turns.all(|(x, y)| alike(x.0, y.0) && alike(x.1, y.1)), "{points:?}");
            }
        }
    }
}
