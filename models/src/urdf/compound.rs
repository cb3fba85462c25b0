//! Joints that are chains of joints with one axis each: `planar` and `universal`. The links between
//! them are massless, have the name of the joint before them, and are internal.

use std::collections::BTreeMap;

use sarrus_dynamics::description::{JointKind, Placement, Terms};

use super::joint::JointEntry;
use super::link::{LinkEntry, Weight};
use crate::report::{Diagnostics, quoted};
use crate::rotation::cross;

/// A joint of several axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Compound {
    /// Two translations in the plane across the axis, then the turn about it.
    Planar,
    /// A turn about the axis, then one about the second axis.
    Universal { axis2: [f64; 3] },
}

impl Compound {
    /// The names of the parts, behind that of the joint and a slash.
    const fn suffixes(self) -> &'static [&'static str] {
        match self {
            Compound::Planar => &["x", "y", "rz"],
            Compound::Universal { .. } => &["r1", "r2"],
        }
    }

    /// The axis of a part, where `axis` is that of the whole joint. The directions in the plane are
    /// x and y of the joint frame where the axis is z; else the frame's axis that is least along
    /// it, made perpendicular, and the cross product of the axis with this one.
    fn axis(self, part: usize, axis: [f64; 3]) -> [f64; 3] {
        match (self, part) {
            (Compound::Planar, 0) => across(axis),
            (Compound::Planar, 1) => cross(axis, across(axis)),
            (Compound::Universal { axis2 }, 1) => axis2,
            _ => axis,
        }
    }

    fn kind(self, part: usize, has_limits: bool) -> JointKind {
        match (self, part) {
            (Compound::Planar, 0 | 1) => JointKind::Prismatic,
            (Compound::Universal { .. }, _) if has_limits => JointKind::Revolute,
            _ => JointKind::Continuous,
        }
    }
}

/// Replaces each joint of several axes by its chain; the names of the parts by that of the whole.
pub(super) fn expand(
    joints: Vec<JointEntry>,
    links: &mut Vec<LinkEntry>,
    diagnostics: &mut Diagnostics,
) -> (Vec<JointEntry>, BTreeMap<String, Vec<String>>) {
    let mut chains = Vec::with_capacity(joints.len());
    let mut parts = BTreeMap::new();
    for joint in joints {
        let Some(compound) = joint.compound else {
            chains.push(joint);
            continue;
        };
        if !joint.masters.is_empty() {
            let found = format!("the joint {} is coupled", quoted(&joint.name));
            let help = "couple joints of one axis instead";
            diagnostics.error(joint.span, found, "a coupling of joints with one axis", help);
        }
        let suffixes = compound.suffixes();
        let names: Vec<String> =
            suffixes.iter().map(|suffix| format!("{}/{suffix}", joint.name)).collect();
        let mut parent = joint.parent.clone();
        for (index, name) in names.iter().enumerate() {
            let is_last = index + 1 == names.len();
            let child = if is_last {
                joint.child.clone()
            } else {
                links.push(LinkEntry {
                    name: name.clone(),
                    span: joint.span,
                    inertial: Weight::Absent,
                    is_written: false,
                });
                Some((name.clone(), joint.span))
            };
            chains.push(JointEntry {
                name: if joint.name.is_empty() { String::new() } else { name.clone() },
                span: joint.span,
                kind: Some(compound.kind(index, joint.limits.is_some())),
                compound: None,
                origin: if index == 0 { joint.origin } else { Placement::default() },
                axis: compound.axis(index, joint.axis),
                parent,
                child: child.clone(),
                limits: joint.limits.filter(|_| compound != Compound::Planar),
                masters: Vec::new(),
                independent: joint.independent,
                terms: if compound == Compound::Planar { Terms::default() } else { joint.terms },
                motor: None,
            });
            parent = child;
        }
        if !joint.name.is_empty() {
            parts.insert(joint.name, names);
        }
    }
    (chains, parts)
}

/// The axis of the frame that is least along a direction, made perpendicular to it.
fn across(axis: [f64; 3]) -> [f64; 3] {
    let least =
        (0..3).fold(0, |least, k| if axis[k].abs() < axis[least].abs() { k } else { least });
    let square: f64 = axis.iter().map(|x| x * x).sum();
    std::array::from_fn(|k| {
        let unit = if k == least { 1.0 } else { 0.0 };
        unit - axis[k] * axis[least] / square
    })
}
