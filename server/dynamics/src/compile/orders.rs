//! External orders: names, limits and the map from each external index to the internal one.

use crate::closure::Closure;
use crate::compile::assemble::Builder;
use crate::description::{JointKind, Limits};
use crate::mechanism::{Motion, Motor};
use crate::model::Limit;

impl Builder<'_> {
    /// External orders, names and limits.
    pub(super) fn orders(&mut self) {
        for submechanism in &self.description.submechanisms {
            for &j in &submechanism.spanning_tree {
                self.add_joint(j);
            }
        }
        for submechanism in &self.description.submechanisms {
            for &j in &submechanism.independent {
                self.add_independent(j);
            }
            for &j in &submechanism.active {
                let joint = &self.description.joints[j];
                let body = self.body(j);
                let q = body.q;
                let v = body.v;
                self.model.order.u_q.push(q);
                self.model.order.u_v.push(v);
                self.meta.active.push(joint.name.clone());
                let Limits { effort, velocity, .. } = joint.limits.unwrap_or(Limits::NONE);
                self.model.effort.push(effort);
                let known = joint.motor.as_ref();
                self.model.motors.push(Motor {
                    effort,
                    velocity,
                    driving: known.map_or_else(Vec::new, |motor| motor.driving.clone()),
                    braking: known.map_or_else(Vec::new, |motor| motor.braking.clone()),
                    power: known.map_or(f64::INFINITY, |motor| motor.power),
                    efficiency: known.map_or([1.0; 2], |motor| motor.efficiency),
                });
            }
        }
        let order = &mut self.model.order;
        order.v_external = vec![0; order.v.len()];
        order.v.iter().enumerate().for_each(|(e, v)| order.v_external[*v] = e);
        order.vy_external = vec![0; order.vy.len()];
        order.vy.iter().enumerate().for_each(|(e, k)| order.vy_external[*k] = e);
        order.vy_internal = (0..order.vy.len()).collect();
    }

    /// Adds a joint to the order of q and q̇.
    fn add_joint(&mut self, j: usize) {
        let joint = &self.description.joints[j];
        let body = self.body(j);
        let q = body.q;
        let v = body.v;
        let motion = body.motion;
        let i = self.body_of[self.skeleton.moving_of[j]];
        self.model.order.bodies.push((i, joint.child));
        self.model.order.q.extend(q..q + motion.n_q());
        self.model.order.v.extend(v..v + motion.n_v());
        self.meta.tree.extend(velocity_names(&joint.name, motion));
        self.meta.tree_q.extend(coordinate_names(&joint.name, motion));
        if motion.n_v() > 1 {
            self.meta.limits.extend(std::iter::repeat_n(None, motion.n_v()));
            return;
        }
        self.meta.limits.push(joint.limits.map(Limits::finite));
        if let Some(Limits { mut lower, mut upper, velocity, .. }) = joint.limits {
            if joint.kind == JointKind::Continuous {
                lower = f64::NEG_INFINITY;
                upper = f64::INFINITY;
            }
            self.model.limits.push(Limit { q, v, lower, upper, velocity });
        }
    }

    /// Adds a joint to the order of y and ẏ.
    fn add_independent(&mut self, j: usize) {
        let name = &self.description.joints[j].name;
        let i = self.body_of[self.skeleton.moving_of[j]];
        let body = &self.model.bodies[i];
        let cluster = &self.model.clusters[self.model.cluster_of[i]];
        let local = |v: &usize| *v == body.v - cluster.v;
        let first = cluster.vy + cluster.independent.iter().position(local).unwrap_or(0);
        let order = &mut self.model.order;
        order.qy_q.extend(body.q..body.q + body.motion.n_q());
        order.vy_v.extend(body.v..body.v + body.motion.n_v());
        order.vy.extend(first..first + body.motion.n_v());
        self.meta.independent.extend(velocity_names(name, body.motion));
        self.meta.independent_q.extend(coordinate_names(name, body.motion));
    }

    /// Names of the closed clusters that are not pure couplings, in the order of their
    /// submechanisms; the second of one submechanism is `name/2`.
    pub(super) fn branches(&mut self) -> Vec<String> {
        let mut owned: Vec<(usize, usize)> = self
            .model
            .closed_clusters
            .iter()
            .filter(|c| !matches!(self.model.closures[**c], Closure::Coupling(_)))
            .map(|c| {
                (self.submechanism_of[self.skeleton.moving[self.partition.members[*c][0]]], *c)
            })
            .collect();
        owned.sort_unstable();
        self.model.order.branches = owned.iter().map(|(_, c)| *c).collect();
        let name = |(k, (s, _)): (usize, &(usize, usize))| {
            let before = owned[..k].iter().filter(|other| other.0 == *s).count();
            let name = &self.description.submechanisms[*s].name;
            if before == 0 { name.clone() } else { format!("{name}/{}", before + 1) }
        };
        owned.iter().enumerate().map(name).collect()
    }
}

/// Names of the velocities of a joint: the joint's own for one, `name/rx` and so on for several.
fn velocity_names(name: &str, motion: Motion) -> Vec<String> {
    const PARTS: [&str; 6] = ["rx", "ry", "rz", "tx", "ty", "tz"];
    parts(name, if motion.n_v() > 1 { &PARTS[..motion.n_v()] } else { &[] })
}

/// Names of the coordinates of a joint, likewise.
fn coordinate_names(name: &str, motion: Motion) -> Vec<String> {
    const PARTS: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];
    parts(name, if motion.n_q() > 1 { &PARTS[7 - motion.n_q()..] } else { &[] })
}

fn parts(name: &str, parts: &[&str]) -> Vec<String> {
    if parts.is_empty() {
        return vec![name.to_owned()];
    }
    parts.iter().map(|part| format!("{name}/{part}")).collect()
}
