//! URDF, and a Python file that builds a model of Pinocchio with the constraints of its loops.

use std::fmt::Write;

use sarrus_dynamics::description::{Joint, JointKind};

use super::cuts::Tie;
use super::{Out, has_terms, listed, urdf};
use crate::rewrite::number;

/// The functions, behind the tables of a robot.
const LOAD: &str = include_str!("pinocchio.py");

/// A text as a literal of Python.
fn literal(text: &str) -> String {
    let escaped: String = text
        .chars()
        .map(|c| match c {
            '"' | '\\' => format!("\\{c}"),
            c if c.is_control() => format!("\\x{:02x}", u32::from(c)),
            c => c.to_string(),
        })
        .collect();
    format!("\"{escaped}\"")
}

/// URDF and Python.
pub(super) fn texts(out: &mut Out<'_>, ties: &[Tie]) -> Vec<(&'static str, String)> {
    let of = out.robot.of;
    let mut text = format!(
        "\"\"\"A robot for Pinocchio: the tree of {}.urdf, and all that a URDF lacks.\"\"\"\n\n\
         import pathlib\n\nimport numpy as np\nimport pinocchio as pin\n\n",
        out.name
    );
    let _ = writeln!(text, "URDF = {}", literal(&format!("{}.urdf", out.name)));
    let _ = writeln!(text, "GRAVITY = [{}]", listed(&of.gravity, ", "));
    let name = |joint: &Joint| literal(&joint.name);
    let of_kind = |kind: JointKind| of.joints.iter().filter(move |joint| joint.kind == kind);
    let balls: Vec<String> = of_kind(JointKind::Spherical).map(name).collect();
    let _ = writeln!(text, "# turns about x in the URDF\nBALLS = [{}]", balls.join(", "));
    let active: Vec<String> = out.robot.active().map(name).collect();
    let _ = writeln!(text, "ACTIVE = [{}]", active.join(", "));
    text += "# damping, stiffness, rest position, inertia of the rotor at the joint\nTERMS = {\n";
    for joint in of.joints.iter().filter(|joint| has_terms(joint)) {
        let terms = joint.terms;
        let rotor = terms.rotor_inertia * terms.gear_ratio * terms.gear_ratio;
        let all = listed(&[terms.damping, terms.stiffness, terms.rest, rotor], ", ");
        let _ = writeln!(text, "    {}: ({all}),", name(joint));
    }
    text += "}\n# joint = sum of factors times others + offset\nCOUPLINGS = [\n";
    for joint in &of.joints {
        let Some(coupling) = &joint.coupling else { continue };
        let terms: Vec<String> = coupling
            .terms
            .iter()
            .map(|(master, factor)| format!("{}: {}", name(&of.joints[*master]), number(*factor)))
            .collect();
        let terms = terms.join(", ");
        let _ = writeln!(text, "    ({}, {{{terms}}}, {}),", name(joint), number(coupling.offset));
    }
    text += "]\n# name, rows, and twice a link with x y z and quaternion x y z w of the frame\n\
             CUTS = [\n";
    for tie in ties {
        let rows = if tie.is_weld { 6 } else { 3 };
        let _ = write!(text, "    ({}, {rows}", literal(&tie.name));
        for (link, place) in tie.links.iter().zip(tie.places) {
            let all = listed(&[&place.p[..], &place.r[..]].concat(), ", ");
            let _ = write!(text, ",\n     {}, [{all}]", literal(out.robot.link(*link)));
        }
        text += "),\n";
    }
    text += "]\n";
    vec![(".py", text + LOAD), (".urdf", urdf::plain(of, &[]))]
}
