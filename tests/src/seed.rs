//! Random numbers that are the same on every machine.

use sarrus_report::robots::random::Random;

use crate::rigid::{Pose, Vector, unit};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Seeded(Random);

impl Seeded {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Seeded {
        let state = seed.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(0x2545_f491_4f6c_dd1d);
        let mut random = Random(state);
        random.bits();
        Seeded(random)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// A number from `low` to `high`.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// 0 to n − 1.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// True with this probability.
    pub fn chance(&mut self, share: f64) -> bool {
        self.within(0.0, 1.0) < share
    }

    /// +1 or −1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Each entry within ±size.
    pub fn vector(&mut self, size: f64) -> Vector {
        [(); 3].map(|()| self.within(-size, size))
    }

    /// A direction.
    pub fn direction(&mut self) -> Vector {
        let v = self.vector(1.0);
        let square = v.iter().map(|x| x * x).sum::<f64>();
        if (0.1..1.0).contains(&square) { unit(v) } else { self.direction() }
    }

    /// A pose with its origin within ±size.
    pub fn pose(&mut self, size: f64) -> Pose {
        let rpy = [self.within(-3.0, 3.0), self.within(-1.5, 1.5), self.within(-3.0, 3.0)];
        Pose::from_rpy(rpy, self.vector(size))
    }

    /// n numbers within ±size.
    pub fn numbers(&mut self, n: usize, size: f64) -> Vec<f64> {
        (0..n).map(|_| self.within(-size, size)).collect()
    }

    /// A random order of the numbers 0 to n − 1.
    pub fn order(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        (1..n).for_each(|k| order.swap(k, self.below(k + 1)));
        order
    }
}
