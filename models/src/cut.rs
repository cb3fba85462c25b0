//! Cut joints by name: which rows a ball, a hinge or a weld has.
//!
//! | `cut_joint_type` | `axis`, `axis2` | rows |
//! |---|---|---|
//! | `spherical` | none | x y z |
//! | `weld` | none | x y z rx ry rz |
//! | `revolute` | axis | x y z rb rc |
//! | `planar_revolute` | axis | b c |
//! | `prismatic` | axis | b c rx ry rz |
//! | `cylindrical` | axis | b c rb rc |
//! | `universal` | axis on the predecessor, axis2 on the successor | x y z u |
//!
//! [`CutJoint`] defines the rows.

use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::Row;

/// A cut joint by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CutKind {
    Spherical,
    Weld,
    Revolute,
    PlanarRevolute,
    Prismatic,
    Cylindrical,
    Universal,
}

use CutKind::*;

pub(crate) const KINDS: [(&str, CutKind); 7] = [
    ("spherical", Spherical),
    ("weld", Weld),
    ("revolute", Revolute),
    ("planar_revolute", PlanarRevolute),
    ("prismatic", Prismatic),
    ("cylindrical", Cylindrical),
    ("universal", Universal),
];

impl CutKind {
    /// The cut joint of a name.
    pub(crate) fn named(written: &str) -> Option<CutKind> {
        KINDS.into_iter().find(|(name, _)| *name == written).map(|(_, kind)| kind)
    }

    pub(crate) fn n_axes(self) -> usize {
        match self {
            Spherical | Weld => 0,
            Universal => 2,
            _ => 1,
        }
    }

    /// Its number of rows.
    pub(crate) fn n_rows(self) -> usize {
        match self {
            PlanarRevolute => 2,
            Spherical => 3,
            Cylindrical | Universal => 4,
            Revolute | Prismatic => 5,
            Weld => 6,
        }
    }

    /// The rows in the predecessor's cut frame, and in the successor's if they involve a direction
    /// of it.
    pub(crate) fn rows(self, axis: [f64; 3], axis2: [f64; 3]) -> Vec<Row> {
        let joint = match self {
            Spherical => CutJoint::Spherical,
            Weld => CutJoint::Weld,
            Revolute => CutJoint::Revolute { axis },
            PlanarRevolute => CutJoint::PlanarRevolute { axis },
            Prismatic => CutJoint::Prismatic { axis },
            Cylindrical => CutJoint::Cylindrical { axis },
            Universal => CutJoint::Universal { axis, axis2 },
        };
        joint.rows()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_as_many_rows_as_it_says() {
        for (name, kind) in KINDS {
            assert_eq!(kind.rows([1.0, 2.0, 3.0], [3.0, 0.0, -1.0]).len(), kind.n_rows(), "{name}");
        }
    }
}
