//! The submechanism file in its canonical form: every key at its place, cuts by their rows.

use std::fmt::Write;

use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::{
    Cut, Description, Friction, Joint, Loop, Motor, Placement, Submechanism,
};

use super::listed;
use crate::rewrite::number;
use crate::suggest::word;
use crate::tree::Tree;

/// The file.
pub(crate) fn text(of: &Description) -> String {
    let mut text = "submechanisms:\n".to_owned();
    let robot = Tree::new(of);
    for part in &of.submechanisms {
        text += &entry(&robot, part);
    }
    let motors: String = of.joints.iter().filter_map(actuator).collect();
    if !motors.is_empty() {
        text += &format!("actuators:\n{motors}");
    }
    text
}

fn entry(robot: &Tree<'_>, part: &Submechanism) -> String {
    let names = |of: &[usize]| {
        let names = of.iter().filter_map(|joint| robot.of.joints.get(*joint));
        names.map(|joint| word(&joint.name)).collect::<Vec<_>>().join(", ")
    };
    let mut text = format!(
        "- type: {}\n  contextual_name: {}\n  jointnames_spanningtree: [{}]\n  \
         jointnames_independent: [{}]\n  jointnames_active: [{}]\n",
        word(&part.type_name),
        word(&part.name),
        names(&part.spanning_tree),
        names(&part.independent),
        names(&part.active)
    );
    if !part.closed_forms {
        text += "  closed_forms: off\n";
    }
    if !part.loops.is_empty() {
        text += "  loop_constraints:\n";
    }
    for of in &part.loops {
        text += &cut(robot, of);
    }
    text
}

fn cut(robot: &Tree<'_>, of: &Loop) -> String {
    let mut text = format!(
        "  - cut_joint: {}\n    predecessor_body: {}\n    successor_body: {}\n",
        word(&of.name),
        word(robot.link(of.predecessor)),
        word(robot.link(of.successor))
    );
    // the name of a joint places the cut, any other one at the predecessor
    let named = robot.of.joints.iter().position(|joint| joint.name == of.name);
    let is_by_name = match of.cut {
        Cut::AtJoint(joint) => named == Some(joint),
        Cut::AtLink(link) => named.is_none() && link == of.predecessor,
        _ => false,
    };
    let places = match of.cut {
        Cut::Placed { predecessor, successor } => [predecessor, successor],
        _ => robot.places(of).map(|place| place.placement()),
    };
    if !is_by_name {
        for (key, Placement { xyz, rpy }) in ["predecessor", "successor"].iter().zip(places) {
            let [xyz, rpy] = [xyz, rpy].map(|of| listed(&of, ", "));
            let _ = writeln!(text, "    {key}_placement: {{xyz: [{xyz}], rpy: [{rpy}]}}");
        }
    }
    if let Some((row, against)) = of.rows.iter().find_map(|row| Some((row, row.against?))) {
        let [axis, axis2] = [&row.axis[..3], &against].map(|of| listed(of, ", "));
        let _ = writeln!(
            text,
            "    cut_joint_type: universal\n    axis: [{axis}]\n    axis2: [{axis2}]"
        );
        return text;
    }
    let named = [("spherical", CutJoint::Spherical), ("weld", CutJoint::Weld)];
    if let Some((kind, _)) = named.into_iter().find(|(_, joint)| joint.rows() == of.rows) {
        let _ = writeln!(text, "    cut_joint_type: {kind}");
        return text;
    }
    text += "    constraint_axes:\n";
    for row in &of.rows {
        let axis = listed(&row.axis, ", ");
        let _ = writeln!(text, "    - {{name: {}, axis: [{axis}]}}", word(&row.name));
    }
    text
}

/// The motor of a joint that has one.
fn actuator(joint: &Joint) -> Option<String> {
    let Motor { continuous, thermal_time, series_stiffness, driving, braking, power, efficiency } =
        joint.motor.as_ref()?;
    let mut text = format!("- joint: {}\n", word(&joint.name));
    let limits = joint.limits;
    for (key, value) in [
        ("peak_torque", limits.map_or(f64::INFINITY, |of| of.effort)),
        ("continuous_torque", *continuous),
        ("thermal_time", *thermal_time),
        ("series_stiffness", *series_stiffness),
        ("max_speed", limits.map_or(f64::INFINITY, |of| of.velocity)),
        ("power", *power),
    ] {
        if value.is_finite() && value > 0.0 {
            let _ = writeln!(text, "  {key}: {}", number(value));
        }
    }
    for (key, points) in [("torque_speed", driving), ("braking_torque_speed", braking)] {
        let points: Vec<String> =
            points.iter().map(|point| format!("[{}]", listed(point, ", "))).collect();
        if !points.is_empty() {
            let _ = writeln!(text, "  {key}: [{}]", points.join(", "));
        }
    }
    if *efficiency != [1.0; 2] {
        let _ = writeln!(text, "  efficiency: [{}]", listed(efficiency, ", "));
    }
    let friction = joint.terms.friction;
    if friction != (Friction { coulomb: friction.coulomb, ..Friction::default() }) {
        let Friction { coulomb, viscous, speed } = friction;
        let [coulomb, viscous, speed] = [coulomb, viscous, speed].map(number);
        let _ = writeln!(
            text,
            "  friction: {{coulomb: {coulomb}, viscous: {viscous}, speed: {speed}}}"
        );
    }
    Some(text)
}
