//! Dimensions that follow from a robot's files, for a comparison with its drawings: lengths in the
//! loops, the range in which each loop closes, densities.

use std::f64::consts::PI;

use sarrus_dynamics::description::{Description, JointKind, Link, Loop};
use sarrus_dynamics::{
    Field, FieldSet, Model, Plan, Query, Request, Site, Status, Workspace, loops_of,
};
use serde::Serialize;

use crate::build::Spans;
use crate::pose::minus;
use crate::report::{Diagnostics, quoted};
use crate::rotation::{cross, dot, rotated};
use crate::tree::Tree;
use crate::units::least_density;

/// Steps from the zero pose to the end of a range, and halvings of the last one.
const STEPS: usize = 64;
const HALVINGS: usize = 40;
/// Part of a range that a limit may lie beyond it.
const BEYOND: f64 = 1e-6;

/// Dimensions of a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Dimensions {
    /// Distances between the joints of each loop, around it.
    pub lengths: Vec<Length>,
    /// Independents of loops.
    pub ranges: Vec<Range>,
    /// Links with a mass and an inertia.
    pub densities: Vec<Density>,
}

/// The distance between two joints of a loop on one link, at zero: between parallel axes where all
/// turns of the loop have one direction, else between origins. The cut counts as a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Length {
    /// Name of the cut.
    pub cut: String,
    /// The link.
    pub link: String,
    /// Joint at one end, or the cut.
    pub from: String,
    /// Joint at the other end, or the cut.
    pub to: String,
    /// Distance `[m]`.
    pub length: f64,
}

/// The range of an independent joint around zero in which its loops close, with all other
/// independents at zero.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Range {
    /// The joint.
    pub name: String,
    /// Its lower limit.
    pub lower: Option<f64>,
    /// Its upper limit.
    pub upper: Option<f64>,
    /// Least position that closes; `None` where there is no end up to half a turn, or the length of
    /// the loops.
    pub closes_from: Option<f64>,
    /// Greatest position that closes, likewise.
    pub closes_to: Option<f64>,
}

/// The least density of a link: that of a ball with its mass and its largest moment of inertia
/// `[kg/m³]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Density {
    /// The link.
    pub link: String,
    /// Its mass `[kg]`.
    pub mass: f64,
    /// The density `[kg/m³]`.
    pub density: f64,
}

impl Dimensions {
    /// The dimensions; warns of limits beyond the range in which the loops close.
    pub(crate) fn new(
        description: &Description,
        model: &Model,
        spans: &Spans,
        diagnostics: &mut Diagnostics,
    ) -> Dimensions {
        let tree = Tree::new(description);
        let lengths: Vec<Length> = (0..description.submechanisms.len())
            .flat_map(|s| loops_of(description, s))
            .flat_map(|of| lengths(&tree, &of))
            .collect();
        let density = |link: &Link| {
            let inertial = link.inertial.as_ref().filter(|of| of.mass > 0.0)?;
            let density = least_density(inertial).filter(|density| density.is_finite())?;
            Some(Density { link: link.name.clone(), mass: inertial.mass, density })
        };
        Dimensions {
            ranges: ranges(description, model, &lengths, spans, diagnostics),
            densities: description.links.iter().filter_map(density).collect(),
            lengths,
        }
    }
}

/// The lengths of a loop, from the cut along the predecessor's joints and back.
fn lengths(tree: &Tree<'_>, of: &Loop) -> Vec<Length> {
    let joints = &tree.of.joints;
    let mut down = tree.carriers(of.predecessor);
    let mut up = tree.carriers(of.successor);
    while down.last().is_some() && down.last() == up.last() {
        down.pop();
        up.pop();
    }
    let [first, last] = tree.ends(of).map(|end| end.p);
    // the ends on each link, and the link
    let ring: Vec<usize> = down.iter().chain(up.iter().rev()).copied().collect();
    let base = ring.get(down.len().saturating_sub(1)).map_or(of.predecessor, |j| joints[*j].parent);
    let mut links: Vec<usize> = down.iter().map(|j| joints[*j].child).collect();
    links.push(if down.is_empty() { of.predecessor } else { base });
    links.extend(up.iter().rev().map(|j| joints[*j].child));
    let mut ends = vec![(of.name.as_str(), first)];
    ends.extend(ring.iter().map(|j| (joints[*j].name.as_str(), tree.zero[joints[*j].child].p)));
    ends.push((of.name.as_str(), last));
    let normal = normal(tree, &ring);
    let length = |(link, pair): (&usize, &[(&str, [f64; 3])])| {
        let [(from, p), (to, q)] = pair else { return None };
        let d = minus(*q, *p);
        let across = normal.map_or(d, |normal| cross(normal, d));
        let length = dot(across, across).sqrt();
        // the parts of a universal joint meet in one point
        (length > 1e-12).then(|| Length {
            cut: of.name.clone(),
            link: tree.link(*link).to_owned(),
            from: (*from).to_owned(),
            to: (*to).to_owned(),
            length,
        })
    };
    links.iter().zip(ends.windows(2)).filter_map(length).collect()
}

/// The direction of all turns of a loop, if they have one.
fn normal(tree: &Tree<'_>, ring: &[usize]) -> Option<[f64; 3]> {
    let mut normal: Option<[f64; 3]> = None;
    for joint in ring.iter().map(|j| &tree.of.joints[*j]) {
        match joint.kind {
            JointKind::Prismatic => continue,
            JointKind::Revolute | JointKind::Continuous => {}
            _ => return None,
        }
        let axis = rotated(tree.zero[joint.child].r, joint.axis);
        let unit = axis.map(|x| x / dot(axis, axis).sqrt());
        let off = normal.map_or([0.0; 3], |normal| cross(normal, unit));
        if dot(off, off).sqrt() > 1e-6 {
            return None;
        }
        normal = Some(unit);
    }
    normal
}

/// The ranges of the independents of loops, by kinematics without a guess.
fn ranges(
    description: &Description,
    model: &Model,
    lengths: &[Length],
    spans: &Spans,
    diagnostics: &mut Diagnostics,
) -> Vec<Range> {
    let query =
        Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));
    let Ok(plan) = Plan::new(model, &query) else { return Vec::new() };
    let mut workspace = Workspace::new(model);
    let mut q = vec![0.0; model.tree_q_names().len()];
    let names = model.independent_q_names();
    let zero: Vec<f64> =
        names.iter().map(|name| f64::from(u8::from(name.ends_with("/qw")))).collect();
    let mut found = Vec::new();
    let closed =
        description.submechanisms.iter().zip(model.closures()).filter(|(_, of)| of.rows > 0);
    for j in closed.flat_map(|(of, _)| of.independent.iter().copied()) {
        let joint = &description.joints[j];
        let Some(k) = names.iter().position(|name| *name == joint.name) else { continue };
        let limits = joint.limits.map(|limits| limits.finite());
        let [lower, upper] = limits.map_or([None; 2], |limits| [limits.lower, limits.upper]);
        let size = if joint.kind == JointKind::Prismatic {
            lengths.iter().map(|of| of.length).fold(0.0, f64::max) * 4.0
        } else {
            PI
        };
        let mut closes = |at: f64| {
            let mut y = zero.clone();
            y[k] = at;
            plan.run(model, &mut workspace, &y, &mut q).status == Status::Ok
        };
        let mut end = |limit: Option<f64>, sign: f64| {
            let most = limit.map_or(size, |limit| size.max(sign * limit));
            last(&mut |at| closes(sign * at), most).map(|at| sign * at + 0.0)
        };
        let closes_from = end(lower, -1.0);
        let closes_to = end(upper, 1.0);
        let range = Range { name: joint.name.clone(), lower, upper, closes_from, closes_to };
        if range.has_limits_beyond() {
            let found = format!("the loops of {} close {}", quoted(&joint.name), range.in_words());
            let expected = "limits within this range";
            let help = "correct the limits, or the lengths of the loops that `check` prints";
            diagnostics.warning(spans.of(Site::Joint(j)), found, expected, help);
        }
        found.push(range);
    }
    found
}

impl Range {
    fn has_limits_beyond(&self) -> bool {
        let beyond = |limit: Option<f64>, end: Option<f64>, sign: f64| {
            limit
                .zip(end)
                .is_some_and(|(limit, end)| sign * (limit - end) > BEYOND * (1.0 + end.abs()))
        };
        beyond(self.lower, self.closes_from, -1.0) || beyond(self.upper, self.closes_to, 1.0)
    }

    /// "from … to …"; an end that was not found is left out.
    pub fn in_words(&self) -> String {
        match (self.closes_from, self.closes_to) {
            (Some(from), Some(to)) => format!("from {from:.4} to {to:.4}"),
            (Some(from), None) => format!("from {from:.4} on"),
            (None, Some(to)) => format!("up to {to:.4}"),
            (None, None) => "everywhere".to_owned(),
        }
    }
}

/// The last position up to `most` before the first that does not close; `None` where all close.
fn last(closes: &mut dyn FnMut(f64) -> bool, most: f64) -> Option<f64> {
    let step = most / STEPS as f64;
    let first = (1..=STEPS).map(|k| k as f64 * step).find(|at| !closes(*at))?;
    let mut range = [first - step, first];
    for _ in 0..HALVINGS {
        let middle = 0.5 * (range[0] + range[1]);
        range[usize::from(!closes(middle))] = middle;
    }
    Some(range[0])
}
