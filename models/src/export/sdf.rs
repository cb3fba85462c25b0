//! SDF, the format of Gazebo. A joint whose child has a parent already closes a loop.

use std::fmt::Write;

use sarrus_dynamics::Site;
use sarrus_dynamics::description::{Description, Joint, JointKind, Loop};

use super::cuts::{Kind, held};
use super::urdf::escaped;
use super::{Out, has_terms, list};
use crate::pose::{Pose, unit};
use crate::report::quoted;
use crate::rewrite::number;
use crate::rotation::rotated;

/// Steps of 0.1 ms: loops are closed by velocities and drift.
const HEAD: &str = r#"<sdf version="1.11">
  <world name="default">
    <physics name="exact" type="dart">
      <max_step_size>0.0001</max_step_size>
      <real_time_factor>0</real_time_factor>
    </physics>
"#;

/// A link without mass.
const MASSLESS: &str = "        <inertial><mass>1e-12</mass><inertia><ixx>1e-12</ixx>\
                        <iyy>1e-12</iyy><izz>1e-12</izz></inertia></inertial>\n";

/// The plug-in that applies a force to a joint.
const FORCE: &str = "      <plugin filename=\"gz-sim-apply-joint-force-system\" \
                     name=\"gz::sim::systems::ApplyJointForce\">";

/// Gives each joint a name that no link has.
pub(super) fn rename(of: &mut Description) {
    for j in 0..of.joints.len() {
        let taken = of.links.iter().map(|of| &of.name);
        let taken = taken.chain(of.joints[..j].iter().map(|of| &of.name));
        let taken: Vec<String> = taken.cloned().collect();
        while taken.contains(&of.joints[j].name) {
            of.joints[j].name.push_str("_joint");
        }
    }
}

/// The world with its model.
pub(super) fn text(out: &mut Out<'_>) -> String {
    let mut text = HEAD.to_owned();
    let of = out.robot.of;
    let _ = writeln!(text, "    <gravity>{}</gravity>", list(&of.gravity));
    let _ = writeln!(text, "    <model name=\"{}\">", escaped(out.name));
    let root = out.robot.root;
    // the world has no link of its own
    let is_world = out.robot.link(root) == "world";
    for link in (0..of.links.len()).filter(|link| *link != root || !is_world) {
        text += &of_link(out, link);
    }
    if !is_world {
        let [name, child] =
            [format!("{}/world", out.robot.link(root)), out.robot.link(root).into()];
        text += &open(&name, "fixed", ["world", &child]);
        text += "      </joint>\n";
    }
    for (j, joint) in of.joints.iter().enumerate() {
        text += &of_joint(out, j, joint);
    }
    for (s, part) in of.submechanisms.iter().enumerate() {
        for (l, each) in part.loops.iter().enumerate() {
            text += &of_loop(out, (s, l), &format!("{}/{}", part.name, each.name), each);
        }
    }
    for (j, joint) in out.loaded.description.joints.iter().enumerate() {
        let name = &of.joints[j].name;
        if *name != joint.name {
            let found = format!("the joint {} is {} there", quoted(&joint.name), quoted(name));
            out.note(Site::Joint(j), found, "a link has its name");
        }
    }
    for joint in out.robot.active() {
        let name = escaped(&joint.name);
        let _ = writeln!(text, "{FORCE}\n        <joint_name>{name}</joint_name>\n      </plugin>");
    }
    text + "    </model>\n  </world>\n</sdf>\n"
}

fn of_link(out: &Out<'_>, link: usize) -> String {
    let of = out.robot.of;
    let mut text = format!("      <link name=\"{}\">\n", escaped(out.robot.link(link)));
    if let Some(joint) = of.joints.iter().find(|joint| joint.child == link) {
        let parent = out.robot.link(joint.parent);
        text += &placed(Pose::of(&joint.origin), if parent == "world" { "" } else { parent });
    }
    if let Some(inertial) = of.links[link].inertial.filter(|of| of.mass > 0.0) {
        text += &format!("        <inertial>\n{}", placed(Pose::of(&inertial.origin), ""));
        let _ = write!(text, "        <mass>{}</mass><inertia>", number(inertial.mass));
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        text += &elements(names.into_iter().zip(inertial.inertia));
        text += "</inertia>\n        </inertial>\n";
    } else {
        // without mass it would weigh 1 kg
        text += MASSLESS;
    }
    text + "      </link>\n"
}

/// The joint that closes a loop.
fn of_loop(out: &mut Out<'_>, (s, l): (usize, usize), name: &str, of: &Loop) -> String {
    let cut = held(&of.rows);
    let kind = match cut.kind {
        Kind::Point => "ball",
        Kind::Plane | Kind::Hinge => "revolute",
        Kind::Weld => "fixed",
        Kind::Slide => "prismatic",
        Kind::Universal => "universal",
        Kind::Other => {
            let expected = "ball, revolute, fixed, prismatic or universal";
            out.lost_cut((s, l), of, cut.kind, expected);
            return String::new();
        }
    };
    let ends = [of.predecessor, of.successor].map(|link| out.robot.link(link));
    let mut text = open(name, kind, ends);
    text += &placed(out.robot.places(of)[1], "");
    // in the successor's cut frame
    let [first, second] = out.robot.ends(of);
    let turn = second.inverse().then(first).r;
    let axes = match kind {
        "ball" | "fixed" => "",
        "universal" => "axis axis2",
        _ => "axis",
    };
    for (name, axis) in axes.split_whitespace().zip([rotated(turn, cut.axis), cut.axis2]) {
        let axis = list(&unit(axis).unwrap_or(axis));
        let _ = writeln!(text, "        <{name}><xyz>{axis}</xyz></{name}>");
    }
    text + "      </joint>\n"
}

/// An element for each name with its number.
fn elements<'a>(of: impl Iterator<Item = (&'a str, f64)>) -> String {
    of.map(|(name, value)| format!("<{name}>{}</{name}>", number(value))).collect()
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
            out.check_free(j, joint);
            return String::new();
        }
        _ => "revolute",
    };
    let terms = joint.terms;
    if kind == "ball" && has_terms(joint) {
        let found = format!("the ball joint {} has a spring or a damper", quoted(&joint.name));
        out.lost(Site::Joint(j), found, "none of them", "choose the target mjcf");
    }
    if terms.rotor_inertia != 0.0 {
        let found = format!("the rotor of {}", quoted(&joint.name));
        let help = "write it as a body, or choose the target mjcf";
        out.lost(Site::Joint(j), found, "a joint without a rotor", help);
    }
    let mut text =
        open(&joint.name, kind, [joint.parent, joint.child].map(|link| out.robot.link(link)));
    if !matches!(kind, "fixed" | "ball") {
        let axis = list(&unit(joint.axis).unwrap_or(joint.axis));
        let _ = writeln!(text, "        <axis>\n          <xyz>{axis}</xyz>");
        let limits = joint.limits.iter().flat_map(|of| {
            [
                ("lower", of.lower),
                ("upper", of.upper),
                ("effort", of.effort),
                ("velocity", of.velocity),
            ]
        });
        let limits = elements(limits.filter(|(_, value)| value.is_finite()));
        let _ = writeln!(text, "          <limit>{limits}</limit>");
        let dynamics = [
            ("damping", terms.damping),
            ("friction", terms.friction.coulomb),
            ("spring_stiffness", terms.stiffness),
            ("spring_reference", terms.rest),
        ];
        let dynamics = elements(dynamics.into_iter().filter(|(_, value)| *value != 0.0));
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
