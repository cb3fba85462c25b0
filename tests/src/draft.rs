//! One mechanism as a description, drawn in a frame that is put anywhere.

use sarrus_dynamics::description::{
    Cut, Description, Inertial, Joint, JointKind, Link, Loop, Placement, Row, Submechanism,
    SubmechanismKind as Kind, Terms,
};

use crate::rigid::{Pose, Vector};
use crate::seed::Seeded;

/// One mechanism under construction, drawn in a frame that is put anywhere on the base.
#[derive(Clone, Debug)]
pub struct Draft {
    /// What is drawn next.
    pub seeded: Seeded,
    /// What 1 is in its drawing `[m]`.
    pub scale: f64,
    /// Everything along the axes of the root: what the files hold is then exact.
    pub straight: bool,
    /// Where its frame is.
    pub at: Pose,
    /// What is drawn.
    pub description: Description,
    /// Pose of each link.
    pub poses: Vec<Pose>,
    /// How far each independent joint may go.
    pub reach: Vec<f64>,
}

impl Draft {
    /// A base with nothing on it; of random size and place unless it is to be straight.
    pub fn new(seed: u64, kind: Kind, straight: bool) -> Draft {
        let mut seeded = Seeded::new(seed);
        let scale = if straight { 1.0 } else { 10f64.powi(seeded.below(7) as i32 - 3) };
        let at = if straight { Pose::IDENTITY } else { seeded.pose(scale) };
        let part = Submechanism {
            name: "part".into(),
            kind,
            type_name: format!("{kind:?}"),
            spanning_tree: vec![],
            independent: vec![],
            active: vec![],
            loops: vec![],
        };
        let description = Description {
            name: format!("seed {seed}"),
            links: vec![Link { name: "base".into(), inertial: None }],
            joints: vec![],
            submechanisms: vec![part],
            gravity: [0.0, 0.0, -9.81],
        };
        Draft {
            seeded,
            scale,
            straight,
            at,
            description,
            poses: vec![Pose::IDENTITY],
            reach: vec![],
        }
    }

    /// A joint on a link through a point along an axis, either way round, both in the mechanism's
    /// frame; returns joint and child link.
    pub fn joint(
        &mut self,
        kind: JointKind,
        parent: usize,
        point: Vector,
        axis: Vector,
    ) -> (usize, usize) {
        let (n, s) = (self.description.joints.len(), self.scale);
        let sense = self.seeded.sign();
        let turn = if self.straight { Pose::IDENTITY } else { self.seeded.pose(0.0) };
        let placed = Pose { p: self.at.point(point.map(|x| x * s)), ..turn };
        let origin = self.poses[parent].inverse().then(&placed);
        let along = self.at.direction(axis.map(|x| x * sense));
        let inertial = Inertial {
            origin: Placement { xyz: [0.1 * s, 0.0, 0.05 * s], rpy: [0.0; 3] },
            mass: 1.0,
            inertia: [s * s, 0.0, 0.0, s * s, 0.0, s * s],
        };
        self.description.links.push(Link { name: format!("link{n}"), inertial: Some(inertial) });
        self.description.joints.push(Joint {
            name: format!("joint{n}"),
            kind,
            parent,
            child: n + 1,
            origin: Placement {
                xyz: origin.p,
                rpy: if self.straight { [0.0; 3] } else { origin.rpy() },
            },
            axis: placed.inverse().then(&Pose { p: [0.0; 3], ..Pose::IDENTITY }).direction(along),
            limits: None,
            coupling: None,
            terms: Terms::default(),
        });
        self.poses.push(placed);
        self.description.submechanisms[0].spanning_tree.push(n);
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

    /// A cut at a point, its rows along directions of the mechanism's frame; angular ones first.
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
            let x = self.poses[link].inverse().then(&x_cut);
            Placement { xyz: x.p, rpy: if self.straight { [0.0; 3] } else { x.rpy() } }
        };
        let back = |v: &Vector| {
            x_cut
                .inverse()
                .then(&Pose { p: [0.0; 3], ..Pose::IDENTITY })
                .direction(self.at.direction(*v))
        };
        let angular = angular.iter().map(|v| (back(v), [0.0; 3]));
        let rows = angular.chain(linear.iter().map(|v| ([0.0; 3], back(v)))).enumerate().map(
            |(k, (w, v))| Row {
                name: format!("row{k}"),
                axis: [w[0], w[1], w[2], v[0], v[1], v[2]],
                against: None,
            },
        );
        let of = Loop {
            name: format!("cut{predecessor}"),
            predecessor,
            successor,
            cut: Cut::Placed { predecessor: on(predecessor), successor: on(successor) },
            rows: rows.collect(),
        };
        self.description.submechanisms[0].loops.push(of);
    }

    /// Independent and active joints, and how far each independent one may go.
    pub fn roles(&mut self, independent: &[(usize, f64)], active: &[usize]) {
        let mut independent = independent.to_vec();
        if self.seeded.chance(0.5) {
            independent.reverse();
        }
        let part = &mut self.description.submechanisms[0];
        part.independent = independent.iter().map(|x| x.0).collect();
        part.active = active.to_vec();
        self.reach = independent.iter().map(|x| x.1).collect();
    }

    /// The joints of the list in any order; a joint's place in it says nothing to a form that reads
    /// the tree.
    pub fn shuffled(mut self) -> Draft {
        let tree = self.description.submechanisms[0].spanning_tree.clone();
        let order = self.seeded.order(tree.len());
        self.description.submechanisms[0].spanning_tree = order.iter().map(|k| tree[*k]).collect();
        self
    }
}
