//! A robot of one's own: a four-bar that its crank drives, from the text of a URDF and of the page
//! that says where its loop is cut.

use sarrus_client::{Options, Robot, Source};

const LINKS: [(&str, f64); 3] = [("crank", 0.2), ("coupler", 0.5), ("rocker", 0.4)];

/// Bars along z at zero, which turn about y: crank and rocker on the base, the coupler on the
/// crank. (x, z) of each joint in its parent.
const JOINTS: [(&str, &str, &str, f64, f64); 3] = [
    ("A", "base", "crank", 0.0, 0.0),
    ("B", "crank", "coupler", 0.0, 0.3),
    ("C", "base", "rocker", 0.5, 0.0),
];

fn urdf() -> String {
    let mut text = String::from("<robot name=\"four_bar\"><link name=\"base\"/>");
    for (link, mass) in LINKS {
        let inertia = 0.01 * mass;
        text += &format!(
            "<link name=\"{link}\"><inertial><mass value=\"{mass}\"/><origin xyz=\"0 0 0.15\"/>\
             <inertia ixx=\"{inertia}\" iyy=\"{inertia}\" izz=\"{inertia}\" \
             ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        );
    }
    for (joint, parent, child, x, z) in JOINTS {
        text += &format!(
            "<joint name=\"{joint}\" type=\"continuous\"><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/><origin xyz=\"{x} 0 {z}\"/><axis xyz=\"0 1 0\"/></joint>"
        );
    }
    text + "</robot>"
}

/// The coupler's end, 0.5 m ahead of B, stays 0.3 m up the rocker.
const SUBMECHANISMS: &str = "
submechanisms:
- name: bars
  type: 4B
  jointnames_spanningtree: [A, B, C]
  jointnames_independent: [A]
  jointnames_active: [A]
  loop_constraints:
  - predecessor_body: coupler
    successor_body: rocker
    predecessor_placement: {xyz: [0.5, 0, 0]}
    successor_placement: {xyz: [0, 0, 0.3]}
    cut_joint_type: planar_revolute
    axis: [0, 1, 0]
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let source =
        Source::Text { urdf: urdf().into(), submechanisms: Some(SUBMECHANISMS.as_bytes().into()) };
    let mut robot = Robot::load(&source, &Options::default())?;
    for closure in &robot.model().closures {
        println!("{}: {} ({})", closure.name, closure.type_name, closure.kind);
    }

    // all three angles from the crank's: a parallelogram's coupler does not turn
    let (mut q, mut qd, mut qdd) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    robot.state(&[0.3], &[1.0], &[0.0], &mut q, &mut qd, &mut qdd)?;
    println!("q: {q:?}");
    let mut tau_u = [0.0];
    robot.inverse_dynamics(&[0.3], &[1.0], &[0.0], &mut tau_u)?;
    println!("tau_u: {tau_u:?}");
    Ok(())
}
