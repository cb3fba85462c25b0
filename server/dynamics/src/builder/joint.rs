//! One joint under construction, with the link that it moves.

use nalgebra::Vector3;

use super::{DescriptionBuilder, LinkId};
use crate::compile::{pose_of, vector};
use crate::description::{Inertial, Joint, JointKind, Limits, Link, Placement, Terms};
use crate::scalar::{Dd, Real};
use crate::spatial::{Matrix, Pose};

/// A joint of the robot, to set its place, limits, inertia and terms.
#[derive(Debug)]
pub struct JointBuilder<'a> {
    robot: &'a mut DescriptionBuilder,
    joint: usize,
    /// Pose of the parent link at zero {root}.
    x_root_parent: Pose<Dd>,
}

impl DescriptionBuilder {
    /// Places the joint and its link at the parent's frame.
    pub(super) fn push(&mut self, name: String, kind: JointKind, parent: usize) -> usize {
        let joint = self.description.joints.len();
        let child = self.description.links.len();
        let inertial = self.default_inertial.filter(|_| kind != JointKind::Fixed);
        self.description.links.push(Link { name: format!("{name}_link"), inertial });
        self.description.joints.push(Joint {
            name,
            kind,
            parent,
            child,
            origin: Placement::default(),
            axis: [1.0, 0.0, 0.0],
            limits: None,
            coupling: None,
            terms: Terms::default(),
            motor: None,
        });
        self.x_root_link.push(self.x_root_link[parent]);
        joint
    }
}

impl<'a> JointBuilder<'a> {
    pub(super) fn new(robot: &'a mut DescriptionBuilder, joint: usize) -> JointBuilder<'a> {
        let x_root_parent = robot.x_root_link[robot.description.joints[joint].parent];
        JointBuilder { robot, joint, x_root_parent }
    }

    /// The link, as parent of other joints and end of cuts; in lists it stands for its joint.
    pub fn link(self) -> LinkId {
        LinkId(self.joint + 1)
    }

    /// Where the joint frame is at zero `[m]` (3) {root}.
    pub fn at(mut self, point: [f64; 3]) -> JointBuilder<'a> {
        let R = &self.x_root_parent.R;
        let p = &self.x_root_parent.p;
        let local = R.apply_transposed(vector(point) - p);
        self.mine().origin.xyz = numbers(&local);
        self.placed();
        // PRECISION: the point itself, not the sum of rounded differences
        self.robot.x_root_link[self.joint + 1].p = vector(point);
        self
    }

    /// Where the joint frame is `[m]` (3) {parent}.
    pub fn origin(mut self, xyz: [f64; 3]) -> JointBuilder<'a> {
        self.mine().origin.xyz = xyz;
        self.placed();
        self
    }

    /// How the joint frame is turned: roll, pitch, yaw about the fixed axes `[rad]` (3) {parent}.
    pub fn rpy(mut self, rpy: [f64; 3]) -> JointBuilder<'a> {
        let point = self.robot.x_root_link[self.joint + 1].p;
        self.mine().origin.rpy = rpy;
        self.placed();
        self.robot.x_root_link[self.joint + 1].p = point;
        self
    }

    /// Axis of motion, of any length but zero `[-]` (3) {joint frame}.
    pub fn axis(mut self, axis: [f64; 3]) -> JointBuilder<'a> {
        self.mine().axis = axis;
        self
    }

    /// Least and greatest position `[m, rad]`, beyond which answers bear a warning; speed and force
    /// stay without limits unless they are given.
    pub fn limits(mut self, lower: f64, upper: f64) -> JointBuilder<'a> {
        let limits = self.mine().limits.get_or_insert(Limits::NONE);
        (limits.lower, limits.upper) = (lower, upper);
        self
    }

    /// Greatest speed `[m/s, rad/s]`.
    pub fn velocity_limit(mut self, velocity: f64) -> JointBuilder<'a> {
        self.mine().limits.get_or_insert(Limits::NONE).velocity = velocity;
        self
    }

    /// Greatest force or moment of the actuator `[N, N m]`.
    pub fn effort_limit(mut self, effort: f64) -> JointBuilder<'a> {
        self.mine().limits.get_or_insert(Limits::NONE).effort = effort;
        self
    }

    /// Viscous damping d: the joint exerts −d q̇ `[N s/m, N m s/rad]`.
    pub fn damping(mut self, damping: f64) -> JointBuilder<'a> {
        self.mine().terms.damping = damping;
        self
    }

    /// A spring: the joint exerts −k (q − rest) `[N/m, N m/rad]`, `[m, rad]`.
    pub fn spring(mut self, stiffness: f64, rest: f64) -> JointBuilder<'a> {
        (self.mine().terms.stiffness, self.mine().terms.rest) = (stiffness, rest);
        self
    }

    /// A rotor of inertia I `[kg m²]` that turns N times as fast as the joint: N² I is added to the
    /// joint's inertia.
    pub fn rotor(mut self, inertia: f64, gear_ratio: f64) -> JointBuilder<'a> {
        let terms = &mut self.mine().terms;
        (terms.rotor_inertia, terms.gear_ratio) = (inertia, gear_ratio);
        self
    }

    /// All that acts in the joint besides its actuator.
    pub fn terms(mut self, terms: Terms) -> JointBuilder<'a> {
        self.mine().terms = terms;
        self
    }

    /// Mass and inertia of the link.
    pub fn inertial(self, inertial: Inertial) -> JointBuilder<'a> {
        self.robot.description.links[self.joint + 1].inertial = Some(inertial);
        self
    }

    /// A link without mass, even if there is a default.
    pub fn massless(self) -> JointBuilder<'a> {
        self.robot.description.links[self.joint + 1].inertial = None;
        self
    }

    /// Name of the link; without it that of the joint with `_link` behind it.
    pub fn link_name(self, name: impl Into<String>) -> JointBuilder<'a> {
        self.robot.description.links[self.joint + 1].name = name.into();
        self
    }

    fn mine(&mut self) -> &mut Joint {
        &mut self.robot.description.joints[self.joint]
    }

    /// The link's pose follows the joint's origin.
    fn placed(&mut self) {
        let origin = pose_of(&self.mine().origin);
        let x = self.x_root_parent.then(&origin);
        self.robot.x_root_link[self.joint + 1] = x;
    }
}

/// A vector rounded once.
fn numbers(x: &Vector3<Dd>) -> [f64; 3] {
    [x[0].to_f64(), x[1].to_f64(), x[2].to_f64()]
}
