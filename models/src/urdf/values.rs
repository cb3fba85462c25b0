//! The numbers of a URDF file whose walk found no error, by urdf-rs.

use sarrus_dynamics::description::{Inertial, JointKind, Limits, Placement};

use super::{Urdf, Weight};
use crate::report::Diagnostics;
use crate::text::Text;

/// Numbers of links and joints in the order of the file.
pub(crate) struct Values {
    pub(crate) inertials: Vec<Option<Inertial>>,
    pub(crate) joints: Vec<JointValues>,
}

/// Numbers of one joint.
pub(crate) struct JointValues {
    pub(crate) origin: Placement,
    pub(crate) axis: [f64; 3],
    pub(crate) limits: Option<Limits>,
}

/// Reads the numbers; `None` after an error.
pub(crate) fn values(text: &Text, urdf: &Urdf, diagnostics: &mut Diagnostics) -> Option<Values> {
    let robot = match urdf_rs::read_from_string(&without_unread(text, urdf)) {
        Ok(robot) => robot,
        Err(error) => {
            diagnostics.error(
                urdf.span,
                format!("urdf-rs cannot read the file: {error}"),
                "a URDF file",
                "correct what it names",
            );
            return None;
        }
    };
    let same_names = robot.links.iter().map(|link| &link.name).eq(urdf
        .links
        .iter()
        .filter(|link| link.is_written)
        .map(|link| &link.name))
        && robot.joints.iter().map(|joint| &joint.name).eq(&urdf.written_joints);
    if !same_names {
        diagnostics.error(
            urdf.span,
            "two readers of this file see different names",
            "plain names",
            "use letters, digits, _ and / in names",
        );
        return None;
    }
    let inertials = robot
        .links
        .iter()
        .zip(&urdf.links)
        .map(|(link, entry)| inertial(&link.inertial, entry.inertial))
        .chain(std::iter::repeat(None))
        .take(urdf.links.len())
        .collect();
    let joints = urdf.joints.iter().map(|entry| {
        let joint = robot.joints.get(entry.source)?;
        let [lower, upper] = if entry.has_range {
            [joint.limit.lower, joint.limit.upper]
        } else {
            [f64::NEG_INFINITY, f64::INFINITY]
        };
        let limits =
            Limits { lower, upper, velocity: joint.limit.velocity, effort: joint.limit.effort };
        let is_first = entry.part.is_none_or(|part| part.is_first());
        let axis = *joint.axis.xyz;
        Some(JointValues {
            origin: if is_first { placement(&joint.origin) } else { Placement::default() },
            axis: entry.part.map_or(axis, |part| part.axis(axis)),
            limits: match entry.kind {
                Some(JointKind::Revolute | JointKind::Prismatic) => Some(limits),
                Some(JointKind::Continuous) => {
                    Some(Limits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..limits })
                }
                _ => None,
            }
            .filter(|_| entry.has_limits),
        })
    });
    Some(Values { inertials, joints: joints.collect::<Option<_>>()? })
}

fn inertial(value: &urdf_rs::Inertial, entry: Weight) -> Option<Inertial> {
    let i = &value.inertia;
    let inertial = Inertial {
        origin: placement(&value.origin),
        mass: value.mass.value,
        inertia: [i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz],
    };
    matches!(entry, Weight::Given { .. }).then_some(inertial)
}

fn placement(pose: &urdf_rs::Pose) -> Placement {
    Placement { xyz: *pose.xyz, rpy: *pose.rpy }
}

/// The text for urdf-rs: without the elements that no part of sarrus reads, since a fault in a mesh
/// or plug-in is not a fault of the robot, and with the joint types by the names of urdf-rs.
fn without_unread(text: &Text, urdf: &Urdf) -> String {
    let unread = urdf.unread.iter().map(|range| (range.clone(), ""));
    let mut changes: Vec<(core::ops::Range<usize>, &str)> =
        unread.chain(urdf.replaced.iter().cloned()).collect();
    changes.sort_by_key(|(range, _)| range.start);
    let mut kept = String::with_capacity(text.content.len());
    let mut at = 0;
    for (range, instead) in changes {
        if range.start >= at {
            kept.push_str(text.content.get(at..range.start).unwrap_or_default());
            kept.push_str(instead);
        }
        at = at.max(range.end);
    }
    kept.push_str(text.content.get(at..).unwrap_or_default());
    kept
}
