//! The spanning tree as a URDF.

use std::fmt::Write;

use sarrus_dynamics::description::{
    Coupling, Curve, Description, Inertial, Joint, JointKind, Placement,
};

use super::{attribute, is_single, list};
use crate::rewrite::number;

/// A limit that other readers of URDF take for none.
const NO_LIMIT: f64 = 1e9;

/// A frame that is fixed to a link, as a massless link of its own.
pub(super) struct Frame<'a> {
    pub(super) name: String,
    pub(super) link: &'a str,
    pub(super) place: Placement,
}

/// A text as an attribute's value.
pub(crate) fn escaped(text: &str) -> String {
    let pairs = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;")];
    pairs.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

fn origin(at: Placement) -> String {
    if at == Placement::default() {
        return String::new();
    }
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", list(&at.xyz), list(&at.rpy))
}

/// The URDF of this project, which reads each number again as it is.
pub(crate) fn text(of: &Description) -> String {
    // version 1.2 can leave a limit out
    written(of, &[], "1.2")
}

/// A URDF for readers that know version 1.0 alone and no ball joints: those are turns about x.
pub(super) fn plain(of: &Description, frames: &[Frame<'_>]) -> String {
    written(of, frames, "1.0")
}

fn written(of: &Description, frames: &[Frame<'_>], version: &str) -> String {
    let is_ours = version != "1.0";
    let mut text = format!("<robot name=\"{}\" version=\"{version}\">\n", escaped(&of.name));
    for of in &of.links {
        text += &link(&of.name, of.inertial);
    }
    for joint in &of.joints {
        text += &of_joint(of, joint, is_ours);
    }
    for frame in frames {
        text += &link(&frame.name, None);
        let _ = write!(text, "  <joint name=\"{}/joint\" type=\"fixed\">", escaped(&frame.name));
        text += &ends(frame.link, &frame.name);
        text += &(origin(frame.place) + "</joint>\n");
    }
    for joint in &of.joints {
        text += &transmission(of, joint);
    }
    text + "</robot>\n"
}

fn link(name: &str, inertial: Option<Inertial>) -> String {
    let Some(Inertial { origin: at, mass, inertia }) = inertial else {
        return format!("  <link name=\"{}\"/>\n", escaped(name));
    };
    let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
    let moments: String = names
        .iter()
        .zip(inertia)
        .map(|(name, value)| format!(" {name}=\"{}\"", number(value + 0.0)))
        .collect();
    format!(
        "  <link name=\"{}\">\n    <inertial>{}<mass value=\"{}\"/>\n      <inertia{moments}/>\
         </inertial>\n  </link>\n",
        escaped(name),
        origin(at),
        number(mass)
    )
}

fn ends(parent: &str, child: &str) -> String {
    format!("<parent link=\"{}\"/><child link=\"{}\"/>", escaped(parent), escaped(child))
}

fn of_joint(of: &Description, joint: &Joint, is_ours: bool) -> String {
    let kind = match joint.kind {
        JointKind::Fixed => "fixed",
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
        JointKind::Floating => "floating",
        JointKind::Spherical if is_ours => "spherical",
        _ => "continuous",
    };
    let [parent, child] = [joint.parent, joint.child].map(|link| &of.links[link].name);
    let mut text = format!("  <joint name=\"{}\" type=\"{kind}\">", escaped(&joint.name));
    text += &ends(parent, child);
    text += &origin(joint.origin);
    let is_single = is_single(joint);
    if is_single {
        let _ = write!(text, "<axis xyz=\"{}\"/>", list(&joint.axis));
    }
    if let Some(limits) = joint.limits.filter(|_| is_single) {
        let has_range = joint.kind != JointKind::Continuous;
        let all = [
            ("lower", limits.lower, has_range),
            ("upper", limits.upper, has_range),
            ("effort", limits.effort, true),
            ("velocity", limits.velocity, true),
        ];
        text += "<limit";
        for (name, value, _) in all.into_iter().filter(|(.., is_there)| *is_there) {
            if !is_ours {
                attribute(&mut text, name, &number(value.clamp(-NO_LIMIT, NO_LIMIT)));
            } else if value.is_finite() {
                attribute(&mut text, name, &number(value));
            }
        }
        text += "/>";
    }
    if let Some((coupling, (master, factor))) =
        joint.coupling.as_ref().and_then(|of| Some((of, *of.terms.first()?)))
        && coupling.terms.len() == 1
        && coupling.curves.is_empty()
    {
        let master = escaped(&of.joints[master].name);
        let _ = write!(
            text,
            "<mimic joint=\"{master}\" multiplier=\"{}\" offset=\"{}\"/>",
            number(factor),
            number(coupling.offset)
        );
    }
    let terms = joint.terms;
    let all = [
        ("damping", terms.damping, 0.0),
        ("friction", terms.friction.coulomb, 0.0),
        ("spring_stiffness", terms.stiffness, 0.0),
        ("spring_reference", terms.rest, 0.0),
        ("rotor_inertia", terms.rotor_inertia, 0.0),
        ("gear_ratio", terms.gear_ratio, 1.0),
    ];
    let mut dynamics = String::new();
    for (name, value, _) in all.into_iter().filter(|(_, value, usual)| value != usual) {
        attribute(&mut dynamics, name, &number(value));
    }
    // urdfdom refuses an element with neither damping nor friction
    let is_free = terms.damping == 0.0 && terms.friction.coulomb == 0.0;
    if is_free && !dynamics.is_empty() {
        attribute(&mut dynamics, "damping", "0");
    }
    if !dynamics.is_empty() && joint.kind != JointKind::Fixed {
        let _ = write!(text, "<dynamics{dynamics}/>");
    }
    text + "</joint>\n"
}

/// The coupling of a joint to several others.
fn transmission(of: &Description, joint: &Joint) -> String {
    let is_written = |of: &&Coupling| of.terms.len() > 1 || !of.curves.is_empty();
    let Some(coupling) = joint.coupling.as_ref().filter(is_written) else {
        return String::new();
    };
    let name = escaped(&joint.name);
    let mut text = format!("  <transmission name=\"{name}\">\n    <joint name=\"{name}\">\n");
    let linear =
        coupling.terms.iter().map(|(of, x)| (of, format!("multiplier=\"{}\"", number(*x))));
    let curves = coupling.curves.iter().map(|(of, curve)| (of, curve_text(curve)));
    for (k, (master, by)) in linear.chain(curves).enumerate() {
        let _ = writeln!(
            text,
            "      <depends_on joint=\"{}\" {by} offset=\"{}\"/>",
            escaped(&of.joints[*master].name),
            number(if k == 0 { coupling.offset } else { 0.0 })
        );
    }
    text + "    </joint>\n  </transmission>\n"
}

fn curve_text(curve: &Curve) -> String {
    match curve {
        Curve::Polynomial { about, coefficients } => {
            format!("polynomial=\"{}\" about=\"{}\"", list(coefficients), number(*about))
        }
        Curve::Table(points) => format!("table=\"{}\"", list(points.as_flattened())),
    }
}
