//! Robots as files of other programs, and as this project's own two files.
//!
//! | target | loops become | beside the tree |
//! |---|---|---|
//! | MJCF | `connect` and `weld` between sites | couplings, springs, dampers, rotors, motors |
//! | SDF | joints whose child has a parent already | couplings to one joint, springs, dampers |
//! | URDF | the submechanism file | all |
//! | Pinocchio | `RigidConstraintModel`s that a Python file builds | all, in that file |
//! | Gepetto | pairs of frames in a YAML file | none |

mod cuts;
mod gepetto;
mod mjcf;
mod pinocchio;
mod sdf;
pub(crate) mod urdf;
pub(crate) mod yaml;

use std::fmt::Write;

use sarrus_dynamics::description::{
    Cut, Description, Joint, JointKind, Loop, Submechanism, SubmechanismKind, Terms,
};
use sarrus_dynamics::{CutJoint, Model, Site, loops_of};

use crate::build;
use crate::error::{LoadError, Outcome};
use crate::load::Loaded;
use crate::pose::Pose;
use crate::report::{Diagnostics, Report, Span, quoted};
use crate::rewrite::number;
use crate::tree::Tree;
use cuts::{Tie, held};

/// A format of [`export`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The format of MuJoCo.
    Mjcf,
    /// The format of Gazebo.
    Sdf,
    /// URDF and a submechanism file.
    Urdf,
    /// URDF and a Python file that builds a model of Pinocchio with the constraints of its loops.
    Pinocchio,
    /// URDF and the YAML file of Gepetto's tools for parallel robots.
    Gepetto,
}

/// The files of an exported robot.
#[derive(Debug)]
#[non_exhaustive]
pub struct Exported {
    /// Endings of their names, and their contents; the other program reads the first one.
    pub files: Vec<(&'static str, String)>,
    /// Parts that the format does not hold.
    pub report: Report,
    /// The robot as the files hold it: its cuts are those that the format has.
    pub held: Description,
}

/// Writes a robot for another program; `name` is that of the files without their endings.
///
/// # Errors
/// A part that changes M, C, K, limits or actuators and that the format cannot express; lenient, it
/// is left out with a warning.
pub fn export(loaded: &Loaded, target: Target, name: &str, lenient: bool) -> Outcome<Exported> {
    let mut diagnostics = Diagnostics::new(lenient);
    diagnostics.files.clone_from(&loaded.files);
    let mut of = loaded.description.clone();
    if target != Target::Urdf {
        // a type may define its loops
        for (s, part) in of.submechanisms.iter_mut().enumerate() {
            part.loops = loops_of(&loaded.description, s);
        }
    }
    if target == Target::Sdf {
        sdf::rename(&mut of);
    }
    let mut out = Out { loaded, diagnostics, name, robot: Tree::new(&of) };
    out.check(target);
    let is_cut_as_written = matches!(target, Target::Urdf | Target::Sdf);
    let ties = if is_cut_as_written { Vec::new() } else { out.ties() };
    let files = match target {
        Target::Mjcf => vec![(".xml", mjcf::text(&mut out, &ties))],
        Target::Sdf => vec![(".sdf", sdf::text(&mut out))],
        Target::Urdf => vec![(".urdf", urdf::text(&of)), (".yml", yaml::text(&of))],
        Target::Pinocchio => pinocchio::texts(&mut out, &ties),
        Target::Gepetto => gepetto::texts(&mut out, &ties),
    };
    let held = if is_cut_as_written { plain(out.robot.of) } else { out.as_held(&ties) };
    let failed = out.diagnostics.has_errors();
    let report = Report { robot: Some(name.to_owned()), ..out.diagnostics.into_report() };
    if failed { Err(LoadError::Faults(report)) } else { Ok(Exported { files, report, held }) }
}

/// The robot as a tree: all joints independent, without loops and couplings.
pub fn as_tree(of: &Description) -> Description {
    let mut tree = of.clone();
    let all: Vec<usize> =
        of.submechanisms.iter().flat_map(|part| part.spanning_tree.clone()).collect();
    let part = build::group("tree".to_owned(), SubmechanismKind::Serial, all.clone());
    tree.submechanisms = vec![Submechanism { independent: all, ..part }];
    tree.joints.iter_mut().for_each(|joint| joint.coupling = None);
    tree
}

/// The robot without the axes of joints that have none, and the limits and terms of fixed ones.
fn plain(of: &Description) -> Description {
    let mut plain = of.clone();
    for joint in plain.joints.iter_mut().filter(|joint| !is_single(joint)) {
        joint.axis = [1.0, 0.0, 0.0];
        if joint.kind == JointKind::Fixed {
            (joint.limits, joint.motor, joint.terms) = (None, None, Terms::default());
        }
    }
    plain
}

/// The robot, and the report of its writer.
struct Out<'a> {
    loaded: &'a Loaded,
    diagnostics: Diagnostics,
    name: &'a str,
    robot: Tree<'a>,
}

impl Out<'_> {
    fn at(&self, site: Site) -> Span {
        self.loaded.spans.of(site)
    }

    /// Reports a part that changes the dynamics.
    fn lost(&mut self, site: Site, found: String, expected: &str, help: &str) {
        self.diagnostics.dynamics(self.at(site), found, expected, help);
    }

    /// Reports a cut that the format lacks.
    fn lost_cut(&mut self, (s, l): (usize, usize), of: &Loop, kind: cuts::Kind, expected: &str) {
        let found = format!("the cut {} holds a {}", quoted(&of.name), kind.name());
        let help = "write the joint of the cut into the tree, and cut a body by a weld";
        self.lost(Site::Loop(s, l), found, expected, help);
    }

    /// Reports a free joint whose parent moves.
    fn check_free(&mut self, j: usize, joint: &Joint) {
        if !self.robot.stands(joint.parent) {
            let found = format!("the free joint {} on a moving link", quoted(&joint.name));
            let help = "write it as three sliders and a ball joint";
            self.lost(Site::Joint(j), found, "a free joint on the world", help);
        }
    }

    fn note(&mut self, site: Site, found: String, help: &str) {
        self.diagnostics.note(self.at(site), found, help);
    }

    /// Reports parts that no format but our own holds, and a zero pose that no format holds.
    fn check(&mut self, target: Target) {
        let of = self.robot.of;
        if let Some((joint, _)) = of.zero_pose.iter().find(|(_, x)| x.iter().any(|x| *x != 0.0)) {
            let found = format!("{} is not zero at the zero pose", quoted(&of.joints[*joint].name));
            let help = "export the whole robot, and hold the joint in the other program";
            self.diagnostics.error(self.at(Site::Joint(*joint)), found, "a zero pose", help);
        }
        if target == Target::Urdf {
            if of.gravity != [0.0, 0.0, -9.81] {
                let [x, y, z] = of.gravity;
                let help = "give it with each command";
                let found = format!("no file holds gravity: --gravity {x},{y},{z}");
                self.note(Site::Robot, found, help);
            }
            return;
        }
        for (j, joint) in of.joints.iter().enumerate() {
            let name = quoted(&joint.name);
            let has_curves = joint.motor.as_ref().is_some_and(|motor| {
                !motor.driving.is_empty() || !motor.braking.is_empty() || motor.power.is_finite()
            });
            if has_curves {
                let found = format!("the motor of {name} has limits over its speed");
                self.note(Site::Joint(j), found, "its largest force alone is written");
            }
            let friction = joint.terms.friction;
            if friction.viscous != 0.0 || friction.coulomb != 0.0 {
                let found = format!("the friction of {name} counts here on request only");
                let help = "dry friction is written where the format has it, viscous is not";
                self.note(Site::Joint(j), found, help);
            }
            let coupling = joint.coupling.as_ref().filter(|of| !of.curves.is_empty());
            if coupling.is_some_and(|of| target != Target::Mjcf || mjcf::quartic(of).is_none()) {
                let found = format!("{name} follows a curve");
                let expected = "a line, or in MJCF a polynomial up to degree 4 of one joint";
                self.lost(Site::Joint(j), found, expected, "choose the target urdf");
            } else if target == Target::Gepetto && (joint.coupling.is_some() || has_terms(joint)) {
                let found = format!("{name} has a coupling, a spring, a damper or a rotor");
                let help = "remove it, or choose the target pinocchio";
                self.lost(Site::Joint(j), found, "none of them", help);
            }
        }
    }

    /// The cuts as points and welds.
    fn ties(&mut self) -> Vec<Tie> {
        let mut ties = Vec::new();
        let mut planar = Vec::new();
        for (s, part) in self.robot.of.submechanisms.iter().enumerate() {
            for (l, of) in part.loops.iter().enumerate() {
                let cut = held(&of.rows);
                if cut.kind == cuts::Kind::Plane {
                    planar.push((s, l));
                }
                let found = Tie::new((s, l), of, self.robot.places(of), &cut);
                if found.is_empty() {
                    let expected = "a point, a point in a plane, a hinge or a weld";
                    self.lost_cut((s, l), of, cut.kind, expected);
                }
                for mut tie in found {
                    while ties.iter().any(|other: &Tie| other.name == tie.name) {
                        tie.name.push('_');
                    }
                    ties.push(tie);
                }
            }
        }
        // a third row is harmless where the loop is planar
        if !planar.is_empty() && Model::compile(&self.as_held(&ties)).is_err() {
            for (s, l) in planar {
                let of = &self.robot.of.submechanisms[s].loops[l];
                let found = format!("the cut {} leaves a motion in space", quoted(&of.name));
                let help = "write that motion as joints of the tree";
                self.lost(Site::Loop(s, l), found, "a loop that moves in a plane", help);
            }
        }
        ties
    }

    /// The robot with these cuts.
    fn as_held(&self, ties: &[Tie]) -> Description {
        let cut = |tie: &Tie| {
            let [predecessor, successor] = tie.places.map(Pose::placement);
            let cut = Cut::Placed { predecessor, successor };
            let [predecessor, successor] = tie.links;
            let rows = if tie.is_weld { CutJoint::Weld } else { CutJoint::Spherical }.rows();
            Loop { name: tie.name.clone(), predecessor, successor, cut, rows }
        };
        let mut held = self.robot.of.clone();
        for (s, part) in held.submechanisms.iter_mut().enumerate() {
            if part.loops.is_empty() {
                continue;
            }
            part.loops = ties.iter().filter(|tie| tie.of.0 == s).map(cut).collect();
            part.kind = SubmechanismKind::Numerical;
            part.type_name = "NUMERICAL".to_owned();
        }
        held
    }
}

/// Whether a joint has one axis.
fn is_single(joint: &Joint) -> bool {
    matches!(joint.kind, JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic)
}

/// Whether a joint has a spring, a damper or a rotor.
fn has_terms(joint: &Joint) -> bool {
    let terms = joint.terms;
    terms.damping != 0.0 || terms.stiffness != 0.0 || terms.rotor_inertia != 0.0
}

/// Numbers with blanks between, no negative zeros.
fn list(of: &[f64]) -> String {
    listed(of, " ")
}

fn listed(of: &[f64], between: &str) -> String {
    of.iter().map(|x| number(x + 0.0)).collect::<Vec<_>>().join(between)
}

/// Adds ` NAME="VALUE"`.
fn attribute(text: &mut String, name: &str, value: &str) {
    let _ = write!(text, " {name}=\"{value}\"");
}
