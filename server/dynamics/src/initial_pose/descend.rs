//! Descends along the closed poses: Newton's method for the distance in the null space of the rows.
//!
//! ```text
//!   J Z = 0        Jᵀ λ = −∇f        H = ∇²f + Σ λ ∇²φ        (Zᵀ H Z) s = −Zᵀ ∇f
//! ```
//! Each step is closed again before it is judged, so that every pose on the path is closed and
//! nearer than the one before.

use sarrus_factorisations::{Mat, svd, symmetric_eigen};

use crate::initial_pose::close::CLAMP;
use crate::initial_pose::problem::{Candidate, Problem};

/// Steps, and halvings of one step.
const STEPS: u32 = 100;
const HALVINGS: u32 = 40;
/// Slope due to rounding, and slope up to which a pose is a minimum.
const ROUNDING: f64 = 2e-15;
pub(super) const FLAT: f64 = 1e-8;
/// Step of the finite differences for H.
const DIFFERENCE: f64 = 1e-5;
/// Least curvature of a step.
const CURVED: f64 = 1e-6;

/// Slope of the distance along the closed poses, at one of them.
struct Slope {
    /// Directions in which the pose can move (free × m), and the slope along each.
    Z: Mat<f64>,
    along: Vec<f64>,
    lambda: Vec<f64>,
    cost: f64,
}

impl Slope {
    fn size(&self) -> f64 {
        self.along.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

impl Problem<'_> {
    /// Goes down from a closed candidate to a minimum of the distance; returns the slope that is
    /// left.
    pub(super) fn descend(&self, candidate: &mut Candidate, count: &mut u32) -> f64 {
        let Some(mut here) = self.slope(&candidate.q) else { return f64::INFINITY };
        for _ in 0..STEPS {
            if here.size() <= ROUNDING {
                break;
            }
            let Some(step) = self.newton_step(candidate, &here) else { break };
            let promised: f64 = here.along.iter().zip(&step).map(|(g, s)| g * s).sum();
            // where the promise drowns in rounding only the slope can judge
            let last = promised.abs() <= 1e-9 * here.cost;
            let mut share = 1.0;
            let mut better = None;
            for _ in 0..HALVINGS {
                *count += 1;
                let x = |a: usize| {
                    share * (0..step.len()).map(|k| here.Z[(a, k)] * step[k]).sum::<f64>()
                };
                let mut next = Candidate::new(self, self.moved(&candidate.q, x));
                if self.close(&mut next, count) {
                    let cost = self.cost(&next.q).0;
                    let falls = cost <= here.cost + 1e-4 * share * promised;
                    if let Some(there) = self
                        .slope(&next.q)
                        .filter(|there| if last { there.size() < here.size() } else { falls })
                    {
                        better = Some((next, there));
                        break;
                    }
                }
                if last {
                    break;
                }
                share *= 0.5;
            }
            let Some((next, there)) = better else { break };
            (*candidate, here) = (next, there);
        }
        here.size()
    }

    /// Null space, multipliers and slope at a closed pose.
    fn slope(&self, q: &[f64]) -> Option<Slope> {
        let n = self.free.len();
        let (cost, pull) = self.cost(q);
        let J = self.scaled_jacobian(q);
        if n == 0 || J.nrows() == 0 {
            let Z = Mat::from_fn(n, n, |i, j| if i == j { 1.0 } else { 0.0 });
            return Some(Slope { Z, along: pull, lambda: vec![0.0; J.nrows()], cost });
        }
        let svd = svd(&J)?;
        let U = svd.U();
        let S = svd.S().column_vector();
        let V = svd.V();
        let rank = (0..S.nrows()).filter(|i| S[*i] > self.gap * S[0]).count();
        let Z = Mat::from_fn(n, n - rank, |a, k| V[(a, rank + k)]);
        let in_basis = |k: usize| (0..n).map(|a| V[(a, k)] * pull[a]).sum::<f64>();
        let along = (rank..n).map(in_basis).collect();
        let ratio: Vec<f64> = (0..rank).map(|k| -in_basis(k) / S[k]).collect();
        let lambda =
            (0..J.nrows()).map(|r| (0..rank).map(|k| U[(r, k)] * ratio[k]).sum()).collect();
        Some(Slope { Z, along, lambda, cost })
    }

    /// ∇f + Kᵀ λ along each velocity that may move.
    fn gradient(&self, q: &[f64], lambda: &[f64]) -> Vec<f64> {
        let J = self.scaled_jacobian(q);
        let pull = self.cost(q).1;
        pull.iter()
            .enumerate()
            .map(|(a, g)| g + (0..J.nrows()).map(|r| J[(r, a)] * lambda[r]).sum::<f64>())
            .collect()
    }

    /// A step that goes down: Newton's where H is positive, as long as it reaches.
    fn newton_step(&self, candidate: &Candidate, here: &Slope) -> Option<Vec<f64>> {
        let n = self.free.len();
        let m = here.along.len();
        let mut H = Mat::<f64>::zeros(m, m);
        for k in 0..m {
            let ends = [DIFFERENCE, -DIFFERENCE].map(|h| {
                self.gradient(&self.moved(&candidate.q, |a| h * here.Z[(a, k)]), &here.lambda)
            });
            for i in 0..m {
                H[(i, k)] = (0..n).map(|a| here.Z[(a, i)] * (ends[0][a] - ends[1][a])).sum::<f64>()
                    / (2.0 * DIFFERENCE);
            }
        }
        let H = Mat::from_fn(m, m, |i, k| 0.5 * (H[(i, k)] + H[(k, i)]));
        let eigen = symmetric_eigen(&H)?;
        let U = eigen.U();
        let S = eigen.S().column_vector();
        let largest = (0..m).fold(CURVED, |largest: f64, i| largest.max(S[i].abs()));
        let mut step = vec![0.0; m];
        for i in 0..m {
            let along: f64 = (0..m).map(|k| U[(k, i)] * here.along[k]).sum();
            let curvature = f64::max(S[i].abs(), CURVED * largest);
            (0..m).for_each(|k| step[k] -= U[(k, i)] * along / curvature);
        }
        let longest = step.iter().fold(0.0, |longest: f64, x| longest.max(x.abs()));
        if longest > CLAMP {
            step.iter_mut().for_each(|x| *x *= CLAMP / longest);
        }
        longest.is_finite().then_some(step)
    }
}
