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
//! small error of theirs moves it far, and a small force on it asks much of them. It does not
//! depend on which joints are the independent ones. `clearance` is the least ‖B‖ of the mechanism
//! for that of the pose: 1 at its best pose, 0 at a singular one.

use super::cholesky::Cholesky;
use super::evaluator::Pose;

/// The coordinates of one closed mechanism.
#[derive(Debug)]
pub(super) struct Linkage {
    /// Places of its actuators in u.
    pub(super) actuators: Vec<usize>,
    /// Its independents: places in ẏ and in y.
    pub(super) independents: Vec<(usize, usize)>,
    /// Places in q̇ of its joints that are no actuators.
    pub(super) joints: Vec<usize>,
    /// For each actuator one by the deviation that counts as none `[1/m, 1/rad]`.
    pub(super) weights: Vec<f64>,
    /// Limits of the independents `[m, rad]`.
    pub(super) limits: Vec<[f64; 2]>,
    /// Nothing is closed: the one actuator is the one independent.
    pub(super) is_serial: bool,
    /// The least ‖B‖; 0 where nothing but actuators moves.
    pub(super) least: f64,
    /// N as its Cholesky factor, at the pose that was last taken.
    factor: Cholesky,
    side: Vec<f64>,
}

impl Linkage {
    /// Allocates; nothing after it does.
    pub(super) fn new(
        actuators: Vec<usize>,
        independents: Vec<(usize, usize)>,
        joints: Vec<usize>,
        weights: Vec<f64>,
        limits: Vec<[f64; 2]>,
    ) -> Linkage {
        let m = independents.len();
        Linkage {
            is_serial: joints.is_empty() && actuators.len() == 1 && m == 1,
            actuators,
            independents,
            joints,
            weights,
            limits,
            least: 0.0,
            factor: Cholesky::new(m),
            side: vec![0.0; m],
        }
    }

    /// The actuators determine the pose.
    pub(super) fn is_determined(&self) -> bool {
        !self.independents.is_empty() && self.actuators.len() >= self.independents.len()
    }

    /// Takes N at a pose; false where the actuators have lost control.
    pub(super) fn factorise(&mut self, rows: &Rows, pose: &Pose) -> bool {
        if self.is_serial {
            return true;
        }
        let m = self.independents.len();
        for i in 0..m {
            for j in 0..=i {
                self.factor.matrix[i * m + j] =
                    self.actuators.iter().zip(&self.weights).fold(0.0, |sum, (&u, w)| {
                        sum + w
                            * w
                            * self.actuation(rows, pose, u, i)
                            * self.actuation(rows, pose, u, j)
                    });
            }
        }
        self.factor.factorise()
    }

    /// δy for the changes that `change` gives of an actuator's number within and place in u.
    pub(super) fn independents_of(
        &self,
        rows: &Rows,
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
            for (k, (&u, w)) in self.actuators.iter().zip(&self.weights).enumerate() {
                *out += self.actuation(rows, pose, u, i) * w * w * change(k, u);
            }
        }
        self.factor.solve(out);
    }

    /// Forces of the actuators for those that the pose asks for, at their places in u.
    pub(super) fn efforts(&mut self, rows: &Rows, pose: &Pose, into: &mut [f64]) {
        self.efforts_beside(rows, pose, |_| 0.0, |u, effort| into[u] = effort);
    }

    /// Forces of the actuators beside those that they give already: `each` gets an actuator's place
    /// in u and its force.
    pub(super) fn efforts_beside(
        &mut self,
        rows: &Rows,
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
            let (v, _) = self.independents[i];
            *side = self
                .actuators
                .iter()
                .fold(tau_y[v], |sum, &u| sum - self.actuation(rows, pose, u, i) * given(u));
        }
        self.factor.solve(&mut side);
        for (&u, w) in self.actuators.iter().zip(&self.weights) {
            let effort = side
                .iter()
                .enumerate()
                .fold(0.0, |sum, (i, x)| sum + w * w * self.actuation(rows, pose, u, i) * x);
            each(u, effort);
        }
        self.side = side;
    }

    /// ‖B‖ at the pose whose N was taken last.
    pub(super) fn reach_of_joints(&mut self, rows: &Rows, pose: &Pose) -> f64 {
        let mut side = std::mem::take(&mut self.side);
        let mut sum = 0.0;
        for &v in &self.joints {
            for (i, side) in side.iter_mut().enumerate() {
                *side = rows.at(pose, v, self.independents[i].0);
            }
            self.factor.solve(&mut side);
            for (&u, w) in self.actuators.iter().zip(&self.weights) {
                let entry = side
                    .iter()
                    .enumerate()
                    .fold(0.0, |sum, (i, x)| sum + w * w * self.actuation(rows, pose, u, i) * x);
                sum += entry * entry;
            }
        }
        self.side = side;
        sum.sqrt()
    }

    /// How far the pose whose N was taken last is from a singular one: from 1 to 0.
    pub(super) fn clearance(&mut self, rows: &Rows, pose: &Pose) -> f64 {
        if self.least == 0.0 { 1.0 } else { self.least / self.reach_of_joints(rows, pose) }
    }

    /// Entry of G_u: the row of an actuator, the column of an independent of this mechanism.
    fn actuation(&self, rows: &Rows, pose: &Pose, actuator: usize, independent: usize) -> f64 {
        rows.at(pose, rows.actuator_rows[actuator], self.independents[independent].0)
    }
}

/// Where the rows of the loop Jacobian are.
#[derive(Debug)]
pub(super) struct Rows {
    /// The tree velocity of each actuator (n_u).
    pub(super) actuator_rows: Vec<usize>,
    pub(super) n_vy: usize,
}

impl Rows {
    /// An entry of the loop Jacobian.
    pub(super) fn at(&self, pose: &Pose, row: usize, column: usize) -> f64 {
        pose.loop_jacobian[row * self.n_vy + column]
    }
}
