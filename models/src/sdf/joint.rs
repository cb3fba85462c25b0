//! Joints as written: their type, links, frame and axes.

use std::f64::consts::TAU;

use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::{Friction, Terms};

use super::frames::full;
use super::{Robot, value};
use crate::mjcf::document::Element;
use crate::pose::{Pose, unit};
use crate::report::{Span, quoted};
use crate::rotation::rotated;

/// The type of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Fixed,
    Ball,
    Revolute,
    Prismatic,
    /// Two hinges, the first one on the parent.
    Universal,
    /// A hinge that slides by this length in a radian.
    Screw(f64),
}

/// An axis of a joint.
pub(super) struct Axis {
    /// In the world, of length one.
    pub(super) direction: [f64; 3],
    pub(super) range: Option<[f64; 2]>,
    pub(super) effort: f64,
    pub(super) velocity: f64,
    pub(super) terms: Terms,
    /// The joint that it follows, factor and offset.
    pub(super) mimic: Option<(String, [f64; 2])>,
}

/// A joint.
pub(super) struct Draft {
    pub(super) name: String,
    pub(super) span: Span,
    pub(super) kind: Kind,
    /// Links of parent and child.
    pub(super) ends: [usize; 2],
    /// In the world.
    pub(super) at: Pose,
    pub(super) axes: Vec<Axis>,
    pub(super) is_driven: bool,
}

impl Draft {
    /// The parts of a joint that a cut lacks.
    pub(super) fn terms(&self) -> Vec<&'static str> {
        let has = |is_it: fn(&Axis) -> bool| self.axes.iter().any(is_it);
        [
            ("damping", has(|of| of.terms.damping != 0.0)),
            ("a spring", has(|of| of.terms.stiffness != 0.0)),
            ("a rotor", has(|of| of.terms.rotor_inertia != 0.0)),
            ("a coupling", has(|of| of.mimic.is_some())),
            ("an actuator", self.is_driven),
        ]
        .into_iter()
        .filter_map(|(name, is_there)| is_there.then_some(name))
        .collect()
    }

    /// The axes in the frame of the joint.
    fn own(&self, k: usize) -> [f64; 3] {
        let axis = self.axes.get(k).map_or([0.0, 0.0, 1.0], |axis| axis.direction);
        rotated(self.at.inverse().r, axis)
    }

    /// The cut of the joint; `None` of one that is no cut.
    pub(super) fn cut(&self) -> Option<CutJoint> {
        Some(match self.kind {
            Kind::Fixed => CutJoint::Weld,
            Kind::Ball => CutJoint::Spherical,
            Kind::Revolute => CutJoint::Revolute { axis: self.own(0) },
            Kind::Prismatic => CutJoint::Prismatic { axis: self.own(0) },
            Kind::Universal => CutJoint::Universal { axis: self.own(0), axis2: self.own(1) },
            Kind::Screw(_) => return None,
        })
    }
}

impl<'e> Robot<'e, '_> {
    /// Reads all joints.
    pub(super) fn drafts(&mut self) -> Vec<Draft> {
        let joints = std::mem::take(&mut self.joints);
        joints.into_iter().filter_map(|(of, scope)| self.draft(of, &scope)).collect()
    }

    fn draft(&mut self, of: &'e Element, scope: &str) -> Option<Draft> {
        let name = full(scope, of.text("name")?);
        let kind = self.kind(of, &name);
        let ends = ["parent", "child"].map(|end| self.end(of, end, scope));
        let (_, at) = self.frames.get(&name, of.span, self.diagnostics)?;
        let [parent, child] = [ends[0]?, ends[1]?];
        if parent == child || child == 0 {
            let found = format!("the ends of the joint {}", quoted(&name));
            self.diagnostics.error(of.span, found, "two links", "correct one of them");
            return None;
        }
        let kind = kind?;
        let names: &[&str] = match kind {
            Kind::Fixed | Kind::Ball => &[],
            Kind::Universal => &["axis", "axis2"],
            _ => &["axis"],
        };
        let axes = names.iter().map(|axis| self.axis(of, axis, (&name, scope), at));
        let axes = axes.collect::<Option<Vec<Axis>>>()?;
        let is_driven = self.driven.remove(&name).is_some();
        Some(Draft { name, span: of.span, kind, ends: [parent, child], at, axes, is_driven })
    }

    fn kind(&mut self, of: &'e Element, name: &str) -> Option<Kind> {
        let written = of.text("type").unwrap_or_default();
        Some(match written {
            "fixed" => Kind::Fixed,
            "ball" => Kind::Ball,
            "revolute" | "continuous" => Kind::Revolute,
            "prismatic" => Kind::Prismatic,
            "universal" | "revolute2" => Kind::Universal,
            "screw" => {
                let length = value::numbers(Some(of), "screw_thread_pitch", self.diagnostics);
                let length = length.map(|[of]| of / TAU);
                // radians in a metre, of a thread with the other hand
                let turns = value::numbers(Some(of), "thread_pitch", self.diagnostics);
                let length = length.or(turns.map(|[of]| -1.0 / of)).filter(|of| of.is_finite());
                let Some(length) = length else {
                    let found = format!("the screw {} has no pitch", quoted(name));
                    let expected = "<screw_thread_pitch>, metres in a turn";
                    self.diagnostics.error(of.span, found, expected, "add it");
                    return None;
                };
                Kind::Screw(length)
            }
            other => {
                of.read_all();
                let found = format!("the joint {} of type {}", quoted(name), quoted(other));
                let known = "revolute, continuous, prismatic, fixed, ball, universal or screw";
                let help = "write what ties its joints as <mimic> in the axis that follows";
                self.diagnostics.dynamics(of.span, found, known, help);
                return None;
            }
        })
    }

    /// The link at an end of a joint.
    fn end(&mut self, of: &'e Element, end: &'static str, scope: &str) -> Option<usize> {
        let written = value::word(of, end, self.diagnostics).filter(|name| !name.is_empty());
        let Some(written) = written else {
            let found = format!("a joint has no `{end}`");
            self.diagnostics.error(of.span, found, format!("<{end}>LINK</{end}>"), "add it");
            return None;
        };
        self.frames.get(&full(scope, written), of.span, self.diagnostics).map(|(link, _)| link)
    }

    fn axis(
        &mut self,
        joint: &'e Element,
        element: &'static str,
        (name, scope): (&str, &str),
        at: Pose,
    ) -> Option<Axis> {
        let Some(of) = value::one(joint, element, self.diagnostics) else {
            let found = format!("the joint {} has no `{element}`", quoted(name));
            self.diagnostics.error(joint.span, found, "an axis", "add it");
            return None;
        };
        let xyz = value::numbers(Some(of), "xyz", self.diagnostics).unwrap_or([0.0, 0.0, 1.0]);
        let old = self.has_model_axes;
        let frame =
            match value::one(of, "xyz", self.diagnostics).and_then(|of| of.text("expressed_in")) {
                Some(frame) if !frame.is_empty() => Some(full(scope, frame)),
                _ if value::switch(of, "use_parent_model_frame", old, self.diagnostics) => {
                    Some(full(scope, super::MODEL))
                }
                _ => None,
            };
        let frame = match frame {
            Some(frame) => self.frames.get(&frame, of.span, self.diagnostics)?.1,
            None => at,
        };
        let Some(direction) = unit(xyz) else {
            let found = format!("the axis of the joint {} is zero", quoted(name));
            self.diagnostics.error(of.span, found, "a direction as 0 0 1", "correct it");
            return None;
        };
        let limit = value::one(of, "limit", self.diagnostics);
        let none = f64::INFINITY;
        let [lower, upper, effort, velocity] =
            [("lower", -none), ("upper", none), ("effort", none), ("velocity", none)]
                .map(|(name, none)| value::bound(limit, name, none, self.diagnostics));
        if lower > upper {
            let found = format!("the lower limit {lower} is above the upper limit {upper}");
            self.diagnostics.error(of.span, found, "lower ≤ upper", "swap them");
        }
        let range = (lower.is_finite() || upper.is_finite()).then_some([lower, upper]);
        let range = range.filter(|_| joint.text("type") != Some("continuous"));
        // a negative limit is none
        let [effort, velocity] = [effort, velocity].map(|of| if of < 0.0 { none } else { of });
        let dynamics = value::one(of, "dynamics", self.diagnostics);
        let mut term = |name, usual| value::number(dynamics, name, usual, self.diagnostics);
        let stiffness = term("spring_stiffness", 0.0);
        let rest = term("spring_reference", 0.0);
        let terms = Terms {
            damping: term("damping", 0.0),
            stiffness,
            rest: if stiffness == 0.0 { 0.0 } else { rest },
            friction: Friction { coulomb: term("friction", 0.0), ..Friction::default() },
            // of Drake
            rotor_inertia: value::number(Some(joint), "rotor_inertia", 0.0, self.diagnostics),
            gear_ratio: value::number(Some(joint), "gear_ratio", 1.0, self.diagnostics),
            ..Terms::default()
        };
        let mimic = self.mimic(of, scope);
        let direction = rotated(frame.r, direction);
        Some(Axis { direction, range, effort, velocity, terms, mimic })
    }

    /// `factor (leader − reference) + offset`.
    fn mimic(&mut self, axis: &'e Element, scope: &str) -> Option<(String, [f64; 2])> {
        let of = value::one(axis, "mimic", self.diagnostics)?;
        let leader = full(scope, of.text("joint").unwrap_or_default());
        let is_second = of.text("axis") == Some("axis2");
        let leader = if is_second { format!("{leader}/r2") } else { leader };
        let [factor, offset, reference] =
            [("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0)]
                .map(|(name, usual)| value::number(Some(of), name, usual, self.diagnostics));
        Some((leader, [factor, offset - factor * reference]))
    }
}
