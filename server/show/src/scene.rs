//! The robot as a page needs it: orders, limits, links, loops.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use sarrus_dynamics::JointLimits;
use sarrus_dynamics::description::{Cut, Description, Inertial, Joint, JointKind, Placement};
use sarrus_models::Loaded;
use serde_json::{Value, json};

use crate::Settings;
use crate::code::Code;

/// The robot as JSON.
pub(crate) fn scene(loaded: &Loaded, settings: &Settings, code: &Code) -> Value {
    let info = loaded.compiled.model.info();
    let description = &loaded.description;
    let coordinate = |name: &String| {
        let (joint, part) = name.split_once('/').unwrap_or((name, ""));
        let joint = description.joints.iter().find(|other| other.name == joint);
        let limit = |of: fn(JointLimits) -> Option<f64>| info.limits_of(name).and_then(of);
        json!({
            "name": name,
            "part": part,
            "slides": joint.is_some_and(|joint| joint.kind == JointKind::Prismatic),
            "lower": limit(|limits| limits.lower),
            "upper": limit(|limits| limits.upper),
            "velocity": limit(|limits| limits.velocity),
            "effort": limit(|limits| limits.effort),
        })
    };
    let coordinates = |names: &[String]| names.iter().map(coordinate).collect::<Vec<Value>>();
    json!({
        "name": description.name,
        "flags": settings.flags,
        "swing": settings.swing,
        "version": env!("CARGO_PKG_VERSION"),
        "fingerprint": format!("{:016x}", info.fingerprint),
        "operations": code.operations,
        "y": coordinates(&info.independent_q),
        "yd": info.independent,
        "u": coordinates(&info.active),
        "q": coordinates(&info.tree_q),
        "links": (0..description.links.len())
            .map(|link| link_of(description, link, code))
            .collect::<Vec<Value>>(),
        "loops": loops(description),
        "closed": info.sizes.n_c > 0,
        "tips": code.tips.iter().filter_map(|tip| info.links.get(usize::from(*tip)))
            .collect::<Vec<_>>(),
    })
}

fn link_of(description: &Description, link: usize, code: &Code) -> Value {
    let joint = description.joints.iter().find(|joint| joint.child == link);
    let kind = |joint: &Joint| match joint.kind {
        JointKind::Fixed => "fixed",
        JointKind::Revolute | JointKind::Continuous => "revolute",
        JointKind::Prismatic => "prismatic",
        JointKind::Spherical => "spherical",
        _ => "floating",
    };
    let joint = joint.map(|joint| {
        json!({
            "name": joint.name,
            "kind": kind(joint),
            "parent": joint.parent,
            "at": placement(&joint.origin),
            "axis": joint.axis,
        })
    });
    let of = description.links.get(link);
    json!({
        "name": of.map(|link| link.name.as_str()),
        "frame": code.links.iter().position(|other| *other == link),
        "joint": joint,
        "box": of.and_then(|link| link.inertial.as_ref()).and_then(equivalent_box),
    })
}

/// The loops: where their cut frames lie, or the link whose frame at zero they are.
fn loops(description: &Description) -> Vec<Value> {
    let all = description.submechanisms.iter().flat_map(|submechanism| &submechanism.loops);
    let value = |of: &sarrus_dynamics::description::Loop| {
        let at = match &of.cut {
            Cut::AtJoint(joint) => json!({ "link": description.joints.get(*joint)?.child }),
            Cut::AtLink(link) => json!({ "link": link }),
            Cut::Placed { predecessor, successor } => {
                json!({ "placed": [placement(predecessor), placement(successor)] })
            }
            _ => return None,
        };
        let [from, to] = [of.predecessor, of.successor];
        Some(json!({ "name": of.name, "predecessor": from, "successor": to, "at": at }))
    };
    all.filter_map(value).collect()
}

/// Position, then quaternion x, y, z, w.
pub(crate) fn placement(of: &Placement) -> Vec<f64> {
    let [roll, pitch, yaw] = of.rpy;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    of.xyz.iter().chain(turn.coords.iter()).copied().collect()
}

/// The box of the same inertia and mass: h_x² = 3 (I_y + I_z − I_x) / (2 m) of its half sides.
fn equivalent_box(of: &Inertial) -> Option<Value> {
    let [xx, xy, xz, yy, yz, zz] = of.inertia;
    let own = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigen();
    let mut axes = own.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let half = |k: usize| {
        let rest = own.eigenvalues.sum() - 2.0 * own.eigenvalues[k];
        (1.5 * rest.max(0.0) / of.mass).sqrt()
    };
    let half = [half(0), half(1), half(2)];
    let [roll, pitch, yaw] = of.origin.rpy;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        * UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let at: Vec<f64> = of.origin.xyz.iter().chain(turn.coords.iter()).copied().collect();
    (of.mass > 0.0).then(|| json!({ "mass": of.mass, "at": at, "half": half }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn the_equivalent_box_of_a_box_is_that_box() {
        // 2 kg, sides 0.2, 0.4, 0.6 along its axes
        let inertia = |a: f64, b: f64| 2.0 / 12.0 * (a * a + b * b);
        let [x, y, z] = [0.2, 0.4, 0.6];
        let own = [inertia(y, z), 0.0, 0.0, inertia(x, z), 0.0, inertia(x, y)];
        let origin = Placement { xyz: [1.0, 2.0, 3.0], rpy: [0.0; 3] };
        let found = equivalent_box(&Inertial { origin, mass: 2.0, inertia: own }).unwrap();
        let mut half: Vec<f64> =
            found["half"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        half.sort_by(f64::total_cmp);
        for (found, expected) in half.iter().zip([0.1, 0.2, 0.3]) {
            assert!((found - expected).abs() < 1e-14, "{half:?}");
        }
    }
}
