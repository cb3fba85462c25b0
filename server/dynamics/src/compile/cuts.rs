//! Turns cut joints and couplings into rows of their clusters.

use crate::compile::assemble::Builder;
use crate::compile::geometry::{pose, vector};
use crate::description::{self as written, Coupling, Loop};
use crate::mechanism::{Cut, CutRow};
use crate::scalar::{Dd, Real};
use crate::spatial::{Matrix, Pose, zero};

impl Builder<'_> {
    /// Adds cuts and couplings to their clusters; returns the submechanism of each external row.
    pub(super) fn rows(&mut self, loops: &[Vec<Loop>]) -> Vec<usize> {
        let mut owner = Vec::new();
        let world = self.zero_poses();
        for (s, submechanism) in self.description.submechanisms.iter().enumerate() {
            for cycle in &loops[s] {
                let (a, b) = self.skeleton.path_between(cycle.predecessor, cycle.successor);
                let Some(&m) = a.first().or(b.first()) else { continue };
                let c = self.model.cluster_of[self.body_of[m]];
                let cut = self.cut(cycle, c, &a, &b, &world);
                let names = cycle.rows.iter().map(|row| format!("{}/{}", cycle.name, row.name));
                self.push_cut(c, cut, names);
                owner.resize(self.names.loops.len(), s);
            }
            for &j in &submechanism.spanning_tree {
                let joint = &self.description.joints[j];
                let Some(coupling) = &joint.coupling else { continue };
                let c = self.model.cluster_of[self.body_of[self.skeleton.moving_of[j]]];
                let cut = self.coupling(j, coupling, self.model.clusters[c].v);
                self.push_cut(c, cut, [format!("{}/coupling", joint.name)]);
                owner.resize(self.names.loops.len(), s);
            }
        }
        owner
    }

    /// Adds a cut to a cluster, with the names of its rows.
    fn push_cut(&mut self, c: usize, cut: Cut<Dd>, names: impl IntoIterator<Item = String>) {
        let first = self.names.loops.len();
        self.names.loops.extend(names);
        let cluster = &mut self.model.clusters[c];
        cluster.rows.extend(first..self.names.loops.len());
        cluster.cuts.push(cut);
    }

    /// A coupling of a joint as a cut of one row; `first_v` is the cluster's first velocity.
    fn coupling(&self, joint: usize, coupling: &Coupling, first_v: usize) -> Cut<Dd> {
        let local = |j: usize| self.body(j).v - first_v;
        let mut terms = vec![(local(joint), Dd::ONE)];
        for (master, multiplier) in &coupling.terms {
            terms.push((local(*master), -Dd::from_f64(*multiplier)));
        }
        let path = terms.iter().map(|(v, _)| (*v, true)).collect();
        let row = CutRow {
            angular: zero(),
            linear: zero(),
            linear_p: zero(),
            against: None,
            terms,
            offset: -Dd::from_f64(coupling.offset),
        };
        Cut {
            predecessor: 0,
            successor: 0,
            x_p_cut: Pose::identity(),
            x_s_cut: Pose::identity(),
            rows: vec![row],
            path,
            angular: false,
        }
    }

    /// Pose of every body at zero {root}.
    fn zero_poses(&self) -> Vec<Pose<Dd>> {
        let mut world = vec![Pose::identity()];
        for body in &self.model.bodies[1..] {
            world.push(
                world[body.parent].then(&Pose { R: body.R_parent_body, p: body.p_parent_body }),
            );
        }
        world
    }

    /// A loop as a cut of a cluster; `a` and `b` are the joints on the predecessor's and the
    /// successor's side.
    fn cut(&self, cycle: &Loop, c: usize, a: &[usize], b: &[usize], world: &[Pose<Dd>]) -> Cut<Dd> {
        let cluster = &self.model.clusters[c];
        let local = |link: usize| {
            let body = self.model.frames[link].body;
            if body >= cluster.body && body < cluster.body + cluster.n {
                body - cluster.body + 1
            } else {
                0
            }
        };
        let p = local(cycle.predecessor);
        let s = local(cycle.successor);
        let global =
            |local: usize| if local == 0 { cluster.parent } else { cluster.body + local - 1 };
        let in_root = |link: usize| {
            world[self.model.frames[link].body].then(&self.model.frames[link].x_body_frame)
        };
        let (P, S) = match &cycle.cut {
            written::Cut::AtJoint(j) => {
                let frame = in_root(self.description.joints[*j].child);
                (frame, frame)
            }
            written::Cut::AtLink(link) => (in_root(*link), in_root(*link)),
            written::Cut::Placed { predecessor, successor } => (
                in_root(cycle.predecessor).then(&pose(predecessor)),
                in_root(cycle.successor).then(&pose(successor)),
            ),
        };
        let x_p_cut = world[global(p)].inverse().then(&P);
        let rows = cycle.rows.iter().map(|row| {
            let [wx, wy, wz, vx, vy, vz] = row.axis;
            let against = row.against.map(vector);
            let linear = if against.is_some() { zero() } else { vector([vx, vy, vz]) };
            CutRow {
                angular: vector([wx, wy, wz]),
                linear,
                linear_p: x_p_cut.R.apply(linear),
                against,
                terms: Vec::new(),
                offset: Dd::ZERO,
            }
        });
        let path = a.iter().map(|m| (m, false)).chain(b.iter().map(|m| (m, true))).flat_map(
            |(m, side)| {
                let body = &self.model.bodies[self.body_of[*m]];
                (0..body.motion.n_v()).map(move |k| (body.v - cluster.v + k, side))
            },
        );
        Cut {
            predecessor: p,
            successor: s,
            x_p_cut,
            x_s_cut: world[global(s)].inverse().then(&S),
            rows: rows.collect(),
            path: path.collect(),
            angular: cycle.rows.iter().any(|row| row.axis[..3].iter().any(|x| *x != 0.0)),
        }
    }
}
