//! Which rows of an answer belong to the joints that a query picks.

use std::collections::HashMap;

use crate::{ModelInfo, Query, Sizes};

/// The rows of an answer that a query picks, space by space, each in the order of the model.
///
/// A query picks joints by runs of their tree velocities ([`Query::joints`]); the rows are those of
/// their coordinates, velocities, independents and actuators. Matrices keep all columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rows {
    /// Tree coordinates, of n_q.
    pub q: Vec<usize>,
    /// Tree velocities, of n_v.
    pub v: Vec<usize>,
    /// Independent coordinates, of n_qy.
    pub qy: Vec<usize>,
    /// Independent velocities, of n_vy.
    pub vy: Vec<usize>,
    /// Actuators, of n_u.
    pub u: Vec<usize>,
}

impl Rows {
    /// The rows that a query picks on a model; all rows if it names no joint.
    pub fn of(query: &Query, model: &ModelInfo) -> Rows {
        let all = |names: &[String]| (0..names.len()).collect();
        if query.joint_runs().is_empty() {
            return Rows {
                q: all(&model.tree_q),
                v: all(&model.tree),
                qy: all(&model.independent_q),
                vy: all(&model.independent),
                u: all(&model.active),
            };
        }
        let is_picked = |v: usize| {
            query.joint_runs().iter().any(|run| (run[0] as usize..run[1] as usize).contains(&v))
        };
        let mut rows = Rows::default();
        let mut names = HashMap::new();
        for joint in model.joints() {
            // a joint of several degrees of freedom is picked as a whole
            let picked = joint.v.clone().any(is_picked);
            names.extend(model.tree_q[joint.q.clone()].iter().map(|name| (name.as_str(), picked)));
            names.extend(model.tree[joint.v.clone()].iter().map(|name| (name.as_str(), picked)));
            if picked {
                rows.q.extend(joint.q);
                rows.v.extend(joint.v);
            }
        }
        let of = |all: &[String]| {
            let is_picked = |k: &usize| names.get(all[*k].as_str()).copied().unwrap_or(false);
            (0..all.len()).filter(is_picked).collect()
        };
        rows.qy = of(&model.independent_q);
        rows.vy = of(&model.independent);
        rows.u = of(&model.active);
        rows
    }

    /// Number of rows in each space; spaces without joints are as in the model.
    pub fn sizes(&self, model: &ModelInfo) -> Sizes {
        Sizes {
            n_q: self.q.len(),
            n_v: self.v.len(),
            n_qy: self.qy.len(),
            n_vy: self.vy.len(),
            n_u: self.u.len(),
            ..model.sizes
        }
    }
}
