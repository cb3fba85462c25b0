//! The classical method of Runge and Kutta: order 4.
//!
//! ```text
//!   k₁ = f(t, x),   k₂ = f(t + h/2, x + h k₁/2)
//!   k₃ = f(t + h/2, x + h k₂/2),   k₄ = f(t + h, x + h k₃)
//!   x₊ = x + h/6 (k₁ + 2 (k₂ + k₃) + k₄)
//! ```

use sarrus_dynamics::Status;

use super::fixed_step::OneStep;
use crate::motion::engine::Engine;

/// The method with its scratch.
#[derive(Default)]
pub(crate) struct RungeKutta {
    stages: [Vec<f64>; 4],
    at: Vec<f64>,
    next: Vec<f64>,
}

impl OneStep for RungeKutta {
    /// Four stages; the first is known.
    fn step(&mut self, engine: &mut Engine, t: f64, x: &mut [f64], to: f64) -> Status {
        let n = x.len();
        let h = to - t;
        self.stages.iter_mut().for_each(|stage| stage.resize(n, 0.0));
        self.at.resize(n, 0.0);
        self.stages[0].copy_from_slice(&engine.anchor.rate);
        for (k, part) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
            for i in 0..n {
                self.at[i] = x[i] + part * h * self.stages[k - 1][i];
            }
            let status = engine.rate(t + part * h, &self.at, &mut self.stages[k]);
            if status != Status::Ok {
                return status;
            }
        }
        let [a, b, c, d] = &self.stages;
        self.next.clear();
        self.next.extend((0..n).map(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i])));
        engine.accept(to, &mut self.next, x)
    }
}
