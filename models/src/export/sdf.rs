//! SDF, the format of Gazebo. A joint whose child has a parent already closes a loop.

use std::fmt::Write;

use sarrus_dynamics::Site;
use sarrus_dynamics::description::{Joint, JointKind};

use super::cuts::{Kind, held};
use super::{Out, inertial, list, pose};
use crate::mjcf::pose::Pose;
use crate::mjcf::write::escaped;
use crate::report::quoted;
use crate::rewrite::number;

/// Steps of 0.1 ms: loops are closed by velocities and drift.
const HEAD: &str = r#"<sdf version="1.11">
  <world name="default">
    <physics name="exact" type="dart">
      <max_step_size>0.0001</max_step_size>
      <real_time_factor>0</real_time_factor>
    </physics>
"#;

/// The world with its model.
pub(super) fn text(out: &mut Out<'_>) -> String {
    let mut text = HEAD.to_owned();
    let of = out.robot.of;
    let _ = writeln!(text, "    <gravity>{}</gravity>", list(&of.gravity));
    let _ = writeln!(text, "    <model name=\"{}\">", escaped(out.name));
    let root = out.robot.root;
    for (l, link) in of.links.iter().enumerate() {
        // the world has no link of its own
        if l == root && link.name == "world" {
            continue;
        }
        let _ = writeln!(text, "      <link name=\"{}\">", escaped(&link.name));
        let above = of.joints.iter().find(|joint| joint.child == l);
        if let Some(joint) = above {
            let parent = out.robot.link(joint.parent);
            text += &placed(pose(&joint.origin), if parent == "world" { "" } else { parent });
        }
        if let Some(inertial) = inertial(&out.robot, l).filter(|of| of.mass > 0.0) {
            text += "        <inertial>\n  ";
            text += &placed(pose(&inertial.origin), "");
            let _ = writeln!(text, "          <mass>{}</mass>", number(inertial.mass));
            text += "          <inertia>";
            let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
            for (name, value) in names.into_iter().zip(inertial.inertia) {
                let _ = write!(text, "<{name}>{}</{name}>", number(value));
            }
            text += "</inertia>\n        </inertial>\n";
        } else {
            // without mass it would weigh 1 kg
            text += "        <inertial><mass>1e-12</mass><inertia><ixx>1e-12</ixx><iyy>1e-12</iyy>\
                     <izz>1e-12</izz></inertia></inertial>\n";
        }
        text += "      </link>\n";
    }
    if out.robot.link(root) != "world" && !has_free_root(out) {
        let child = escaped(out.robot.link(root));
        let _ = writeln!(
            text,
            "      <joint name=\"{child}/world\" type=\"fixed\"><parent>world</parent>\
             <child>{child}</child></joint>"
        );
    }
    for (j, joint) in of.joints.iter().enumerate() {
        text += &of_joint(out, j, joint);
    }
    for (s, part) in of.submechanisms.iter().enumerate() {
        for (l, each) in part.loops.iter().enumerate() {
            let cut = held(&each.rows);
            let kind = match cut.kind {
                Kind::Point => "ball",
                Kind::Plane | Kind::Hinge => "revolute",
                Kind::Weld => "fixed",
                Kind::Slide => "prismatic",
                Kind::Universal => "universal",
                Kind::Other => {
                    let found =
                        format!("the cut {} holds a {}", quoted(&each.name), cut.kind.name());
                    let expected = "ball, revolute, fixed, prismatic or universal";
                    let help = "write the joint of the cut into the tree, and cut a body by a weld";
                    out.lost(Site::Loop(s, l), found, expected, help);
                    continue;
                }
            };
            let [_, place] = out.robot.places(each);
            let ends = [each.predecessor, each.successor].map(|link| out.robot.link(link));
            let name = format!("{}/{}", part.name, each.name);
            text += &open(&name, kind, ends);
            text += &placed(place, "");
            if !matches!(kind, "ball" | "fixed") {
                // {joint}: the axes of the successor's cut frame, those of the predecessor's at zero
                let _ = writeln!(text, "        <axis><xyz>{}</xyz></axis>", list(&unit(cut.axis)));
            }
            if kind == "universal" {
                let axis = list(&unit(cut.axis2));
                let _ = writeln!(text, "        <axis2><xyz>{axis}</xyz></axis2>");
            }
            text += "      </joint>\n";
        }
    }
    text + "    </model>\n  </world>\n</sdf>\n"
}

/// Whether the root link is the world of a free joint.
fn has_free_root(out: &Out<'_>) -> bool {
    let root = out.robot.root;
    inertial(&out.robot, root).is_none()
        && out.robot.below(root).any(|(_, joint)| joint.kind == JointKind::Floating)
        && out.robot.below(root).count() == 1
}

fn unit(axis: [f64; 3]) -> [f64; 3] {
    crate::mjcf::pose::unit(axis).unwrap_or(axis)
}

fn placed(at: Pose, relative_to: &str) -> String {
    let of = at.placement();
    if at == Pose::NONE && relative_to.is_empty() {
        return String::new();
    }
    let frame = match relative_to {
        "" => String::new(),
        name => format!(" relative_to=\"{}\"", escaped(name)),
    };
    format!("        <pose{frame}>{} {}</pose>\n", list(&of.xyz), list(&of.rpy))
}

fn open(name: &str, kind: &str, [parent, child]: [&str; 2]) -> String {
    let [name, parent, child] = [name, parent, child].map(escaped);
    format!(
        "      <joint name=\"{name}\" type=\"{kind}\">\n        <parent>{parent}</parent>\
         <child>{child}</child>\n"
    )
}

fn of_joint(out: &mut Out<'_>, j: usize, joint: &Joint) -> String {
    let kind = match joint.kind {
        JointKind::Fixed => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Spherical => "ball",
        // a link without a joint is free
        JointKind::Floating => {
            if !out.robot.stands(joint.parent) {
                let found = format!("the free joint {} on a moving link", quoted(&joint.name));
                let help = "write it as three sliders and a ball joint";
                out.lost(Site::Joint(j), found, "a free joint on the world", help);
            }
            return String::new();
        }
        _ => "revolute",
    };
    let terms = joint.terms;
    if terms.rotor_inertia != 0.0 {
        let found = format!("the rotor of {}", quoted(&joint.name));
        let help = "write it as a body, or choose the target mjcf";
        out.lost(Site::Joint(j), found, "a joint without a rotor", help);
    }
    let mut text =
        open(&joint.name, kind, [joint.parent, joint.child].map(|link| out.robot.link(link)));
    if !matches!(kind, "fixed" | "ball") {
        let axis = list(&unit(joint.axis));
        let _ = writeln!(text, "        <axis>\n          <xyz>{axis}</xyz>");
        let limits = joint.limits.iter().flat_map(|of| {
            [
                ("lower", of.lower),
                ("upper", of.upper),
                ("effort", of.effort),
                ("velocity", of.velocity),
            ]
        });
        let limits: String = limits
            .filter(|(_, value)| value.is_finite())
            .map(|(name, value)| format!("<{name}>{}</{name}>", number(value)))
            .collect();
        let _ = writeln!(text, "          <limit>{limits}</limit>");
        let dynamics: String = [
            ("damping", terms.damping),
            ("friction", terms.friction.coulomb),
            ("spring_stiffness", terms.stiffness),
            ("spring_reference", terms.rest),
        ]
        .into_iter()
        .filter(|(_, value)| *value != 0.0)
        .map(|(name, value)| format!("<{name}>{}</{name}>", number(value)))
        .collect();
        if !dynamics.is_empty() {
            let _ = writeln!(text, "          <dynamics>{dynamics}</dynamics>");
        }
        match joint.coupling.as_ref().map(|of| (of.terms.as_slice(), of.offset)) {
            Some(([(master, factor)], offset)) => {
                let _ = writeln!(
                    text,
                    "          <mimic joint=\"{}\"><multiplier>{}</multiplier>\
                     <offset>{}</offset><reference>0</reference></mimic>",
                    escaped(&out.robot.of.joints[*master].name),
                    number(*factor),
                    number(offset)
                );
            }
            Some(_) => {
                let found = format!("{} follows several joints", quoted(&joint.name));
                let help = "choose the target mjcf";
                out.lost(Site::Joint(j), found, "one joint that it follows", help);
            }
            None => {}
        }
        text += "        </axis>\n";
    }
    text + "      </joint>\n"
}
