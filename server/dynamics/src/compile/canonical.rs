//! The default loops of a submechanism's type: the cut of each leg and its rows.

use nalgebra::Vector3;

use crate::compile::CLOSED_FORMS;
use crate::compile::geometry::{link_pose, unit, vector};
use crate::description::{Cut, Description, JointKind, Loop, Row, Submechanism, SubmechanismKind};
use crate::diagnostic::{Diagnostic, Site};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// Joints of the largest type that defines its loops.
const MOST_JOINTS: usize = 24;

/// The loops of a submechanism: the given ones, or the defaults of its type.
pub(super) fn loops(
    description: &Description,
    s: usize,
    errors: &mut Vec<Diagnostic>,
) -> Vec<Loop> {
    let submechanism = &description.submechanisms[s];
    if !submechanism.loops.is_empty() {
        return submechanism.loops.clone();
    }
    let coupled = submechanism
        .spanning_tree
        .iter()
        .filter(|j| description.joints[**j].coupling.is_some())
        .count();
    if submechanism.independent.len() + coupled >= submechanism.spanning_tree.len() {
        return Vec::new();
    }
    of_type(description, submechanism).unwrap_or_else(|| {
        let Submechanism { name, type_name, .. } = submechanism;
        let needs = match submechanism.kind {
            SubmechanismKind::Rrpr => "a rocker and a stator on one body, a slider on the stator",
            SubmechanismKind::SliderCrank => "a crank, a coupler on it, a slider beside the crank",
            SubmechanismKind::Spu2U1 | SubmechanismKind::Sprr2U1 | SubmechanismKind::Ups6 => {
                "independents that carry a platform, and legs that end in sliders"
            }
            _ => "loop_constraints, couplings, or a type that defines its loops for these joints",
        };
        let fits: Vec<String> = fitting_types(description, submechanism)
            .into_iter()
            .map(|(fitting, order)| {
                let names: Vec<&str> =
                    order.iter().map(|j| description.joints[*j].name.as_str()).collect();
                format!("type: {fitting} with jointnames_spanningtree: [{}]", names.join(", "))
            })
            .collect();
        let help = match &fits[..] {
            [] => "add loop_constraints".to_owned(),
            fits => format!("write {}, which fits, or add loop_constraints", fits.join(" or ")),
        };
        let found = match submechanism.kind {
            SubmechanismKind::Rrpr
            | SubmechanismKind::SliderCrank
            | SubmechanismKind::Spu2U1
            | SubmechanismKind::Sprr2U1
            | SubmechanismKind::Ups6 => {
                format!("the joints of {name} have not the geometry of their type {type_name}")
            }
            _ => format!("dependent joints in {name} (type {type_name}) that nothing determines"),
        };
        errors.push(Diagnostic::new(Site::Submechanism(s), found, needs, help));
        Vec::new()
    })
}

/// The loops of a submechanism: the given ones, or those of its type; none after a fault.
pub fn loops_of(description: &Description, s: usize) -> Vec<Loop> {
    loops(description, s, &mut Vec::new())
}

/// The loops that a type defines on these joints; `None` where their geometry is another.
fn of_type(description: &Description, submechanism: &Submechanism) -> Option<Vec<Loop>> {
    match submechanism.kind {
        SubmechanismKind::Rrpr => with_slider(description, submechanism, false),
        SubmechanismKind::SliderCrank => with_slider(description, submechanism, true),
        SubmechanismKind::Spu2U1 => legs(description, submechanism, 2),
        SubmechanismKind::Sprr2U1 if submechanism.spanning_tree.len() == 10 => {
            arms(description, submechanism)
        }
        SubmechanismKind::Sprr2U1 => legs(description, submechanism, 2),
        SubmechanismKind::Ups6 => legs(description, submechanism, 6),
        _ => None,
    }
}

/// The types whose loops the geometry of these joints defines, each with the order of the joints.
pub fn fitting_types(
    description: &Description,
    submechanism: &Submechanism,
) -> Vec<(&'static str, Vec<usize>)> {
    // a hostile file has more joints than any of these types, and the search is quadratic
    if submechanism.spanning_tree.len() > MOST_JOINTS || submechanism.independent.len() > 6 {
        return Vec::new();
    }
    let orders = joint_orders(&submechanism.spanning_tree);
    let fits = |(name, kind): (&'static str, SubmechanismKind)| {
        let has = |order: &&Vec<usize>| {
            let spanning_tree = (*order).clone();
            let trial = Submechanism { kind, spanning_tree, ..submechanism.clone() };
            of_type(description, &trial).is_some()
        };
        orders.iter().find(has).map(|order| (name, order.clone()))
    };
    CLOSED_FORMS.into_iter().filter_map(fits).collect()
}

/// The orders in which a type may name joints of a tree: all of three joints, else the given one.
pub fn joint_orders(tree: &[usize]) -> Vec<Vec<usize>> {
    match *tree {
        [a, b, c] => [[a, b, c], [a, c, b], [b, a, c], [b, c, a], [c, a, b], [c, b, a]]
            .map(|order| order.to_vec())
            .to_vec(),
        _ => vec![tree.to_vec()],
    }
}

/// Two joints that turn and a slider: of an RRPR rocker, stator on the same body, slider on the
/// stator; of a slider-crank crank, coupler on it, slider on the crank's body. The pin is the
/// slider's origin, tied to the rocker or the coupler along the slider and across it in the plane
/// that is perpendicular to the first axis.
fn with_slider(
    description: &Description,
    submechanism: &Submechanism,
    is_crank: bool,
) -> Option<Vec<Loop>> {
    let [first, second, slider] = submechanism.spanning_tree[..] else { return None };
    let joints = &description.joints;
    let [below_first, below_second, below_slider] =
        [first, second, slider].map(|j| carrier(description, joints[j].parent));
    let (held, fits) = if is_crank {
        (second, below_first == below_slider && below_second == Some(first))
    } else {
        (first, below_first == below_second && below_slider == Some(second))
    };
    let turns = |j: usize| matches!(joints[j].kind, JointKind::Revolute | JointKind::Continuous);
    let is_slider = joints[slider].kind == JointKind::Prismatic;
    if !fits || !turns(first) || !turns(second) || !is_slider {
        return None;
    }
    Some(vec![pin(description, first, held, slider)?])
}

/// The slider's origin tied to the body of another joint along the slider and across it,
/// perpendicular to the axis of a third.
fn pin(description: &Description, turn: usize, other: usize, slider: usize) -> Option<Loop> {
    let normal = direction_in_root(description, turn)?;
    let along = direction_in_root(description, slider)?;
    let across = unit(&normal.cross(along))?;
    Some(Loop {
        name: description.joints[slider].name.clone(),
        predecessor: description.joints[other].child,
        successor: description.joints[slider].child,
        cut: Cut::AtJoint(slider),
        rows: vec![
            row(description, slider, "along", &unit(&along)?)?,
            row(description, slider, "across", &across)?,
        ],
    })
}

/// A linear row along a direction {root}, in the frame of a joint at zero.
fn row(description: &Description, joint: usize, name: &str, v: &Vector3<Dd>) -> Option<Row> {
    let frame = link_pose(description, description.joints[joint].child)?.R;
    let v = frame.apply_transposed(*v).map(Dd::to_f64);
    Some(Row { name: name.into(), axis: [0.0, 0.0, 0.0, v[0], v[1], v[2]], against: None })
}

/// Independent joints that carry a platform, and legs of three joints; each slider's origin is a
/// point of the platform.
fn legs(
    description: &Description,
    submechanism: &Submechanism,
    n_legs: usize,
) -> Option<Vec<Loop>> {
    let sliders = sliders(description, submechanism, n_legs)?;
    if submechanism.spanning_tree.len() != submechanism.independent.len() + 3 * n_legs {
        return None;
    }
    let platform = description.joints[platform(description, submechanism)?].child;
    Some(sliders.into_iter().map(|slider| spherical(description, slider, platform)).collect())
}

/// Legs that end in arms on the platform, the k-th arm on the k-th slider of the list. A ball joint
/// at the slider's origin holds the arm's tip, and the plane of the arm's axis and tip passes
/// through the origin of the leg's first joint.
fn arms(description: &Description, submechanism: &Submechanism) -> Option<Vec<Loop>> {
    let joints = &description.joints;
    let sliders = sliders(description, submechanism, 2)?;
    let platform = joints[platform(description, submechanism)?].child;
    let is_arm = |j: &&usize| {
        !submechanism.independent.contains(j)
            && carrier(description, joints[**j].parent) == carrier(description, platform)
    };
    let arms: Vec<usize> = submechanism.spanning_tree.iter().filter(is_arm).copied().collect();
    if arms.len() != sliders.len() {
        return None;
    }
    let mut loops = Vec::new();
    for (arm, slider) in arms.into_iter().zip(sliders) {
        let first =
            carrier(description, joints[carrier(description, joints[slider].parent)?].parent)?;
        let n = direction_in_root(description, arm)?;
        let tip = link_pose(description, joints[slider].child)?.p;
        let normal = unit(&n.cross(tip - link_pose(description, joints[arm].child)?.p))?;
        loops.push(spherical(description, slider, joints[arm].child));
        loops.push(Loop {
            name: joints[arm].name.clone(),
            predecessor: joints[arm].child,
            successor: joints[first].parent,
            cut: Cut::AtJoint(first),
            rows: vec![row(description, first, "plane", &normal)?],
        });
    }
    Some(loops)
}

/// The dependent sliders of the list, if they are that many.
fn sliders(
    description: &Description,
    submechanism: &Submechanism,
    count: usize,
) -> Option<Vec<usize>> {
    let slides = |j: &&usize| {
        description.joints[**j].kind == JointKind::Prismatic
            && !submechanism.independent.contains(j)
    };
    let sliders: Vec<usize> = submechanism.spanning_tree.iter().filter(slides).copied().collect();
    (sliders.len() == count).then_some(sliders)
}

/// The independent joint that carries no other one; it carries the platform.
fn platform(description: &Description, submechanism: &Submechanism) -> Option<usize> {
    let carries = |j: &usize| {
        submechanism.independent.iter().any(|other| other != j && is_above(description, *j, *other))
    };
    submechanism.independent.iter().find(|j| !carries(j)).copied()
}

/// The moving joint that carries a link.
fn carrier(description: &Description, mut link: usize) -> Option<usize> {
    for _ in 0..=description.joints.len() {
        let j = description.joints.iter().position(|joint| joint.child == link)?;
        if description.joints[j].kind != JointKind::Fixed {
            return Some(j);
        }
        link = description.joints[j].parent;
    }
    None
}

/// A ball joint between a slider's body and another link, at the slider's origin.
fn spherical(description: &Description, slider: usize, successor: usize) -> Loop {
    let row = |name: &str, k: usize| Row {
        name: name.into(),
        axis: std::array::from_fn(|i| if i == 3 + k { 1.0 } else { 0.0 }),
        against: None,
    };
    Loop {
        name: description.joints[slider].name.clone(),
        predecessor: description.joints[slider].child,
        successor,
        cut: Cut::AtJoint(slider),
        rows: vec![row("x", 0), row("y", 1), row("z", 2)],
    }
}

/// True when a joint lies on the path from the root to another.
fn is_above(description: &Description, j: usize, other: usize) -> bool {
    let joints = &description.joints;
    let below = |j: &usize| joints.iter().position(|joint| joint.child == joints[*j].parent);
    // joints of a file may form a cycle
    std::iter::successors(Some(other), below).skip(1).take(joints.len()).any(|at| at == j)
}

/// Axis of a joint at zero {root}.
fn direction_in_root(description: &Description, j: usize) -> Option<Vector3<Dd>> {
    let joint = &description.joints[j];
    Some(link_pose(description, joint.child)?.R.apply(vector(joint.axis)))
}
