//! Smooth functions of one coordinate, of which couplings are made.

use core::array;

use crate::mechanism::Dof;
use crate::scalar::{Real, constants};

/// f(q) of one coordinate of a cluster, by pieces of degree 5.
#[derive(Clone, Debug)]
pub(crate) struct Curve<T> {
    /// The coordinate.
    pub(crate) of: Dof,
    /// A piece begins at its first number x₀, the first piece everywhere before the second one: f =
    /// Σ c_k (q − x₀)^k with the other six numbers.
    pub(crate) pieces: Vec<[T; 7]>,
}

constants! { Curve:
    keep of;
    other pieces: |f, piece| piece.map(f);
}

impl<T: Real> Curve<T> {
    /// f and its first three derivatives at x.
    pub(crate) fn at(&self, x: T) -> [T; 4] {
        values(&self.pieces, x)
    }
}

/// f of the pieces of a curve and its first three derivatives at x. All pieces are looked at, so
/// that states of a packet may lie on different ones.
#[inline(never)]
pub(crate) fn values<T: Real>(pieces: &[[T; 7]], x: T) -> [T; 4] {
    let mut piece = pieces[0];
    for next in &pieces[1..] {
        piece = array::from_fn(|k| T::select_lt(x, next[0], piece[k], next[k]));
    }
    let [start, coefficients @ ..] = piece;
    let d = x - start;
    // f⁽ᵏ⁾ / k!, by Horner's rule
    let [mut f, mut f1, mut f2, mut f3] = [T::ZERO; 4];
    for c in coefficients.into_iter().rev() {
        f3 = d.mul_add(f3, f2);
        f2 = d.mul_add(f2, f1);
        f1 = d.mul_add(f1, f);
        f = d.mul_add(f, c);
    }
    [f, f1, f2 * T::from_f64(2.0), f3 * T::from_f64(6.0)]
}
