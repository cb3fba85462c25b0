//! One closed mechanism of the model: which coordinates it has, and its actuation at a pose.
//!
//! With G_u (actuators × independents) and G_r (the other joints × independents) and the weights
//! W = diag(w²) of the actuators:
//!
//! ```text
//! N = G_uᵀ W G_u
//! δy = N⁻¹ G_uᵀ W δu                change of the independents for one of the actuators
//! τ_u = W G_u N⁻¹ τ_y               forces of the actuators, of least weighted norm
//! B = G_r N⁻¹ G_uᵀ W                change of the joints for one of the actuators
//! ```
//!
//! ‖B‖ grows without bound towards a pose where the actuators lose control of the mechanism: a
//! small actuator error moves it far, and a small force on it requires large actuator efforts. ‖B‖
//! does not depend on the choice of independents. `clearance` is the least ‖B‖ of the mechanism
//! over the ‖B‖ of the pose: 1 at the best pose, 0 at a singular one.

use super::evaluator::Pose;
use crate::cholesky::Cholesky;

/// The coordinates of one closed mechanism.
#[derive(Debug)]
pub(super) struct Linkage {
    /// Indices of its actuators in u.
    pub(super) actuators: Vec<usize>,
    /// Their rows of the loop Jacobian.
    pub(super) rows: Vec<usize>,
    /// Its independents: places in ẏ and in y.
    pub(super) independents: Vec<(usize, usize)>,
    /// Indices in q̇ of its joints without actuator.
    pub(super) joints: Vec<usize>,
    /// For each actuator the inverse of its negligible deviation `[1/m, 1/rad]`.
    pub(super) weights: Vec<f64>,
    /// Limits of the independents `[m, rad]`.
    pub(super) limits: Vec<[f64; 2]>,
    /// No loop: the single actuator is the single independent.
    pub(super) is_serial: bool,
    /// The least ‖B‖; 0 if only actuators move.
    pub(super) least: f64,
    /// The Cholesky factor of N at the last pose.
    pub(super) factor: Cholesky,
    /// Room for a vector of the independents.
    pub(super) side: Vec<f64>,
}

impl Linkage {
    /// The actuators determine the pose.
    pub(super) fn is_determined(&self) -> bool {
        !self.independents.is_empty() && self.actuators.len() >= self.independents.len()
    }

    /// Takes N at a pose; false where the actuators have lost control.
    pub(super) fn factorise(&mut self, pose: &Pose) -> bool {
        if self.is_serial {
            return true;
        }
        let m = self.independents.len();
        for i in 0..m {
            for j in 0..=i {
                self.factor.matrix[i * m + j] =
                    self.rows.iter().zip(&self.weights).fold(0.0, |sum, (&row, w)| {
                        sum + w * w * self.actuation(pose, row, i) * self.actuation(pose, row, j)
                    });
            }
        }
        self.factor.factorise()
    }

    /// δy for the changes that `change` gives of an actuator's number within and place in u.
    pub(super) fn independents_of(
        &self,
        pose: &Pose,
        change: impl Fn(usize, usize) -> f64,
        out: &mut [f64],
    ) {
        if self.is_serial {
            out[0] = change(0, self.actuators[0]);
            return;
        }
        for (i, out) in out.iter_mut().enumerate() {
            *out = 0.0;
            for (k, (&row, w)) in self.rows.iter().zip(&self.weights).enumerate() {
                *out += self.actuation(pose, row, i) * w * w * change(k, self.actuators[k]);
            }
        }
        self.factor.solve(out);
    }

    /// Forces of the actuators for those that the pose asks for, at their places in u.
    pub(super) fn efforts(&mut self, pose: &Pose, into: &mut [f64]) {
        self.efforts_beside(pose, |_| 0.0, |u, effort| into[u] = effort);
    }

    /// Forces of the actuators beside those that they give already: `each` gets an actuator's place
    /// in u and its force.
    pub(super) fn efforts_beside(
        &mut self,
        pose: &Pose,
        given: impl Fn(usize) -> f64,
        mut each: impl FnMut(usize, f64),
    ) {
        let tau_y = &pose.tau_y;
        if self.is_serial {
            let (u, (v, _)) = (self.actuators[0], self.independents[0]);
            return each(u, tau_y[v] - given(u));
        }
        let mut side = std::mem::take(&mut self.side);
        for (i, side) in side.iter_mut().enumerate() {
            let start = tau_y[self.independents[i].0];
            let actuators = self.rows.iter().zip(&self.actuators);
            *side = actuators
                .fold(start, |sum, (&row, &u)| sum - self.actuation(pose, row, i) * given(u));
        }
        self.factor.solve(&mut side);
        for (k, &u) in self.actuators.iter().enumerate() {
            each(u, self.weighted(pose, k, &side));
        }
        self.side = side;
    }

    /// ‖B‖ at the pose whose N was taken last.
    pub(super) fn reach_of_joints(&mut self, pose: &Pose) -> f64 {
        let mut side = std::mem::take(&mut self.side);
        let mut sum = 0.0;
        for &row in &self.joints {
            for (i, side) in side.iter_mut().enumerate() {
                *side = self.actuation(pose, row, i);
            }
            self.factor.solve(&mut side);
            for k in 0..self.actuators.len() {
                let entry = self.weighted(pose, k, &side);
                sum += entry * entry;
            }
        }
        self.side = side;
        sum.sqrt()
    }

    /// How far the pose whose N was taken last is from a singular one: from 1 to 0.
    pub(super) fn clearance(&mut self, pose: &Pose) -> f64 {
        if self.least == 0.0 { 1.0 } else { self.least / self.reach_of_joints(pose) }
    }

    /// Row k of W G_u times a vector of the independents.
    fn weighted(&self, pose: &Pose, k: usize, y: &[f64]) -> f64 {
        let row = self.rows[k];
        let w = self.weights[k];
        y.iter().enumerate().fold(0.0, |sum, (i, x)| sum + w * w * self.actuation(pose, row, i) * x)
    }

    /// Entry of the loop Jacobian: a row, and the column of an independent of this mechanism.
    fn actuation(&self, pose: &Pose, row: usize, independent: usize) -> f64 {
        pose.jacobian_entry(row, self.independents[independent].0)
    }
}
