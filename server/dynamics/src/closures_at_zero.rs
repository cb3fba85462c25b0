//! What a person wants to know about the loops of each submechanism at the zero pose.

use crate::assembly::Problem;
use crate::linear::solve_pivoted;
use crate::model::Model;

/// The loops of one submechanism at the zero pose; where its loops are tied to those of another, those of both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClosureAtZero {
    /// Rows that say nothing new.
    pub redundant: Vec<String>,
    /// Sign of det K_d of each cluster that has a branch, 1 or −1; 0 where the pose is singular.
    pub branch: Vec<f64>,
    /// Least singular value of the scaled K_d; 1 without loops.
    pub sigma_min: f64,
    /// Condition number of the scaled K_d; infinite where the pose is singular, 1 without loops.
    pub cond_Kd: f64,
}

impl Model<f64> {
    /// The loops of each submechanism at the zero pose, in the order of [`Model::closures`]. Rows are scaled as in [`Model::assemble`].
    /// Allocates.
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
        for &c in self.tied.iter().filter(|c| self.clusters[**c].rows.iter().any(|row| own.contains(row))) {
            let cluster = &self.clusters[c];
            let bodies = &self.bodies[cluster.body..cluster.body + cluster.n];
            let zero = &self.zero[cluster.q..cluster.q + cluster.n_q];
            let unused = (0..cluster.rows.len()).filter(|r| !cluster.used.contains(r)).map(|r| cluster.rows[r]);
            found.redundant.extend(unused.filter(|row| own.contains(row)).map(|row| self.meta.loops[row].clone()));

            let problem = Problem::new(cluster, bodies, zero, &vec![1.0; cluster.n_v]);
            let K = problem.scaled_jacobian(zero);
            let (rows, m) = (K.nrows(), cluster.dependent.len());
            let K_d = faer::Mat::from_fn(rows, m, |r, a| K[(r, cluster.dependent[a])]);
            let Ok(svd) = K_d.thin_svd() else { continue };
            let S = svd.S().column_vector();
            if let Some(last) = S.nrows().checked_sub(1) {
                found.sigma_min = found.sigma_min.min(S[last]);
                let cond = if S[last] > f64::EPSILON * S[0] { S[0] / S[last] } else { f64::INFINITY };
                found.cond_Kd = found.cond_Kd.max(cond);
            }
            if self.order.branches.contains(&c) {
                let singular = !found.cond_Kd.is_finite() || rows != m;
                let mut A: Vec<f64> = (0..rows * m).map(|i| K_d[(i / m, i % m)]).collect();
                found.branch.push(if singular { 0.0 } else { solve_pivoted(&mut A, &mut [], m, 0).map_or(0.0, f64::signum) });
            }
        }
        found
    }
}
