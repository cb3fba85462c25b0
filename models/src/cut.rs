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

use sarrus_dynamics::CutJoint::{self, *};

const NONE: [f64; 3] = [0.0; 3];

/// The cut joints by name, without their axes.
pub(crate) const KINDS: [(&str, CutJoint); 7] = [
    ("spherical", Spherical),
    ("weld", Weld),
    ("revolute", Revolute { axis: NONE }),
    ("planar_revolute", PlanarRevolute { axis: NONE }),
    ("prismatic", Prismatic { axis: NONE }),
    ("cylindrical", Cylindrical { axis: NONE }),
    ("universal", Universal { axis: NONE, axis2: NONE }),
];

/// The cut joint of a name.
pub(crate) fn named(written: &str) -> Option<CutJoint> {
    KINDS.into_iter().find(|(name, _)| *name == written).map(|(_, kind)| kind)
}

pub(crate) fn n_axes(kind: CutJoint) -> usize {
    match kind {
        Spherical | Weld => 0,
        Universal { .. } => 2,
        _ => 1,
    }
}

/// The cut joint about its axes.
pub(crate) fn about(kind: CutJoint, axis: [f64; 3], axis2: [f64; 3]) -> CutJoint {
    match kind {
        Revolute { .. } => Revolute { axis },
        PlanarRevolute { .. } => PlanarRevolute { axis },
        Prismatic { .. } => Prismatic { axis },
        Cylindrical { .. } => Cylindrical { axis },
        Universal { .. } => Universal { axis, axis2 },
        _ => kind,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_as_many_rows_without_its_axes() {
        for (name, kind) in KINDS {
            let rows = about(kind, [1.0, 2.0, 3.0], [3.0, 0.0, -1.0]).rows();
            assert_eq!(rows.len(), kind.rows().len(), "{name}");
        }
    }
}
