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
//! x, y, z are the axes of the cut frame. b is the one of them that is least along `axis` (the
//! first of several), made perpendicular to it; c = axis × b. The letter r stands for a turn, axis
//! · log(R_Pᵀ R_S), which is exact wherever the cut leaves the turns about one line or none. A
//! universal joint leaves two, and its turn about axis × axis2 is none of them only at zero; what
//! it keeps is u, axis · (R_Pᵀ R_S axis2) = 0.

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
        let [b, c] = across(axis);
        let frame = [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])];
        let plane = [("b", b), ("c", c)];
        let (linear, angular): (&[(&str, [f64; 3])], &[(&str, [f64; 3])]) = match self {
            Spherical | Universal => (&frame, &[]),
            Weld => (&frame, &frame),
            Revolute => (&frame, &plane),
            PlanarRevolute => (&plane, &[]),
            Prismatic => (&plane, &frame),
            Cylindrical => (&plane, &plane),
        };
        let linear = linear
            .iter()
            .map(|(name, [x, y, z])| ((*name).to_owned(), [0.0, 0.0, 0.0, *x, *y, *z], None));
        let angular = angular
            .iter()
            .map(|(name, [x, y, z])| (format!("r{name}"), [*x, *y, *z, 0.0, 0.0, 0.0], None));
        // what is perpendicular up to the rounding of a file is so
        let [x, y, z] = unit(axis);
        let along = dot([x, y, z], axis2);
        let against = unit([axis2[0] - along * x, axis2[1] - along * y, axis2[2] - along * z]);
        let turn =
            (self == Universal).then(|| ("u".to_owned(), [x, y, z, 0.0, 0.0, 0.0], Some(against)));
        linear
            .chain(angular)
            .chain(turn)
            .map(|(name, axis, against)| Row { name, axis, against })
            .collect()
    }
}

/// Two directions b and c = axis × b, perpendicular to an axis and of unit length; exact where the
/// axis is one of the frame.
fn across(axis: [f64; 3]) -> [[f64; 3]; 2] {
    let a = unit(axis);
    let mut k = 0;
    for i in 1..3 {
        if a[i].abs() < a[k].abs() {
            k = i;
        }
    }
    let b = unit(core::array::from_fn(|i| if i == k { 1.0 - a[k] * a[k] } else { -a[k] * a[i] }));
    // 0.0 turns −0.0 round
    [b, [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]]
        .map(|v| v.map(|x| x + 0.0))
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    // a cut without an axis has no row of it
    if length > 0.0 { v.map(|x| x / length) } else { v }
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
    fn the_directions_across_an_axis_of_the_frame_are_axes_of_the_frame() {
        assert_eq!(across([3.0, 0.0, 0.0]), [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(across([0.0, 1.0, 0.0]), [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        assert_eq!(across([0.0, 0.0, 0.5]), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    }

    #[test]
    fn the_directions_across_a_tilted_axis_are_a_right_handed_frame_with_it() {
        let axis = [0.36, 0.48, -0.8];
        let [b, c] = across(axis);
        for (value, expected) in [
            (dot(b, axis), 0.0),
            (dot(c, axis), 0.0),
            (dot(b, c), 0.0),
            (dot(b, b), 1.0),
            (dot(c, c), 1.0),
        ] {
            assert!((value - expected).abs() < 4e-16, "{value} {expected}");
        }
        assert!(c[2] * (axis[0] * b[1] - axis[1] * b[0]) > 0.0);
    }

    #[test]
    fn every_kind_has_as_many_rows_as_it_says() {
        for (name, kind) in KINDS {
            assert_eq!(kind.rows([1.0, 2.0, 3.0], [3.0, 0.0, -1.0]).len(), kind.n_rows(), "{name}");
        }
    }
}
