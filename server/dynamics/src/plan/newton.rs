//! The closures of [`Plan::close`] in pieces without branches, for code that iterates by itself.

use crate::closure::{Closure, column_unit, scaled};
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::state::hold_idle;
use crate::scalar::Real;
use crate::workspace::Workspace;

/// A cluster that Newton's method closes block by block, from the zero pose. Coordinates have the
/// numbers of the array that [`Plan::newton_start`] begins.
#[derive(Clone, Debug)]
pub struct NewtonCluster {
    /// Its independents, each with the number by which its way becomes radians or cluster lengths.
    pub independents: Vec<(usize, f64)>,
    /// Its blocks in the order of solution.
    pub blocks: Vec<NewtonBlock>,
    /// Residual at which an attempt ends.
    pub floor: f64,
    /// Its characteristic length `[m]`.
    pub length: f64,
    /// How far the independents may go from zero in one attempt, in radians or cluster lengths.
    pub reach: f64,
}

/// A block of a cluster.
#[derive(Clone, Debug)]
pub struct NewtonBlock {
    cluster: usize,
    block: usize,
    /// The coordinates that it determines.
    pub unknowns: Vec<usize>,
    /// The sign of its determinant at the last closed pose is to be kept.
    pub remembers: bool,
    /// One step of any length solves it.
    pub couples: bool,
}

impl NewtonBlock {
    /// Numbers that [`Plan::newton_step`] puts out.
    pub fn outputs(&self) -> usize {
        self.unknowns.len() + 4
    }
}

impl Plan {
    /// The clusters that [`Plan::close`] closes, if Newton's method on their rows closes each of
    /// them, by one choice among redundant rows and with joints of one degree of freedom alone.
    /// Allocates.
    pub fn newton_clusters(&self, model: &Model<f64>) -> Option<Vec<NewtonCluster>> {
        let cluster = |c: &usize| {
            let cluster = &model.clusters[*c];
            let Closure::Numerical(numerical) = &model.closures[*c] else { return None };
            let [choice] = numerical.choices.as_slice() else { return None };
            if numerical.meets || !cluster.dofs.iter().all(|dof| dof.single) {
                return None;
            }
            let independents = cluster.independent.iter().map(|v| {
                let unit = column_unit(cluster, *v);
                (cluster.q + cluster.dofs[*v].q, 1.0 / unit)
            });
            let blocks = choice.blocks.iter().enumerate().map(|(b, block)| NewtonBlock {
                cluster: *c,
                block: b,
                unknowns: block.unknowns.iter().map(|dof| cluster.q + dof.q).collect(),
                remembers: block.remember,
                couples: block.couples,
            });
            Some(NewtonCluster {
                independents: independents.collect(),
                blocks: blocks.collect(),
                floor: 8.0 * f64::EPSILON * cluster.length,
                length: cluster.length,
                reach: numerical.reach,
            })
        };
        self.closed.by_newton.iter().map(cluster).collect()
    }

    /// The coordinates at zero, and for each of y its place among them. Allocates.
    pub fn newton_start(model: &Model<f64>) -> (Vec<f64>, Vec<usize>) {
        (model.zero.clone(), model.order.qy_q.clone())
    }

    /// One Newton step of a block from these coordinates: its unknowns after the step, the size of
    /// the step in radians or cluster lengths, the residual before it, the determinant of the
    /// block, and 1/sin² of the least angle between a column and the span of the others. Allocates
    /// never.
    pub fn newton_step<T: Real>(
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        block: &NewtonBlock,
        q: &[T],
        output: &mut [T],
    ) {
        let cluster = &model.clusters[block.cluster];
        let Closure::Numerical(numerical) = &model.closures[block.cluster] else { return };
        workspace.q.copy_from_slice(q);
        let bodies = model.bodies_of(cluster);
        let mut local = workspace.local(cluster, bodies);
        let figures = numerical.one_step(block.block, &mut local);
        let unknowns = block.unknowns.iter().map(|i| workspace.q[*i]);
        output.iter_mut().zip(unknowns.chain(figures)).for_each(|(to, x)| *to = x);
    }

    /// The numbers that [`Plan::close`] puts behind the given ones, at closed coordinates; whether
    /// they mean something. Allocates never.
    pub fn closed_at<T: Real>(
        &self,
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        input: &[T],
        q: &[T],
        output: &mut [T],
    ) -> bool {
        let ws = workspace;
        let mut sound = self.set_state(model, ws, input).is_ok();
        let mut largest = T::ONE;
        for c in &self.closed.by_newton {
            let cluster = &model.clusters[*c];
            let Closure::Numerical(numerical) = &model.closures[*c] else { return false };
            hold_idle(cluster, ws);
            ws.q[cluster.coordinates()].copy_from_slice(&q[cluster.coordinates()]);
            let bodies = model.bodies_of(cluster);
            let level = self.steps.level;
            let (good, gain) = numerical.rates_at(&mut ws.local(cluster, bodies), level);
            sound &= good;
            largest = largest.larger(gain);
        }
        self.closed.save(ws, largest, output);
        sound
    }

    /// Coordinates as [`Plan::newton_start`] has them in the order of q. Allocates.
    pub fn tree_order(model: &Model<f64>, coordinates: &[f64]) -> Vec<f64> {
        model.order.q.iter().map(|i| coordinates[*i]).collect()
    }

    /// Side of the scaled K_d of each cluster with loops. Allocates.
    pub fn loop_sizes<C>(model: &Model<C>) -> Vec<usize> {
        let clusters = model.closed_clusters.iter();
        clusters.map(|c| model.clusters[*c].dependent.len()).collect()
    }

    /// These matrices, row by row, at closed tree coordinates q: the least of their singular values
    /// is `sigma_min`. Allocates never.
    pub fn scaled_loops<T: Real>(
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        q: &[T],
        output: &mut [T],
    ) {
        model.order.q.iter().zip(q).for_each(|(i, x)| workspace.q[*i] = *x);
        let mut first = 0;
        for c in &model.closed_clusters {
            let cluster = &model.clusters[*c];
            let m = cluster.dependent.len();
            workspace.constraint_jacobian(cluster, model.bodies_of(cluster));
            let K = &workspace.scratch.K;
            let rows = cluster.used.iter().copied();
            scaled(cluster, K, rows, &cluster.dependent, |i, a, x| output[first + i * m + a] = x);
            first += m * m;
        }
    }
}
