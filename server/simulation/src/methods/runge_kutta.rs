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

/// The method.
#[derive(Default)]
pub(crate) struct RungeKutta;

impl OneStep for RungeKutta {
    fn step(&mut self, engine: &mut Engine, t: f64, x: &mut [f64], to: f64) -> Result<(), Status> {
        let h = to - t;
        let first = engine.anchor.rate.clone();
        let mut next = four_stages(x, h, first, |at, x, rate| engine.rate(t + at, x, rate))?;
        engine.accept(to, &mut next, x)
    }
}

/// The state after a time h from x and k₁; `rate` evaluates f at a time after t.
pub(crate) fn four_stages(
    x: &[f64],
    h: f64,
    first: Vec<f64>,
    mut rate: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), Status>,
) -> Result<Vec<f64>, Status> {
    let n = x.len();
    let mut stages = [first, vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    for (k, part) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
        let at: Vec<f64> = (0..n).map(|i| x[i] + part * h * stages[k - 1][i]).collect();
        rate(part * h, &at, &mut stages[k])?;
    }
    let [a, b, c, d] = &stages;
    Ok((0..n).map(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i])).collect())
}
