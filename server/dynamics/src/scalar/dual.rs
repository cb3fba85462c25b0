//! Dual numbers: a value and its derivative along one direction, over any scalar.

use core::cmp::Ordering;
use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::scalar::{Plain, Real, Six};

/// re + ε du: a number and its derivative, carried through every operation alike. A dual of duals
/// carries two directions and the mixed second derivative.
///
/// ```text
///   f(a + ε b) = f(a) + ε f′(a) b,   ε² = 0
/// ```
/// Comparisons, including equality, use the value alone: a kernel takes the same branches and gives
/// the same values as over the plain scalar. A number is finite where both parts are. At a kink, as
/// of |x| at 0, the derivative is that of the side which a comparison takes.
///
/// A model over duals is [`crate::Model::convert`] with [`Dual::constant`]. Closed forms then give
/// γ(y + ε ẏ) at once. The values decide when a numerical closure stops, so Newton's method runs
/// over the plain scalar first and its q is the guess of the dual request: the one step from a
/// closed pose gives the first derivative. Each further closure from the last q gives one more
/// order.
///
/// Source: \[GW08\], chapter 3, the forward mode. Never allocates.
///
/// ```
/// use sarrus_dynamics::scalar::{Dual, Real};
///
/// // d/dx of x sin x at 2
/// let x = Dual::new(2.0, 1.0);
/// let y = x * x.sin_cos().0;
/// assert!((y.du - (2.0_f64.sin() + 2.0 * 2.0_f64.cos())).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dual<S> {
    /// The value.
    pub re: S,
    /// The derivative.
    pub du: S,
}

impl<S: Real> Dual<S> {
    /// re + ε du.
    pub const fn new(re: S, du: S) -> Dual<S> {
        Dual { re, du }
    }

    /// A constant.
    pub const fn constant(re: S) -> Dual<S> {
        Dual { re, du: S::ZERO }
    }
}

impl<S: Real> Dual<Dual<S>> {
    /// The path x + t ẋ + t²/2 ẍ at t = 0: both directions are time.
    pub const fn path(x: S, xd: S, xdd: S) -> Dual<Dual<S>> {
        Dual { re: Dual { re: x, du: xd }, du: Dual { re: xd, du: xdd } }
    }
}

impl<S: Real> PartialEq for Dual<S> {
    fn eq(&self, other: &Dual<S>) -> bool {
        self.re == other.re
    }
}

impl<S: Real> PartialOrd for Dual<S> {
    fn partial_cmp(&self, other: &Dual<S>) -> Option<Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl<S: Real> Neg for Dual<S> {
    type Output = Dual<S>;
    fn neg(self) -> Dual<S> {
        Dual { re: -self.re, du: -self.du }
    }
}

impl<S: Real> Add for Dual<S> {
    type Output = Dual<S>;
    fn add(self, b: Dual<S>) -> Dual<S> {
        Dual { re: self.re + b.re, du: self.du + b.du }
    }
}

impl<S: Real> Sub for Dual<S> {
    type Output = Dual<S>;
    fn sub(self, b: Dual<S>) -> Dual<S> {
        Dual { re: self.re - b.re, du: self.du - b.du }
    }
}

impl<S: Real> Mul for Dual<S> {
    type Output = Dual<S>;
    fn mul(self, b: Dual<S>) -> Dual<S> {
        Dual { re: self.re * b.re, du: self.re.mul_add(b.du, self.du * b.re) }
    }
}

impl<S: Real> Div for Dual<S> {
    type Output = Dual<S>;
    fn div(self, b: Dual<S>) -> Dual<S> {
        let re = self.re / b.re;
        Dual { re, du: (self.du - re * b.du) / b.re }
    }
}

assigned!(Dual<S>, S: Real);

impl<S: Real> Real for Dual<S> {
    type Triple = Plain<Dual<S>>;
    type Symmetric = Six<Dual<S>>;

    const ZERO: Dual<S> = Dual { re: S::ZERO, du: S::ZERO };
    const ONE: Dual<S> = Dual { re: S::ONE, du: S::ZERO };
    const EPSILON: f64 = S::EPSILON;

    fn from_f64(x: f64) -> Dual<S> {
        Dual::constant(S::from_f64(x))
    }
    fn mul_add(self, a: Dual<S>, b: Dual<S>) -> Dual<S> {
        Dual {
            re: self.re.mul_add(a.re, b.re),
            du: self.re.mul_add(a.du, self.du.mul_add(a.re, b.du)),
        }
    }
    fn sqrt(self) -> Dual<S> {
        let re = self.re.sqrt();
        Dual { re, du: self.du / (re + re) }
    }
    fn abs(self) -> Dual<S> {
        if self.re.lt(S::ZERO) { -self } else { self }
    }
    fn sin_cos(self) -> (Dual<S>, Dual<S>) {
        let (s, c) = self.re.sin_cos();
        (Dual { re: s, du: c * self.du }, Dual { re: c, du: -(s * self.du) })
    }
    fn atan2(self, x: Dual<S>) -> Dual<S> {
        let square = self.re.mul_add(self.re, x.re * x.re);
        Dual { re: self.re.atan2(x.re), du: (x.re * self.du - self.re * x.du) / square }
    }
    fn lt(self, other: Dual<S>) -> bool {
        self.re.lt(other.re)
    }
    fn is_finite(self) -> bool {
        self.re.is_finite() && self.du.is_finite()
    }
    fn select(condition: bool, a: Dual<S>, b: Dual<S>) -> Dual<S> {
        if condition { a } else { b }
    }
    fn nearest_whole(self) -> Dual<S> {
        Dual::constant(self.re.nearest_whole())
    }
    fn to_f64(self) -> f64 {
        self.re.to_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Dd;
    use super::*;

    /// A function with every operation in it.
    fn f<T: Real>(x: T) -> T {
        let (s, c) = x.sin_cos();
        let sum = s.mul_add(x, c / (x + T::ONE)) - (x * x + T::ONE).sqrt();
        sum + (-x).abs() * s.atan2(c + x * x)
    }

    #[test]
    fn first_and_second_derivatives_agree_with_differences_of_double_double() {
        for x in [-1.3, -0.4, 0.2, 0.7, 2.9] {
            let dual = f(Dual::path(x, 1.0, 0.0));
            let h = 1e-8;
            let at = |t: f64| f(Dd::from(x) + Dd::from(t));
            let first = (at(h) - at(-h)) / Dd::from(2.0 * h);
            let second = (at(h) - at(0.0) - at(0.0) + at(-h)) / Dd::from(h * h);
            assert_eq!(dual.re.re, f(x));
            for (got, want) in [(dual.re.du, first), (dual.du.re, first), (dual.du.du, second)] {
                assert!(
                    (got - want.to_f64()).abs() < 1e-13 * (1.0 + want.to_f64().abs()),
                    "f at {x}: {got} instead of {}",
                    want.to_f64()
                );
            }
        }
    }
}
