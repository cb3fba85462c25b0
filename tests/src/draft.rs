//! One mechanism as a description, drawn in a frame at any pose on the base.

use sarrus_dynamics::description::{
    Description, Inertial, JointKind, Placement, SubmechanismKind as Kind,
};
use sarrus_dynamics::{DescriptionBuilder, LinkId};

use crate::rigid::{Pose, Vector};
use crate::seed::Seeded;

/// One mechanism under construction, in a frame at any pose on the base.
#[derive(Clone, Debug)]
pub struct Draft {
    /// Source of random numbers for the drawing.
    pub seeded: Seeded,
    /// Length of the drawing's unit `[m]`.
    pub scale: f64,
    /// Every frame is parallel to the root, so that the files hold exact numbers.
    pub straight: bool,
    /// Pose of the mechanism's frame.
    pub at: Pose,
    /// The robot drawn so far.
    pub robot: DescriptionBuilder,
    /// Each link and its pose.
    links: Vec<(LinkId, Pose)>,
    /// Kind of each joint.
    pub kinds: Vec<JointKind>,
    /// Reach of each independent joint.
    pub reach: Vec<f64>,
}

impl Draft {
    /// A base with nothing on it, of random size and pose unless `straight`.
    pub fn new(seed: u64, kind: Kind, straight: bool) -> Draft {
        let mut seeded = Seeded::new(seed);
        let scale = if straight { 1.0 } else { 10f64.powi(seeded.below(7) as i32 - 3) };
        let at = if straight { Pose::IDENTITY } else { seeded.pose(scale) };
        let mut robot = DescriptionBuilder::new(format!("seed {seed}"));
        let inertia = [scale * scale, 0.0, 0.0, scale * scale, 0.0, scale * scale];
        let centre = [0.1 * scale, 0.0, 0.05 * scale];
        robot.default_inertial(Inertial::new(1.0, centre, inertia)).submechanism("part", kind);
        let links = vec![(LinkId::BASE, Pose::IDENTITY)];
        Draft { seeded, scale, straight, at, robot, links, kinds: vec![], reach: vec![] }
    }

    /// The drawing as a description.
    ///
    /// # Panics
    /// If the drawing is faulty.
    #[allow(clippy::expect_used, reason = "a drawing of a test")]
    pub fn description(&self) -> Description {
        self.robot.build().expect("a faulty drawing")
    }

    /// The link that a joint moves.
    pub fn moved_by(&self, joint: usize) -> LinkId {
        self.links[joint + 1].0
    }

    /// Adds a joint on a link through a point along an axis of either sign, both in the mechanism's
    /// frame; returns joint and child link.
    pub fn joint(
        &mut self,
        kind: JointKind,
        parent: usize,
        point: Vector,
        axis: Vector,
    ) -> (usize, usize) {
        let n = self.links.len() - 1;
        let s = self.scale;
        let sense = self.seeded.sign();
        let turn = if self.straight { Pose::IDENTITY } else { self.seeded.pose(0.0) };
        let placed = Pose { p: self.at.point(point.map(|x| x * s)), ..turn };
        let (parent, x_root_parent) = self.links[parent];
        let origin = x_root_parent.inverse().then(&placed);
        let along = self.at.direction(axis.map(|x| x * sense));
        let axis = placed.inverse().then(&Pose { p: [0.0; 3], ..Pose::IDENTITY }).direction(along);
        let link = self
            .robot
            .joint(format!("joint{n}"), kind, parent)
            .origin(origin.p)
            .rpy(if self.straight { [0.0; 3] } else { origin.rpy() })
            .axis(axis)
            .link_name(format!("link{n}"))
            .link();
        self.links.push((link, placed));
        self.kinds.push(kind);
        (n, n + 1)
    }

    /// A revolute joint.
    pub fn turn(&mut self, parent: usize, point: Vector, axis: Vector) -> (usize, usize) {
        self.joint(JointKind::Revolute, parent, point, axis)
    }

    /// A prismatic joint.
    pub fn slide(&mut self, parent: usize, point: Vector, axis: Vector) -> (usize, usize) {
        self.joint(JointKind::Prismatic, parent, point, axis)
    }

    /// Cuts at a point, with rows along directions of the mechanism's frame, angular rows first.
    pub fn cut(
        &mut self,
        predecessor: usize,
        successor: usize,
        point: Vector,
        angular: &[Vector],
        linear: &[Vector],
    ) {
        let x_cut = Pose {
            p: self.at.point(point.map(|x| x * self.scale)),
            ..if self.straight { Pose::IDENTITY } else { self.seeded.pose(0.0) }
        };
        let on = |link: usize| {
            let x = self.links[link].1.inverse().then(&x_cut);
            Placement { xyz: x.p, rpy: if self.straight { [0.0; 3] } else { x.rpy() } }
        };
        let back = |v: &Vector| {
            x_cut
                .inverse()
                .then(&Pose { p: [0.0; 3], ..Pose::IDENTITY })
                .direction(self.at.direction(*v))
        };
        let angular = angular.iter().map(|v| (back(v), [0.0; 3]));
        let rows = angular.chain(linear.iter().map(|v| ([0.0; 3], back(v)))).enumerate();
        let cut = self
            .robot
            .cut(format!("cut{predecessor}"), self.links[predecessor].0, self.links[successor].0)
            .placements(on(predecessor), on(successor));
        rows.fold(cut, |cut, (k, (w, v))| {
            cut.row(format!("row{k}"), [w[0], w[1], w[2], v[0], v[1], v[2]])
        });
    }

    /// Sets the independent joints with their reach, and the active joints.
    pub fn roles(&mut self, independent: &[(usize, f64)], active: &[usize]) {
        let mut independent = independent.to_vec();
        if self.seeded.chance(0.5) {
            independent.reverse();
        }
        let leading: Vec<LinkId> = independent.iter().map(|x| self.moved_by(x.0)).collect();
        let driven: Vec<LinkId> = active.iter().map(|j| self.moved_by(*j)).collect();
        self.robot.independent(leading).active(driven);
        self.reach = independent.iter().map(|x| x.1).collect();
    }

    /// Shuffles the joints of the submechanism's list, whose order must not matter to a form that
    /// reads the tree.
    pub fn shuffled(mut self) -> Draft {
        let order = self.seeded.order(self.links.len() - 1);
        let order: Vec<LinkId> = order.into_iter().map(|j| self.moved_by(j)).collect();
        self.robot.order(order);
        self
    }
}
