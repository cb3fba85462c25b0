//! Each kind of cut joint leaves the motions of its joint free.

use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::*;

/// A body on six joints, with a seventh above them for the weld, and one cut of the given kind
/// between the body and the base.
fn cut_body(cut: &str, independent: &str) -> Source {
    const BODY: &str = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" \
        iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>";
    let joints = [
        ("s", "0.6 0 0.8"),
        ("x", "1 0 0"),
        ("y", "0 1 0"),
        ("z", "0 0 1"),
        ("rx", "1 0 0"),
        ("ry", "0 1 0"),
        ("rz", "0 0 1"),
    ];
    let skipped = usize::from(!cut.contains("weld"));
    let mut urdf = "<robot name=\"r\"><link name=\"base\"/>\n".to_owned();
    let mut parent = "base".to_owned();
    let mut names = Vec::new();
    for (name, axis) in &joints[skipped..] {
        let child = if *name == "rz" { "body".to_owned() } else { format!("{name}_link") };
        let kind = if name.len() == 1 && *name != "s" { "prismatic" } else { "revolute" };
        urdf += &format!(
            "<link name=\"{child}\">{BODY}</link><joint name=\"{name}\" type=\"{kind}\"><parent \
             link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" \
             upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>\n"
        );
        parent = child;
        names.push(*name);
    }
    let yaml = format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: r\n  jointnames_spanningtree: \
         [{}]\n  jointnames_independent: [{independent}]\n  jointnames_active: [{independent}]\n  \
         loop_constraints:\n  - cut_joint: c\n    predecessor_body: base\n    successor_body: \
         body\n    predecessor_placement: {{xyz: [{XYZ}], rpy: [{RPY}]}}\n    successor_placement: \
         {{xyz: [{XYZ}], rpy: [{RPY}]}}\n    cut_joint_type: {cut}\n",
        names.join(", ")
    );
    Source::Text { urdf: (urdf + "</robot>").into_bytes(), submechanisms: Some(yaml.into_bytes()) }
}

const XYZ: &str = "0.3, -0.2, 0.4";
const RPY: &str = "0.5, -0.3, 0.8";
const AXIS: [f64; 3] = [0.36, 0.48, -0.8];
const AXIS2: [f64; 3] = [0.8, -0.6, 0.0];

/// Rz(yaw) Ry(pitch) Rx(roll) x of the cut frames, or its inverse.
fn cut_frame(x: [f64; 3], inverse: bool) -> [f64; 3] {
    let mut turns = [(1, 2, 0.5), (2, 0, -0.3), (0, 1, 0.8)];
    if inverse {
        turns.reverse();
    }
    turns.into_iter().fold(x, |mut x, (i, j, angle)| {
        let (s, c) = f64::sin_cos(if inverse { -angle } else { angle });
        (x[i], x[j]) = (c * x[i] - s * x[j], s * x[i] + c * x[j]);
        x
    })
}

#[test]
fn a_cut_by_name_leaves_exactly_the_motions_of_its_joint_at_finite_angles() {
    let one = format!("\n    axis: {AXIS:?}");
    let two = format!("{one}\n    axis2: {AXIS2:?}");
    // the cut's invariants: the origin in all directions or across the axis, all rotations or the
    // axis, both axes of a universal joint
    for (kind, axes, independent, point, line, turn, axis, cross) in [
        ("spherical", "", "rx, ry, rz", true, true, false, false, false),
        ("planar_revolute", &one, "z, rx, ry, rz", false, true, false, false, false),
        ("revolute", &one, "rz", true, true, false, true, false),
        ("cylindrical", &one, "z, rz", false, true, false, true, false),
        ("prismatic", &one, "z", false, true, true, true, false),
        ("universal", &two, "rx, ry", true, true, false, false, true),
        ("weld", "", "s", true, true, true, true, false),
    ] {
        let mut robot =
            Robot::new(compiled(&cut_body(&format!("{kind}{axes}"), independent)).model);
        for k in 0..20 {
            let y = Seeded::new(k).numbers(robot.model.sizes().n_vy, 0.7);
            let body = pose(&mut robot, "body", &y);
            // the motion of the successor's cut frame relative to the predecessor's
            let moved = |x: [f64; 3]| {
                let out = cut_frame(x, false);
                let there = point_of(&body, std::array::from_fn(|i| out[i] + [0.3, -0.2, 0.4][i]));
                cut_frame(std::array::from_fn(|i| there[i] - [0.3, -0.2, 0.4][i]), true)
            };
            let origin = moved([0.0; 3]);
            let turned =
                |x: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| moved(x)[i] - origin[i]) };
            let along: f64 = (0..3).map(|i| AXIS[i] * origin[i]).sum();
            let what = |which: &str| format!("{kind} at {y:?}: {which}");
            if point {
                assert_close(&what("point"), &origin, &[0.0; 3], 1.0, 1e-14);
            }
            if line {
                assert_close(&what("line"), &origin, &AXIS.map(|x| x * along), 1.0, 1e-14);
            }
            if turn {
                assert_close(&what("turn"), &turned(AXIS2), &AXIS2, 1.0, 1e-14);
            }
            if axis {
                assert_close(&what("axis"), &turned(AXIS), &AXIS, 1.0, 1e-14);
            }
            if cross {
                let second = turned(AXIS2);
                let cosine: f64 = (0..3).map(|i| AXIS[i] * second[i]).sum();
                assert_close(&what("cross"), &[cosine], &[0.0], 1.0, 1e-14);
            }
        }
    }
}
