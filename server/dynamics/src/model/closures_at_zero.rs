//! Report on the loops of each submechanism at the zero pose.

use crate::closure::{Closure, Scratch, assembly_branch, dependents_range};
use crate::mechanism::{Body, Cluster};
use crate::model::{Model, Part};

/// The loops of one submechanism at the zero pose, with those of any submechanism tied to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClosureAtZero {
    /// Redundant rows.
    pub redundant: Vec<String>,
    /// Sign of det K_d of each cluster that has a branch, 1 or −1; 0 where the pose is singular.
    pub branch: Vec<f64>,
    /// Least singular value of the scaled K_d; 1 without loops.
    pub sigma_min: f64,
    /// Condition number of the scaled K_d; infinite where the pose is singular, 1 without loops.
    pub cond_Kd: f64,
    /// Cells of the table of closed poses where a numerical closure starts without a guess, and
    /// its size `[B]`; 0 without one. Equal limbs share one table.
    pub seeds: (usize, usize),
    /// The parts of its clusters' closures.
    pub parts: Vec<Part>,
}

impl Model<f64> {
    /// The loops of each submechanism at the zero pose, in the order of [`Model::closures`]. Scaled
    /// as the field `sigma_min` is. Allocates.
    pub fn closures_at_zero(&self) -> Vec<ClosureAtZero> {
        let mut first = 0;
        let mut found = Vec::new();
        for info in self.closures() {
            // rows come in the order of the submechanisms
            let own = first..first + info.rows;
            first = own.end;
            found.push(self.closure_of(own));
        }
        found
    }

    /// The clusters that hold any of these rows.
    fn closure_of(&self, own: std::ops::Range<usize>) -> ClosureAtZero {
        let mut found = ClosureAtZero { sigma_min: 1.0, cond_Kd: 1.0, ..ClosureAtZero::default() };
        for &c in self
            .closed_clusters
            .iter()
            .filter(|c| self.clusters[**c].rows.iter().any(|row| own.contains(row)))
        {
            found.parts.extend(self.parts_of(c));
            let cluster = &self.clusters[c];
            let bodies = self.bodies_of(cluster);
            let zero = &self.zero[cluster.coordinates()];
            let unused = (0..cluster.rows.len())
                .filter(|r| !cluster.used.contains(r))
                .map(|r| cluster.rows[r]);
            found.redundant.extend(
                unused.filter(|row| own.contains(row)).map(|row| self.meta.loops[row].clone()),
            );

            let ((largest, least), branch) = assess(cluster, bodies, zero);
            found.sigma_min = found.sigma_min.min(least);
            found.cond_Kd =
                found.cond_Kd.max(if branch == 0.0 { f64::INFINITY } else { largest / least });
            if let Closure::Numerical(numerical) = &self.closures[c]
                && let Some(seeds) = &numerical.seeds
            {
                let (cells, bytes) = seeds.size();
                found.seeds = (found.seeds.0 + cells, found.seeds.1 + bytes);
            }
            if self.order.branches.contains(&c) {
                found.branch.push(branch);
            }
        }
        found
    }
}

/// Largest and least singular value of the scaled K_d of one cluster at a pose, and its branch, 0
/// where the pose is singular. Allocates.
pub(crate) fn assess(cluster: &Cluster<f64>, bodies: &[Body<f64>], q: &[f64]) -> ((f64, f64), f64) {
    let mut scratch = Scratch::at(cluster, bodies, q);
    let (largest, least) = dependents_range(cluster, &mut scratch);
    let branch =
        if least <= f64::EPSILON * largest { 0.0 } else { assembly_branch(cluster, &mut scratch) };
    ((largest, least), branch)
}
