//! Bodies, joints and clusters in depth-first order, and the inertia of the bodies.

use crate::closure::Closure;
use crate::compile::assemble::Builder;
use crate::compile::geometry::inertia;
use crate::description::JointKind;
use crate::mechanism::{Body, Cluster, Dof, Frame, Motion, Windings};
use crate::scalar::Dd;
use crate::spatial::{Pose, zero};

/// Independent and dependent velocities and coordinates of a cluster, and its actuators as (place
/// in u, velocity).
struct Roles {
    independent: Vec<usize>,
    dependent: Vec<usize>,
    independent_q: Vec<usize>,
    dependent_q: Vec<usize>,
    active: Vec<(usize, usize)>,
}

impl Builder<'_> {
    /// Bodies and clusters in depth-first order, without inertia.
    pub(super) fn bodies(&mut self) {
        let partition = self.partition;
        for (joints, parent) in partition.members.iter().zip(&partition.parent) {
            self.add_cluster(joints, parent.map_or(0, |m| self.body_of[m]));
        }
    }

    /// Adds a cluster of moving joints on a parent body.
    fn add_cluster(&mut self, joints: &[usize], parent: usize) {
        let body = self.model.bodies.len();
        let c = self.model.clusters.len();
        let last = self.model.clusters.last();
        let q = last.map_or(0, |last| last.q + last.n_q);
        let v = last.map_or(0, |last| last.v + last.n_v);
        let vy = last.map_or(0, |last| last.vy + last.n_vy);
        let mut n_q = 0;
        let mut n_v = 0;
        let mut dofs = Vec::new();
        let mut local_parent = Vec::new();
        for (local, &m) in joints.iter().enumerate() {
            let added = self.new_body(m, q + n_q, v + n_v);
            local_parent.push((added.parent + 1).saturating_sub(body));
            let motion = added.motion;
            dofs.extend((0..motion.n_v()).map(|k| Dof {
                v: n_v + k,
                q: n_q,
                body: local,
                k,
                motion,
                single: motion.n_v() == 1,
            }));
            self.body_of[m] = self.model.bodies.len();
            self.model.bodies.push(added);
            self.model.cluster_of.push(c);
            self.model.cluster_of_v.extend(std::iter::repeat_n(c, motion.n_v()));
            n_q += motion.n_q();
            n_v += motion.n_v();
        }
        let Roles { independent, dependent, independent_q, dependent_q, active } =
            self.roles(joints, q, v);
        let n_vy = independent.len();
        let g_offset = self.model.n_g;
        self.model.n_g += n_v * n_vy;
        // the nearest independent that carries each independent
        let carrier = self.last_independent(parent);
        for k in 0..n_vy {
            self.model.sparsity.push(if k == 0 { carrier } else { vy + k - 1 });
        }
        self.model.clusters.push(Cluster {
            parent,
            body,
            n: joints.len(),
            v,
            q,
            n_v,
            n_q,
            dofs,
            vy,
            n_vy,
            g_offset,
            independent,
            dependent,
            locked: Vec::new(),
            independent_q,
            dependent_q,
            local_parent,
            active,
            windings: Windings::default(),
            cuts: Vec::new(),
            rows: Vec::new(),
            used: Vec::new(),
            other_rows: Vec::new(),
            length: 1.0,
            units: vec![1.0; n_v],
            least_authority: 1.0,
        });
        self.model.closures.push(Closure::Serial);
    }

    /// The body of a moving joint with the joint's axis on z at both ends, without inertia.
    fn new_body(&self, m: usize, q: usize, v: usize) -> Body<Dd> {
        let joint = &self.description.joints[self.skeleton.moving[m]];
        let x_parent_link = self.skeleton.x_parent_joint[m];
        let in_parent = match self.skeleton.parent[m] {
            Some(p) => Pose { R: self.R_link_body[p].transpose(), p: zero() }.then(&x_parent_link),
            None => x_parent_link,
        };
        let x_parent_body = in_parent.then(&Pose { R: self.R_link_body[m], p: zero() });
        let motion = match joint.kind {
            JointKind::Prismatic => Motion::Prismatic,
            JointKind::Spherical => Motion::Spherical,
            JointKind::Floating => Motion::Floating,
            _ => Motion::Revolute,
        };
        Body {
            parent: self.skeleton.parent[m].map_or(0, |p| self.body_of[p]),
            motion,
            q,
            v,
            R_parent_body: x_parent_body.R,
            p_parent_body: x_parent_body.p,
            p_local: x_parent_body.p,
            ..self.model.bodies[0].clone()
        }
    }

    /// The last independent velocity of the nearest cluster towards the root that has one.
    fn last_independent(&self, mut body: usize) -> usize {
        while body != 0 {
            let cluster = &self.model.clusters[self.model.cluster_of[body]];
            if cluster.n_vy > 0 {
                return cluster.vy + cluster.n_vy - 1;
            }
            body = cluster.parent;
        }
        usize::MAX
    }

    /// Independent, dependent and active joints of a cluster by local velocity and coordinate.
    fn roles(&self, joints: &[usize], first_q: usize, first_v: usize) -> Roles {
        let body = |m: &usize| &self.model.bodies[self.body_of[*m]];
        let velocities = |m: &usize| {
            let v = body(m).v - first_v;
            v..v + body(m).motion.n_v()
        };
        let coordinates = |m: &usize| {
            let q = body(m).q - first_q;
            q..q + body(m).motion.n_q()
        };
        let local = |j: &usize| joints.iter().find(|m| self.skeleton.moving[**m] == *j);
        let independent: Vec<&usize> = self
            .description
            .submechanisms
            .iter()
            .flat_map(|s| &s.independent)
            .filter_map(local)
            .collect();
        let dependent = || joints.iter().filter(|m| !independent.contains(m));
        let active = self.description.submechanisms.iter().flat_map(|s| &s.active).enumerate();
        Roles {
            active: active
                .filter_map(|(u, j)| local(j).map(|m| (u, body(m).v - first_v)))
                .collect(),
            dependent: dependent().flat_map(velocities).collect(),
            dependent_q: dependent().flat_map(coordinates).collect(),
            independent: independent.iter().copied().flat_map(velocities).collect(),
            independent_q: independent.iter().copied().flat_map(coordinates).collect(),
        }
    }

    /// Link frames, and the inertia of each body from the links that it carries.
    pub(super) fn frames(&mut self) {
        for (link, written) in self.description.links.iter().enumerate() {
            let x = self.skeleton.x_carrier_link[link];
            let (body, x_body_frame) = match self.skeleton.carrier[link] {
                Some(m) => (
                    self.body_of[m],
                    Pose { R: self.R_link_body[m].transpose(), p: zero() }.then(&x),
                ),
                None => (0, x),
            };
            self.model.frames.push(Frame { body, x_body_frame });
            if let (Some(inertial), true) = (&written.inertial, body != 0) {
                let (mass, h, I) = inertia(inertial, &x_body_frame);
                let to = &mut self.model.bodies[body];
                to.mass += mass;
                to.h += h;
                let places = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
                to.inertia.iter_mut().zip(places).for_each(|(entry, at)| *entry += I[at]);
            }
        }
    }
}
