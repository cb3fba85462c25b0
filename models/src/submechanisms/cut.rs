//! Cut joints by name in a submechanism file: `cut_joint_type` and its axes.

use sarrus_dynamics::CutJoint::Universal;

use crate::cut::{KINDS, n_axes, named};
use crate::report::{Diagnostics, Span, quoted};
use crate::rotation::dot;
use crate::yaml::{Node, numbers, word};

/// Checks `cut_joint_type` and its axes; the position of each row that they make.
pub(super) fn walk(node: &Node, diagnostics: &mut Diagnostics) -> Vec<Span> {
    let axes = ["axis", "axis2"]
        .map(|key| node.get(key).map(|value| (key, value.span, direction(node, key, diagnostics))));
    let Some((written, span)) = word(node, "cut_joint_type", diagnostics) else {
        if let Some((key, span, _)) =
            axes.into_iter().flatten().next().filter(|_| node.get("cut_joint_type").is_none())
        {
            let found = format!("`{key}` without a `cut_joint_type`");
            let help = "add `cut_joint_type`, or write the axis in constraint_axes";
            diagnostics.error(span, found, "both or neither", help);
        }
        return Vec::new();
    };
    if let Some(other) = node.get("constraint_axes") {
        let found = "the loop has `constraint_axes` and a `cut_joint_type`";
        diagnostics.error(other.span, found, "one of them", "remove one of them");
    }
    let Some(kind) = named(&written) else {
        let names = KINDS.map(|(name, _)| name);
        let found = format!("the cut joint type {} is not known", quoted(&written));
        let help = "write any other cut by its constraint_axes";
        diagnostics.unknown(span, found, names.join(", "), &written, names, help);
        return Vec::new();
    };
    for (k, (key, given)) in ["axis", "axis2"].into_iter().zip(&axes).enumerate() {
        match given {
            None if k < n_axes(kind) => {
                let found = format!("a {written} cut without `{key}`");
                let expected = format!("`{key}: [x, y, z]` in the cut frame");
                diagnostics.error(span, found, expected, "add it");
            }
            Some((_, span, _)) if k >= n_axes(kind) => {
                let found = format!("a {written} cut with `{key}`");
                diagnostics.error(*span, found, "none", "remove it");
            }
            _ => {}
        }
    }
    if let (Universal { .. }, [Some((_, _, Some(first))), Some((_, span, Some(second)))]) =
        (kind, axes)
    {
        let along = dot(first, second) / (dot(first, first) * dot(second, second)).sqrt();
        // a small error is the rounding of a file
        if along.abs() > 1e-6 {
            let found = format!("the two axes of a universal cut have the cosine {along:.3e}");
            let help = "correct one of them, or write the cut as revolute joints in the tree and a \
                        spherical cut";
            diagnostics.error(span, found, "perpendicular axes", help);
        }
    }
    vec![span; kind.rows().len()]
}

/// An axis whose length is neither zero nor extreme; `None` after an error.
fn direction(node: &Node, key: &str, diagnostics: &mut Diagnostics) -> Option<[f64; 3]> {
    let axis = numbers::<3>(node, "the loop constraint", key, diagnostics)?;
    let size = axis.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    // far from unit length its square would leave the range of numbers
    if (1e-50..=1e50).contains(&size) {
        return Some(axis);
    }
    let span = node.get(key).map_or(node.span, |value| value.span);
    let found = format!("`{key}` of the loop constraint has a length near {size:e}");
    diagnostics.refused(span, found, "a direction as [0, 0, 1]", "correct it")
}
