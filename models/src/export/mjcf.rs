//! MJCF, the format of MuJoCo.
//!
//! Its constraints are soft: an acceleration is wrong by about 1 − dmax. The file has the largest
//! dmax that MuJoCo takes, and an integrator that keeps the gaps of the loops at 1e-7 m.

use std::fmt::Write;

use sarrus_dynamics::Site;
use sarrus_dynamics::description::{Coupling, Curve, Inertial, Joint, JointKind};

use super::cuts::Tie;
use super::urdf::escaped;
use super::{Out, attribute, is_single, list};
use crate::inertia::principal;
use crate::pose::{Pose, of_axes};
use crate::report::quoted;
use crate::rewrite::number;

/// The least mass and moment of inertia of a body that moves, in MuJoCo 1e-15.
const LEAST: f64 = 2e-15;
/// Half of a range that has one end.
const FAR: f64 = 1e9;

/// Solver and integrator: a time step of 1 ms, whose double is the time constant of constraints.
const HEAD: &str = r#"  <compiler angle="radian" autolimits="true" fusestatic="false"/>
  <default>
    <equality solref="0.002 1" solimp="0.9999 0.9999 0.001 0.5 2"/>
  </default>
"#;

/// The model.
pub(super) fn text(out: &mut Out<'_>, ties: &[Tie]) -> String {
    let name = escaped(out.name);
    let gravity = list(&out.robot.of.gravity);
    let mut text = format!("<mujoco model=\"{name}\">\n{HEAD}");
    let _ = writeln!(
        text,
        "  <option gravity=\"{gravity}\" timestep=\"0.001\" integrator=\"RK4\" solver=\"Newton\" \
         iterations=\"100\" tolerance=\"1e-10\" jacobian=\"dense\"/>"
    );
    let mut bodies = Bodies { out, ties, light: 0, text: String::new() };
    bodies.world();
    let Bodies { light, text: bodies, .. } = bodies;
    let _ = write!(text, "  <worldbody>\n{bodies}  </worldbody>\n");
    if light > 0 {
        let found = format!("{light} massless links move: MuJoCo needs a mass, {LEAST:e} kg");
        out.note(Site::Robot, found, "nothing to do");
    }
    text += &tendons(out);
    text += &equalities(out, ties);
    text += &actuators(out);
    text + "</mujoco>\n"
}

struct Bodies<'o, 'a> {
    out: &'o mut Out<'a>,
    ties: &'o [Tie],
    /// The number of moving links without mass.
    light: usize,
    text: String,
}

impl Bodies<'_, '_> {
    fn world(&mut self) {
        let root = self.out.robot.root;
        // the world is no body of its own
        if self.out.robot.link(root) == "world" {
            if self.out.robot.of.links[root].inertial.is_some_and(|of| of.mass != 0.0) {
                let found = "the mass of the root link, which does not move, is left out";
                self.out.note(Site::Link(root), found.to_owned(), "nothing to do");
            }
            self.sites(root, 2);
            self.below(root, 2);
        } else {
            self.body(root, Pose::NONE, None, 2);
        }
        // free bodies hang on the world
        for joint in &self.out.robot.of.joints {
            if joint.kind == JointKind::Floating && self.out.robot.stands(joint.parent) {
                self.body(joint.child, self.out.robot.zero[joint.child], Some(joint), 2);
            }
        }
    }

    fn below(&mut self, link: usize, depth: usize) {
        for (j, joint) in self.out.robot.below(link) {
            if joint.kind == JointKind::Floating {
                self.out.check_free(j, joint);
                continue;
            }
            self.body(joint.child, Pose::of(&joint.origin), Some(joint), depth);
        }
    }

    fn body(&mut self, link: usize, at: Pose, joint: Option<&Joint>, depth: usize) {
        let indent = "  ".repeat(depth);
        let name = escaped(self.out.robot.link(link));
        let _ = writeln!(self.text, "{indent}<body name=\"{name}\"{}>", placed(at));
        let moving = joint.filter(|joint| joint.kind != JointKind::Fixed);
        if let Some(joint) = moving {
            self.text += &format!("{indent}  {}\n", of_joint(joint));
        }
        let found = self.out.robot.of.links[link].inertial;
        if found.is_some() || moving.is_some() {
            let of = found.unwrap_or(Inertial::point(0.0, [0.0; 3]));
            let moments = moments(&of, moving.is_some());
            self.text += &format!("{indent}  {}\n", mass(&of, moments, moving.is_some()));
            let exact = principal(&of.inertia).0;
            let is_light = of.mass < LEAST || exact.iter().any(|x| *x < LEAST);
            self.light += usize::from(moving.is_some() && is_light);
            let gap = exact.iter().zip(moments).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            if gap > 1e-12 * exact.iter().fold(LEAST, |most, x| most.max(*x)) && !is_light {
                let found = format!("the inertia of {} is that of no body", quoted(&name));
                let help = "its largest moment is the sum of the others there";
                self.out.note(Site::Link(link), found, help);
            }
        }
        self.sites(link, depth + 1);
        self.below(link, depth + 1);
        let _ = writeln!(self.text, "{indent}</body>");
    }

    fn sites(&mut self, link: usize, depth: usize) {
        let indent = "  ".repeat(depth);
        for tie in self.ties {
            for (end, name) in site_names(tie).into_iter().enumerate() {
                if tie.links[end] == link {
                    let at = placed(tie.places[end]);
                    let _ = writeln!(self.text, "{indent}<site name=\"{name}\"{at}/>");
                }
            }
        }
    }
}

/// The names of the two sites of a cut.
fn site_names(tie: &Tie) -> [String; 2] {
    let name = escaped(&tie.name);
    ["predecessor", "successor"].map(|end| format!("{name}/{end}"))
}

/// `pos` and `quat` of a pose that is not that of the parent.
fn placed(Pose { p, r: [x, y, z, w] }: Pose) -> String {
    let mut text = String::new();
    if p != [0.0; 3] {
        attribute(&mut text, "pos", &list(&p));
    }
    if [x, y, z] != [0.0; 3] {
        attribute(&mut text, "quat", &list(&[w, x, y, z]));
    }
    text
}

fn of_joint(joint: &Joint) -> String {
    let kind = match joint.kind {
        JointKind::Prismatic => "slide",
        JointKind::Spherical => "ball",
        JointKind::Floating => "free",
        _ => "hinge",
    };
    let mut text = format!("<joint name=\"{}\" type=\"{kind}\"", escaped(&joint.name));
    let terms = joint.terms;
    if matches!(kind, "hinge" | "slide") {
        attribute(&mut text, "axis", &list(&joint.axis));
        if let Some(limits) = joint.limits {
            let range = [limits.lower.max(-FAR), limits.upper.min(FAR)];
            if limits.lower.is_finite() || limits.upper.is_finite() {
                attribute(&mut text, "range", &list(&range));
            }
            if limits.effort.is_finite() && limits.effort > 0.0 {
                let range = [-limits.effort, limits.effort];
                attribute(&mut text, "actuatorfrcrange", &list(&range));
            }
        }
        let rotor = terms.rotor_inertia * terms.gear_ratio * terms.gear_ratio;
        for (name, value) in [
            ("stiffness", terms.stiffness),
            ("springref", if terms.stiffness == 0.0 { 0.0 } else { terms.rest }),
            ("armature", rotor),
            ("frictionloss", terms.friction.coulomb),
        ] {
            if value != 0.0 {
                attribute(&mut text, name, &number(value));
            }
        }
    }
    if terms.damping != 0.0 {
        attribute(&mut text, "damping", &number(terms.damping));
    }
    text + "/>"
}

/// Principal moments that MuJoCo takes: the sum of two is at least the third, where rounding may be
/// on the other side.
fn moments(of: &Inertial, moves: bool) -> [f64; 3] {
    let least = if moves { LEAST } else { 0.0 };
    let [a, b, c] = principal(&of.inertia).0.map(|x| x.max(least));
    [a.min(b + c), b.min(a + c), c.min(a + b)]
}

/// The inertia about its principal axes, which MuJoCo takes as they are.
fn mass(of: &Inertial, moments: [f64; 3], moves: bool) -> String {
    let at = Pose::of(&of.origin);
    let axes = principal(&of.inertia).1;
    let r = of_axes(axes[0], axes[1]).unwrap_or(Pose::NONE.r);
    // `pos` is required
    let mut text = format!("<inertial pos=\"{}\"", list(&at.p));
    text += &placed(Pose { p: [0.0; 3], r: at.then(Pose { p: [0.0; 3], r }).r });
    attribute(&mut text, "mass", &number(if moves { of.mass.max(LEAST) } else { of.mass }));
    attribute(&mut text, "diaginertia", &list(&moments));
    text + "/>"
}

/// Couplings to several joints are lengths of tendons.
fn tendons(out: &Out<'_>) -> String {
    let joints = &out.robot.of.joints;
    let mut text = String::new();
    for joint in joints {
        let Some(coupling) = joint.coupling.as_ref().filter(|of| of.terms.len() > 1) else {
            continue;
        };
        let name = escaped(&joint.name);
        let _ = writeln!(text, "    <fixed name=\"{name}\">");
        let _ = writeln!(text, "      <joint joint=\"{name}\" coef=\"1\"/>");
        for (master, factor) in &coupling.terms {
            let master = escaped(&joints[*master].name);
            let coef = number(-factor);
            let _ = writeln!(text, "      <joint joint=\"{master}\" coef=\"{coef}\"/>");
        }
        text += "    </fixed>\n";
    }
    within("tendon", text)
}

fn equalities(out: &Out<'_>, ties: &[Tie]) -> String {
    let mut text = String::new();
    for tie in ties {
        let kind = if tie.is_weld { "weld" } else { "connect" };
        let [first, second] = site_names(tie);
        let name = escaped(&tie.name);
        let _ =
            writeln!(text, "    <{kind} name=\"{name}\" site1=\"{first}\" site2=\"{second}\"/>");
    }
    for joint in &out.robot.of.joints {
        let Some(coupling) = &joint.coupling else { continue };
        let name = escaped(&joint.name);
        let offset = number(coupling.offset);
        let _ = match coupling.terms.as_slice() {
            [] => {
                let (master, of) = quartic(coupling).unwrap_or_default();
                let [a, b, c, d, e] = of.map(number);
                writeln!(
                    text,
                    "    <joint joint1=\"{name}\" joint2=\"{}\" polycoef=\"{a} {b} {c} {d} {e}\"/>",
                    escaped(&out.robot.of.joints[master].name)
                )
            }
            [(master, factor)] => writeln!(
                text,
                "    <joint joint1=\"{name}\" joint2=\"{}\" polycoef=\"{offset} {} 0 0 0\"/>",
                escaped(&out.robot.of.joints[*master].name),
                number(*factor)
            ),
            _ => writeln!(text, "    <tendon tendon1=\"{name}\" polycoef=\"{offset} 0 0 0 0\"/>"),
        };
    }
    within("equality", text)
}

fn actuators(out: &mut Out<'_>) -> String {
    let mut text = String::new();
    for joint in out.robot.active() {
        if !is_single(joint) {
            let found = format!("the motors of {}, of several freedoms", quoted(&joint.name));
            let help = "set qfrc_applied for it";
            out.note(Site::Robot, found, help);
            continue;
        }
        let name = escaped(&joint.name);
        let _ = write!(text, "    <motor name=\"{name}\" joint=\"{name}\"");
        if let Some(effort) = joint.limits.map(|of| of.effort).filter(|of| of.is_finite()) {
            attribute(&mut text, "ctrlrange", &list(&[-effort, effort]));
        }
        text += "/>\n";
    }
    let mut limits = out.robot.of.joints.iter().filter_map(|joint| joint.limits);
    if limits.any(|of| of.velocity.is_finite()) {
        let found = "MJCF has no limits of speeds".to_owned();
        out.note(Site::Robot, found, "they are left out");
    }
    within("actuator", text)
}

/// A section that has something in it.
fn within(name: &str, text: String) -> String {
    if text.is_empty() { text } else { format!("  <{name}>\n{text}  </{name}>\n") }
}

/// The joint that another one follows by a polynomial up to degree 4 alone, and its coefficients.
pub(crate) fn quartic(coupling: &Coupling) -> Option<(usize, [f64; 5])> {
    let ([], [(of, Curve::Polynomial { about, coefficients })]) =
        (&coupling.terms[..], &coupling.curves[..])
    else {
        return None;
    };
    // (q − about)^k by Horner's rule
    let mut powers = [0.0; 6];
    for c in coefficients.iter().rev() {
        for k in (1..6).rev() {
            powers[k] = powers[k - 1] - about * powers[k];
        }
        powers[0] = c - about * powers[0];
    }
    powers[0] += coupling.offset;
    let [quartic @ .., rest] = powers;
    (rest == 0.0).then_some((*of, quartic))
}
