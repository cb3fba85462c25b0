//! Bodies, joints and clusters in depth-first order, and what the links weigh.

use crate::closure::Closure;
use crate::compile::assemble::Builder;
use crate::compile::geometry::inertia;
use crate::description::JointKind;
use crate::mechanism::{Body, Cluster, Dof, Frame, Motion};
use crate::scalar::{Dd, Real};
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
        let (mut q, mut v, mut vy) = (0, 0, 0);
        for (c, joints) in self.partition.members.iter().enumerate() {
            let parent = self.partition.parent[c].map_or(0, |m| self.body_of[m]);
            let body = self.model.bodies.len();
            let (first_q, first_v) = (q, v);
            let (mut local_parent, mut dofs) = (Vec::new(), Vec::new());
            for &m in joints {
                let joint = &self.description.joints[self.skeleton.moving[m]];
                let x_parent_link = self.skeleton.x_parent_joint[m];
                // both ends of the joint in frames with the axis on z
                let in_parent = match self.skeleton.parent[m] {
                    Some(p) => {
                        Pose { R: self.R_link_body[p].transpose(), p: zero() }.then(&x_parent_link)
                    }
                    None => x_parent_link,
                };
                let placed = in_parent.then(&Pose { R: self.R_link_body[m], p: zero() });
                let motion = match joint.kind {
                    JointKind::Prismatic => Motion::Prismatic,
                    JointKind::Spherical => Motion::Spherical,
                    JointKind::Floating => Motion::Floating,
                    _ => Motion::Revolute,
                };
                let (n_q, n_v) = (motion.n_q(), motion.n_v());
                let local = self.model.bodies.len() - body;
                dofs.extend((0..n_v).map(|k| Dof {
                    v: v - first_v + k,
                    q: q - first_q,
                    body: local,
                    k,
                    motion,
                    single: n_v == 1,
                }));
                let parent_body = self.skeleton.parent[m].map_or(0, |p| self.body_of[p]);
                local_parent.push(if parent_body >= body { parent_body - body + 1 } else { 0 });
                self.body_of[m] = self.model.bodies.len();
                self.model.bodies.push(Body {
                    parent: parent_body,
                    motion,
                    q,
                    v,
                    R_parent_body: placed.R,
                    p_parent_body: placed.p,
                    mass: Dd::ZERO,
                    h: zero(),
                    inertia: [Dd::ZERO; 6],
                });
                self.model.cluster_of.push(c);
                self.model.cluster_of_v.extend(std::iter::repeat_n(c, n_v));
                (q, v) = (q + n_q, v + n_v);
            }
            let Roles { independent, dependent, independent_q, dependent_q, active } =
                self.roles(joints, first_q, first_v);
            let n_vy = independent.len();
            let (n_v, g_offset) = (v - first_v, self.model.n_g);
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
                v: first_v,
                q: first_q,
                n_v,
                n_q: q - first_q,
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
                cuts: Vec::new(),
                rows: Vec::new(),
                used: Vec::new(),
                length: 1.0,
            });
            self.model.closures.push(Closure::Serial);
            vy += n_vy;
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

    /// What each joint of a cluster is, by local velocity and coordinate.
    fn roles(&self, joints: &[usize], first_q: usize, first_v: usize) -> Roles {
        let written = |m: &usize| self.skeleton.moving[*m];
        let body = |m: &usize| &self.model.bodies[self.body_of[*m]];
        let velocities = |m: &usize| {
            (body(m).v - first_v..body(m).v - first_v + body(m).motion.n_v()).collect::<Vec<_>>()
        };
        let coordinates = |m: &usize| {
            (body(m).q - first_q..body(m).q - first_q + body(m).motion.n_q()).collect::<Vec<_>>()
        };
        let local = |j: &usize| joints.iter().find(|m| written(m) == *j);
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
                for (entry, x) in to.inertia.iter_mut().zip([
                    I[(0, 0)],
                    I[(0, 1)],
                    I[(0, 2)],
                    I[(1, 1)],
                    I[(1, 2)],
                    I[(2, 2)],
                ]) {
                    *entry += x;
                }
            }
        }
    }
}
