//! Joints as written: their type, links, frame and axes.

use std::f64::consts::TAU;

use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::{Friction, Terms};

use super::frames::{MODEL, full};
use super::{Robot, number};
use crate::mjcf::body::{Joint, Kind};
use crate::mjcf::document::Element;
use crate::mjcf::item::Item;
use crate::pose::{Pose, unit};
use crate::report::quoted;
use crate::rotation::rotated;

/// A joint.
pub(super) struct Draft {
    pub(super) name: String,
    /// Links of parent and child.
    pub(super) ends: [usize; 2],
    /// In the world.
    pub(super) at: Pose,
    /// The joints of one axis that it consists of, with axes in the world.
    pub(super) joints: Vec<Joint>,
    /// Its cut; `None` of one that is no cut.
    pub(super) cut: Option<CutJoint>,
}

impl Draft {
    /// Whether it has a coupling, a spring, damping, a rotor or an actuator, which no cut has.
    pub(super) fn acts(&self) -> bool {
        let acts = |Joint { terms, coupling, drive, .. }: &Joint| {
            let all = [terms.damping, terms.stiffness, terms.rotor_inertia];
            all != [0.0; 3] || coupling.is_some() || drive.is_some()
        };
        self.joints.iter().any(acts)
    }
}

impl<'e> Robot<'e, '_> {
    pub(super) fn draft(&mut self, of: &'e Element, scope: &str) -> Option<Draft> {
        let name = full(scope, of.text("name")?);
        let ends = ["parent", "child"].map(|end| {
            let end = full(scope, of.text(end).unwrap_or_default());
            self.frame(&end, of.span).map(|(link, _)| link)
        });
        let (_, at) = self.frame(&name, of.span)?;
        let ends = [ends[0]?, ends[1]?];
        if ends[0] == ends[1] || ends[1] == 0 {
            self.fault(of.span, format!("the ends of the joint {}", quoted(&name)), "two links");
        }
        let kind = of.text("type").unwrap_or_default();
        let axes: &[(&str, &str)] = match kind {
            "fixed" | "ball" => &[],
            "revolute" | "continuous" | "prismatic" | "screw" => &[("axis", "")],
            "universal" | "revolute2" => &[("axis", "/r1"), ("axis2", "/r2")],
            other => {
                of.read_all();
                let found = format!("the joint {} of type {}", quoted(&name), quoted(other));
                let known = "revolute, continuous, prismatic, fixed, ball, universal or screw";
                let help = "write what ties its joints as <mimic> in the axis that follows";
                self.diagnostics.dynamics(of.span, found, known, help);
                return None;
            }
        };
        let motion = if kind == "prismatic" { Kind::Slide } else { Kind::Hinge };
        let plain = |suffix: &str, motion| Joint::new(format!("{name}{suffix}"), of.span, motion);
        let joints = axes
            .iter()
            .map(|(element, suffix)| self.axis((of, element), scope, at, plain(suffix, motion)));
        let mut joints = joints.collect::<Option<Vec<Joint>>>()?;
        let own: Vec<[f64; 3]> =
            joints.iter().map(|joint| rotated(at.inverse().r, joint.axis)).collect();
        let cut = match (kind, &own[..]) {
            ("fixed", _) => Some(CutJoint::Weld),
            ("screw", _) => None,
            ("prismatic", &[axis]) => Some(CutJoint::Prismatic { axis }),
            (_, &[axis]) => Some(CutJoint::Revolute { axis }),
            (_, &[axis, axis2]) => Some(CutJoint::Universal { axis, axis2 }),
            _ => Some(CutJoint::Spherical),
        };
        joints.extend(match kind {
            "fixed" => Some(Joint { held: Some(0.0), ..plain("", motion) }),
            "ball" => Some(plain("", Kind::Ball)),
            "screw" => {
                let coupling = Some((vec![(name.clone(), self.pitch(of))], 0.0));
                Some(Joint { axis: joints[0].axis, coupling, ..plain("/slide", Kind::Slide) })
            }
            _ => None,
        });
        if let Some(k) = self.driven.iter().position(|(driven, _)| *driven == name) {
            joints[0].drive = Some(f64::INFINITY);
            self.driven.remove(k);
        }
        Some(Draft { name, ends, at, joints, cut })
    }

    /// The slide of a screw in a radian.
    fn pitch(&mut self, of: &'e Element) -> f64 {
        // the older one counts radians in a metre, of a thread with the other hand
        let [new, old] = ["screw_thread_pitch", "thread_pitch"]
            .map(|name| number(Some(of), name, f64::NAN, self.diagnostics));
        let length = if new.is_nan() { -1.0 / old } else { new / TAU };
        if !length.is_finite() {
            self.fault(of.span, "a screw without a pitch".to_owned(), "<screw_thread_pitch>");
        }
        length
    }

    /// A joint with the values of an axis.
    fn axis(
        &mut self,
        (joint, element): (&'e Element, &str),
        scope: &str,
        at: Pose,
        plain: Joint,
    ) -> Option<Joint> {
        let name = quoted(&plain.name);
        let Some(of) = joint.one(element) else {
            self.fault(joint.span, format!("the joint {name} has no `{element}`"), "an axis");
            return None;
        };
        let xyz = Item::plain(of.one("xyz").unwrap_or(of));
        let frame = xyz.text("expressed_in").filter(|frame| !frame.is_empty());
        let is_old = Item::plain(of).flag("use_parent_model_frame", self.diagnostics);
        let frame = frame.or(is_old.unwrap_or(self.has_model_axes).then_some(MODEL));
        let frame = match frame {
            Some(frame) => self.frame(&full(scope, frame), of.span)?.1,
            None => at,
        };
        let Some(axis) = unit(xyz.numbers("xyz", self.diagnostics).unwrap_or([0.0, 0.0, 1.0]))
        else {
            self.fault(of.span, format!("the axis of the joint {name} is zero"), "a direction");
            return None;
        };
        let mut value = |of, name, usual| number(of, name, usual, self.diagnostics);
        let limit = of.one("limit");
        let none = f64::INFINITY;
        let range = [value(limit, "lower", -none), value(limit, "upper", none)];
        // a negative limit is none
        let [effort, velocity] = ["effort", "velocity"]
            .map(|name| Some(value(limit, name, none)).filter(|of| *of >= 0.0).unwrap_or(none));
        let dynamics = of.one("dynamics");
        let coulomb = value(dynamics, "friction", 0.0);
        let terms = Terms {
            damping: value(dynamics, "damping", 0.0),
            stiffness: value(dynamics, "spring_stiffness", 0.0),
            rest: value(dynamics, "spring_reference", 0.0),
            friction: Friction { coulomb, ..Friction::default() },
            // of Drake
            rotor_inertia: value(Some(joint), "rotor_inertia", 0.0),
            gear_ratio: value(Some(joint), "gear_ratio", 1.0),
        };
        // factor (leader − reference) + offset
        let coupling = of.one("mimic").map(|of| {
            let leader = full(scope, of.text("joint").unwrap_or_default());
            let suffix = if of.text("axis") == Some("axis2") { "/r2" } else { "" };
            let mut value = |name, usual| value(Some(of), name, usual);
            let factor = value("multiplier", 1.0);
            let offset = value("offset", 0.0) - factor * value("reference", 0.0);
            (vec![(format!("{leader}{suffix}"), factor)], offset)
        });
        if range[0] > range[1] {
            self.fault(of.span, format!("the limits of {name}"), "lower ≤ upper");
        }
        let is_limited = joint.text("type") != Some("continuous") && range != [-none, none];
        let range = is_limited.then_some(range);
        let axis = rotated(frame.r, axis);
        Some(Joint { axis, range, effort, velocity, terms, coupling, ..plain })
    }
}
