//! The orders that users see: names, limits and the way from each external index to the internal
//! one.

use crate::closure::Closure;
use crate::compile::assemble::Builder;
use crate::description as written;
use crate::description::JointKind;
use crate::mechanism::Motion;
use crate::model::Limit;

/// Names and limits in external order.
#[derive(Default)]
pub(super) struct Names {
    pub(super) tree: Vec<String>,
    pub(super) tree_q: Vec<String>,
    pub(super) independent: Vec<String>,
    pub(super) independent_q: Vec<String>,
    pub(super) active: Vec<String>,
    pub(super) limits: Vec<Option<written::Limits>>,
}

impl Builder<'_> {
    /// External orders, names and limits.
    pub(super) fn orders(&mut self, moving_of: &[usize]) {
        let order = &mut self.model.order;
        for submechanism in &self.description.submechanisms {
            for &j in &submechanism.spanning_tree {
                let joint = &self.description.joints[j];
                let body = &self.model.bodies[self.body_of[moving_of[j]]];
                if let Some((freedoms, parts)) = parts(body.motion) {
                    order.q.extend(body.q..body.q + parts.len());
                    order.v.extend(body.v..body.v + freedoms.len());
                    self.names
                        .tree
                        .extend(freedoms.iter().map(|part| format!("{}/{part}", joint.name)));
                    self.names
                        .tree_q
                        .extend(parts.iter().map(|part| format!("{}/{part}", joint.name)));
                    self.names.limits.extend(freedoms.iter().map(|_| None));
                    continue;
                }
                order.q.push(body.q);
                order.v.push(body.v);
                self.names.tree.push(joint.name.clone());
                self.names.tree_q.push(joint.name.clone());
                self.names.limits.push(joint.limits);
                if let Some(limits) = joint.limits {
                    let written::Limits { lower, upper, velocity, .. } = limits;
                    let (lower, upper) = if joint.kind == JointKind::Continuous {
                        (f64::NEG_INFINITY, f64::INFINITY)
                    } else {
                        (lower, upper)
                    };
                    self.model.limits.push(Limit { q: body.q, v: body.v, lower, upper, velocity });
                }
            }
        }
        let order = &mut self.model.order;
        for submechanism in &self.description.submechanisms {
            for &j in &submechanism.independent {
                let name = &self.description.joints[j].name;
                let i = self.body_of[moving_of[j]];
                let body = &self.model.bodies[i];
                let cluster = &self.model.clusters[self.model.cluster_of[i]];
                let k = cluster
                    .independent
                    .iter()
                    .position(|local| *local == body.v - cluster.v)
                    .unwrap_or(0);
                if let Some((freedoms, parts)) = parts(body.motion) {
                    order.qy_q.extend(body.q..body.q + parts.len());
                    order.vy_v.extend(body.v..body.v + freedoms.len());
                    order.vy.extend(cluster.vy + k..cluster.vy + k + freedoms.len());
                    self.names
                        .independent
                        .extend(freedoms.iter().map(|part| format!("{name}/{part}")));
                    self.names
                        .independent_q
                        .extend(parts.iter().map(|part| format!("{name}/{part}")));
                    continue;
                }
                order.qy_q.push(body.q);
                order.vy_v.push(body.v);
                order.vy.push(cluster.vy + k);
                self.names.independent.push(name.clone());
                self.names.independent_q.push(name.clone());
            }
            for &j in &submechanism.active {
                let joint = &self.description.joints[j];
                let body = &self.model.bodies[self.body_of[moving_of[j]]];
                order.u_q.push(body.q);
                order.u_v.push(body.v);
                self.names.active.push(joint.name.clone());
                self.model.effort.push(joint.limits.map_or(f64::INFINITY, |limits| limits.effort));
            }
        }
        order.v_external = vec![0; order.v.len()];
        order.v.iter().enumerate().for_each(|(e, v)| order.v_external[*v] = e);
        order.vy_external = vec![0; order.vy.len()];
        order.vy.iter().enumerate().for_each(|(e, k)| order.vy_external[*k] = e);
        order.vy_internal = (0..order.vy.len()).collect();
    }

    /// Names of the tied clusters that are not pure couplings, in the order of their submechanisms;
    /// the second of one submechanism is `name/2`.
    pub(super) fn branches(&mut self) -> Vec<String> {
        let mut owned: Vec<(usize, usize)> = self
            .model
            .tied
            .iter()
            .filter(|c| !matches!(self.model.clusters[**c].closure, Closure::Coupling(_)))
            .map(|c| {
                (self.submechanism_of[self.skeleton.moving[self.partition.members[*c][0]]], *c)
            })
            .collect();
        owned.sort_unstable();
        self.model.order.branches = owned.iter().map(|(_, c)| *c).collect();
        let name = |(k, (s, _)): (usize, &(usize, usize))| {
            let before = owned[..k].iter().filter(|of| of.0 == *s).count();
            let name = &self.description.submechanisms[*s].name;
            if before == 0 { name.clone() } else { format!("{name}/{}", before + 1) }
        };
        owned.iter().enumerate().map(name).collect()
    }
}

/// Names of the velocities and coordinates of a joint of several freedoms.
fn parts(motion: Motion) -> Option<(&'static [&'static str], &'static [&'static str])> {
    const FREEDOMS: [&str; 6] = ["rx", "ry", "rz", "tx", "ty", "tz"];
    const PARTS: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];
    match motion {
        Motion::Spherical => Some((&FREEDOMS[..3], &PARTS[3..])),
        Motion::Floating => Some((&FREEDOMS, &PARTS)),
        Motion::Revolute | Motion::Prismatic => None,
    }
}
