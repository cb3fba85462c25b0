//! Cut joints: where loops were opened, and the rows that close them.

use nalgebra::Vector3;

use crate::spatial::Pose;

/// A cut joint: two frames on two bodies of the cluster and the rows that tie them.
#[derive(Clone, Debug)]
pub(crate) struct Cut<C> {
    /// Local bodies (0 is the cluster's parent body) and the cut frames on them.
    pub(crate) predecessor: usize,
    pub(crate) successor: usize,
    pub(crate) x_p_cut: Pose<C>,
    pub(crate) x_s_cut: Pose<C>,
    /// Constrained directions {predecessor's cut frame}.
    pub(crate) rows: Vec<CutRow<C>>,
    /// Local joints between the two ends and the side on which they lie: true = successor's.
    pub(crate) path: Vec<(usize, bool)>,
    /// True when some row has an angular part.
    pub(crate) angular: bool,
}

/// One row of a cut, or a linear coupling when `terms` is not empty.
#[derive(Clone, Debug)]
pub(crate) struct CutRow<C> {
    pub(crate) angular: Vector3<C>,
    pub(crate) linear: Vector3<C>,
    /// The linear part {predecessor body}.
    pub(crate) linear_p: Vector3<C>,
    /// A direction {successor's cut frame} that the row holds perpendicular to the angular part.
    pub(crate) against: Option<Vector3<C>>,
    /// φ = Σ coefficient · q + offset over local joints.
    pub(crate) terms: Vec<(usize, C)>,
    pub(crate) offset: C,
}

impl<C: nalgebra::Scalar + Copy> Cut<C> {
    /// The same cut with every constant converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Cut<D> {
        let row = |row: &CutRow<C>| CutRow {
            angular: row.angular.map(f),
            linear: row.linear.map(f),
            linear_p: row.linear_p.map(f),
            against: row.against.map(|b| b.map(f)),
            terms: row.terms.iter().map(|(j, c)| (*j, f(*c))).collect(),
            offset: f(row.offset),
        };
        Cut {
            predecessor: self.predecessor,
            successor: self.successor,
            x_p_cut: self.x_p_cut.map(f),
            x_s_cut: self.x_s_cut.map(f),
            rows: self.rows.iter().map(row).collect(),
            path: self.path.clone(),
            angular: self.angular,
        }
    }
}
