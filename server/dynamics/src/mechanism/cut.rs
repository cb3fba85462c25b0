//! Cut joints: the places where loops are opened, and the rows that close them.

use nalgebra::Vector3;

use crate::mechanism::{Curve, Dof};
use crate::scalar::{Real, constants};
use crate::spatial::Pose;

/// A cut joint: two frames on two bodies of the cluster and the rows that tie them.
#[derive(Clone, Debug)]
pub(crate) struct Cut<T> {
    /// Local bodies (0 is the cluster's parent body) and the cut frames on them.
    pub(crate) predecessor: usize,
    pub(crate) successor: usize,
    pub(crate) x_p_cut: Pose<T>,
    pub(crate) x_s_cut: Pose<T>,
    /// Constrained directions {predecessor's cut frame}.
    pub(crate) rows: Vec<CutRow<T>>,
    /// Local joints between the two ends and the side on which they lie: true = successor's.
    pub(crate) path: Vec<(usize, bool)>,
    /// True when some row has an angular part.
    pub(crate) angular: bool,
    /// True when, where the cut is closed, θ keeps to one line or is zero: rows of ω have the span
    /// of those of θ̇ then.
    pub(crate) on_line: bool,
}

constants! { Cut:
    keep predecessor successor path angular on_line;
    map x_p_cut x_s_cut;
    each rows;
}

impl<T> Cut<T> {
    /// True for a coupling of joints, which has no frames.
    pub(crate) fn is_coupling(&self) -> bool {
        self.rows.iter().any(|row| !row.terms.is_empty())
    }
}

/// One row of a cut, of unit length, or a coupling when `terms` is not empty.
#[derive(Clone, Debug)]
pub(crate) struct CutRow<T> {
    pub(crate) angular: Vector3<T>,
    pub(crate) linear: Vector3<T>,
    /// The linear part {predecessor body}.
    pub(crate) linear_p: Vector3<T>,
    /// A direction {successor's cut frame} that the row holds perpendicular to the angular part.
    pub(crate) against: Option<Vector3<T>>,
    /// Where it ties a slide to a turn: the count of the turns.
    pub(crate) screw: Option<Screw<T>>,
    /// φ = Σ coefficient · q − Σ f(q) + offset over local joints.
    pub(crate) terms: Vec<(usize, T)>,
    pub(crate) curves: Vec<Curve<T>>,
    pub(crate) offset: T,
    /// Length of the declared row, whose K and k are these times `size`, and λ this over it.
    pub(crate) size: T,
    /// Where the declared row leans against rows of its cut: how many before it, and its part of
    /// them.
    pub(crate) leans: Vec<(usize, T)>,
}

constants! { CutRow:
    number offset size;
    map angular linear linear_p;
    each against screw curves;
    other terms: |f, (j, c)| (*j, f(*c));
    other leans: |f, (back, x)| (*back, f(*x));
}

impl<T> CutRow<T> {
    /// True for a linear coupling.
    pub(crate) fn is_linear(&self) -> bool {
        !self.terms.is_empty() && self.curves.is_empty()
    }
}

impl<T: Real> CutRow<T> {
    /// The entry of K of a coupling.
    #[inline(always)]
    pub(crate) fn slope(&self, of: &Dof, q: &[T]) -> T {
        let own = self.terms.iter().find(|(v, _)| *v == of.v).map_or(T::ZERO, |(_, c)| *c);
        let curves = self.curves.iter().filter(|curve| curve.of.v == of.v);
        curves.fold(own, |sum, curve| sum - curve.at(q[of.q])[1])
    }

    /// −φ̈ of a coupling at q̈ = 0.
    #[inline(always)]
    pub(crate) fn bend(&self, q: &[T], qd: &[T]) -> T {
        self.curves.iter().fold(T::ZERO, |sum, curve| {
            let rate = qd[curve.of.v];
            curve.at(q[curve.of.q])[2].mul_add(rate * rate, sum)
        })
    }
}

/// The line of a screw {predecessor's cut frame}, and the local joints along it with their sense:
/// their coordinates count the turns beyond half of one.
#[derive(Clone, Debug)]
pub(crate) struct Screw<T> {
    pub(crate) line: Vector3<T>,
    pub(crate) joints: Vec<(usize, T)>,
}

constants! { Screw:
    map line;
    other joints: |f, (j, c)| (*j, f(*c));
}
