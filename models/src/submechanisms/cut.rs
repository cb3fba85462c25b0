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
//! What the rows are is said at [`CutJoint`], which makes them.

use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::Row;

use crate::report::{Diagnostics, Span, quoted};
use crate::yaml::{Node, numbers, word};

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

const KINDS: [(&str, CutKind); 7] = [
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

    fn n_axes(self) -> usize {
        match self {
            Spherical | Weld => 0,
            Universal => 2,
            _ => 1,
        }
    }

    /// How many rows it has.
    fn n_rows(self) -> usize {
        match self {
            PlanarRevolute => 2,
            Spherical => 3,
            Cylindrical | Universal => 4,
            Revolute | Prismatic => 5,
            Weld => 6,
        }
    }

    /// The rows in the predecessor's cut frame, and in the successor's where they stand against a
    /// direction of it.
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

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Checks `cut_joint_type` and its axes; the position of each row that they make.
pub(super) fn walk(node: &Node, diagnostics: &mut Diagnostics) -> Vec<Span> {
    let axes = ["axis", "axis2"]
        .map(|key| node.get(key).map(|value| (key, value.span, direction(node, key, diagnostics))));
    let Some((written, span)) = word(node, "cut_joint_type", diagnostics) else {
        if let Some((key, span, _)) =
            axes.into_iter().flatten().next().filter(|_| node.get("cut_joint_type").is_none())
        {
            let found = format!("`{key}` without a `cut_joint_type`");
            diagnostics.error(
                span,
                found,
                "both or neither",
                "add `cut_joint_type`, or write the axis in constraint_axes",
            );
        }
        return Vec::new();
    };
    if let Some(other) = node.get("constraint_axes") {
        let help = "remove one of them";
        diagnostics.error(
            other.span,
            "the loop has `constraint_axes` and a `cut_joint_type`",
            "one of them",
            help,
        );
    }
    let Some(kind) = CutKind::named(&written) else {
        let names = KINDS.map(|(name, _)| name);
        let help =
            diagnostics.did_you_mean(&written, names, "write any other cut by its constraint_axes");
        diagnostics.error(
            span,
            format!("the cut joint type {} is not known", quoted(&written)),
            names.join(", "),
            help,
        );
        return Vec::new();
    };
    for (k, (key, given)) in ["axis", "axis2"].into_iter().zip(&axes).enumerate() {
        match given {
            None if k < kind.n_axes() => {
                diagnostics.error(
                    span,
                    format!("a {written} cut without `{key}`"),
                    format!("`{key}: [x, y, z]` in the cut frame"),
                    "add it",
                );
            }
            Some((_, span, _)) if k >= kind.n_axes() => {
                diagnostics.error(
                    *span,
                    format!("a {written} cut with `{key}`"),
                    "none",
                    "remove it",
                );
            }
            _ => {}
        }
    }
    if let (Universal, [Some((_, _, Some(first))), Some((_, span, Some(second)))]) = (kind, axes) {
        let along = dot(first, second) / (dot(first, first) * dot(second, second)).sqrt();
        // a little off is the rounding of a file
        if along.abs() > 1e-6 {
            let found = format!("the two axes of a universal cut have the cosine {along:.3e}");
            diagnostics.error(
                span,
                found,
                "perpendicular axes",
                "correct one of them, or write the cut as revolute joints in the tree and a \
                 spherical cut",
            );
        }
    }
    vec![span; kind.n_rows()]
}

/// A direction of some length.
fn direction(node: &Node, key: &str, diagnostics: &mut Diagnostics) -> Option<[f64; 3]> {
    let axis = numbers::<3>(node, "the loop constraint", key, diagnostics)?;
    let size = axis.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    // far from unit length its square would leave the range of numbers
    if (1e-6..=1e6).contains(&size) {
        return Some(axis);
    }
    let span = node.get(key).map_or(node.span, |value| value.span);
    diagnostics.error(
        span,
        format!("`{key}` of the loop constraint has a length near {size:e}"),
        "a direction as [0, 0, 1]",
        "correct it",
    );
    None
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
