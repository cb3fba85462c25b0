//! Closes the rows by Levenberg-Marquardt steps, which need no rank.

use sarrus_factorisations::{Mat, thin_svd};

use crate::initial_pose::problem::{Candidate, Problem};
use crate::scalar::noise;

/// Most steps from one start, and further starts around the given pose if it fails.
const STEPS: u32 = 300;
const STARTS: usize = 12;
/// Least damping, relative to the largest singular value: where rows are consistent, and where they
/// may contradict each other.
const DAMPING_OF_USED: f64 = 1e-9;
const DAMPING_OF_ALL: f64 = 1e-3;
/// Damping at which the search ends.
const STUCK: f64 = 1e8;
/// Largest step, in radians or lengths of the cluster.
pub(super) const CLAMP: f64 = 0.5;

impl Problem<'_> {
    /// Closes the rows from a candidate, or from poses around it; if none closes, keeps the one of
    /// least residual. Returns true if it is closed.
    pub(super) fn close_somewhere(&self, candidate: &mut Candidate, count: &mut u32) -> bool {
        let start = candidate.q.clone();
        let mut best: Option<(f64, Candidate)> = None;
        for k in 0..=STARTS {
            // the given pose first, then increasingly distant ones
            let reach = 1.5 * k as f64 / STARTS as f64;
            let mut trial = Candidate::new(self, self.moved(&start, |a| reach * noise(97 * k + a)));
            if self.close(&mut trial, count) {
                let cost = self.cost(&trial.q).0;
                if k == 0 {
                    *candidate = trial;
                    return true;
                }
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, trial));
                }
            } else if trial.square() < candidate.square() && best.is_none() {
                *candidate = trial;
            }
        }
        match best {
            Some((_, closed)) => {
                *candidate = closed;
                true
            }
            None => false,
        }
    }

    /// Closes the rows downhill from a candidate; returns true if they are closed.
    pub(super) fn close(&self, candidate: &mut Candidate, count: &mut u32) -> bool {
        let floor = if self.all { DAMPING_OF_ALL } else { DAMPING_OF_USED };
        let mut damping = 1e-2;
        let n = self.free.len();
        let mut last = f64::INFINITY;
        'steps: for _ in 0..STEPS {
            if n == 0
                || candidate.largest() <= 2.0 * f64::EPSILON
                || !candidate.square().is_finite()
            {
                break;
            }
            // J in the metric of the weights, so that a heavy joint moves little
            let J = self.scaled_jacobian(&candidate.q);
            let root: Vec<f64> = self.metric.iter().map(|w| w.sqrt()).collect();
            let weighted = Mat::from_fn(J.nrows(), n, |r, a| J[(r, a)] / root[a]);
            let Some(svd) = thin_svd(&weighted) else { break };
            let U = svd.U();
            let S = svd.S().column_vector();
            let V = svd.V();
            if S[0] <= 0.0 || S[0].is_nan() {
                break;
            }
            let along: Vec<f64> = (0..S.nrows())
                .map(|i| (0..J.nrows()).map(|r| U[(r, i)] * candidate.phi[r]).sum())
                .collect();
            loop {
                *count += 1;
                let mu = damping * S[0];
                let mut x: Vec<f64> = (0..n)
                    .map(|a| {
                        -(0..S.nrows())
                            .map(|i| V[(a, i)] * along[i] * S[i] / (S[i] * S[i] + mu * mu))
                            .sum::<f64>()
                            / root[a]
                    })
                    .collect();
                let largest = x.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
                if largest > CLAMP {
                    x.iter_mut().for_each(|x| *x *= CLAMP / largest);
                }
                let next = Candidate::new(self, self.moved(&candidate.q, |a| x[a]));
                if next.square() < candidate.square() {
                    *candidate = next;
                    damping = f64::max(floor, damping * if largest > CLAMP { 0.5 } else { 0.1 });
                    // rounding alone is left
                    if largest < 4.0 * f64::EPSILON || self.all && largest < 1e-13 && last < 1e-13 {
                        break 'steps;
                    }
                    last = largest;
                    break;
                }
                damping = f64::max(4.0 * damping, 1e-12);
                if damping > STUCK || largest < f64::EPSILON {
                    break 'steps;
                }
            }
        }
        candidate.largest() <= self.closed
    }
}
