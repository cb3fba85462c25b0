//! Cut joints: the places where loops are opened, and the rows that close them.

use crate::scalar::constants;
use nalgebra::Vector3;

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
}

constants! { Cut:
    keep predecessor successor path angular;
    map x_p_cut x_s_cut;
    each rows;
}

/// One row of a cut, or a linear coupling when `terms` is not empty.
#[derive(Clone, Debug)]
pub(crate) struct CutRow<T> {
    pub(crate) angular: Vector3<T>,
    pub(crate) linear: Vector3<T>,
    /// The linear part {predecessor body}.
    pub(crate) linear_p: Vector3<T>,
    /// A direction {successor's cut frame} that the row holds perpendicular to the angular part.
    pub(crate) against: Option<Vector3<T>>,
    /// φ = Σ coefficient · q + offset over local joints.
    pub(crate) terms: Vec<(usize, T)>,
    pub(crate) offset: T,
}

constants! { CutRow:
    number offset;
    map angular linear linear_p;
    each against;
    other terms: |f, (j, c)| (*j, f(*c));
}
