//! The implicit method of Radau (IIA) of order five for stiff problems: three stages, simplified
//! Newton's method with the Jacobian by differences, error estimate of order three, predictive
//! step (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8).
//!
//! With Z the stages' distance from x, A⁻¹ = T Λ T⁻¹ and W = (T⁻¹ ⊗ I) Z the steps of Newton's
//! method fall apart into a real and a complex system (8.7):
//!
//! ```text
//!   (h⁻¹ Λ ⊗ I − I ⊗ J) ΔW = −h⁻¹ (Λ ⊗ I) W + (T⁻¹ ⊗ I) F((T ⊗ I) W),   Λ = diag(γ, [α −β; β α])
//! ```

mod coefficients;

use nalgebra::{Complex, DMatrix, DVector, Dyn, LU};
use sarrus_dynamics::Status;

use self::coefficients::{ALPHA, BETA, C, E, GAMMA, T, T_INVERSE};
use crate::methods::{Attempt, FREE, Stepper};
use crate::motion::engine::Engine;

/// Steps of Newton's method that one step may take.
const NEWTON: u32 = 7;
/// Rate of convergence up to which the Jacobian is kept.
const KEEP: f64 = 1e-3;
const SAFETY: f64 = 0.9;
/// Largest and least ratio of a step to the one before.
const GROWTH: f64 = 8.0;
const SHRINKAGE: f64 = 0.2;
/// A step that would grow by less is left as it is, and its factors with it.
const SAME: f64 = 1.2;
/// Number of consecutive rejected steps without an answer after which the integration fails.
const MOST_FAILURES: u32 = 40;

/// The method between steps.
#[derive(Default)]
pub(crate) struct Radau {
    /// Tolerances as the estimate of order three wants them for an error of order five.
    rtol: f64,
    atol: f64,
    newton: f64,
    /// The next step; none before the first.
    step: Option<f64>,
    jacobian: Vec<f64>,
    /// The Jacobian is that of the present state.
    fresh: bool,
    /// The Jacobian is good enough still.
    good: bool,
    factors: Option<Factors>,
    z: [Vec<f64>; 3],
    w: [Vec<f64>; 3],
    f: [Vec<f64>; 3],
    at: Vec<f64>,
    /// The last accepted step, whose stages are in `z`, and its error.
    last: Option<(f64, f64)>,
    /// The last attempt was taken back.
    rejected: bool,
    failures: u32,
}

struct Factors {
    step: f64,
    real: LU<f64, Dyn, Dyn>,
    complex: LU<Complex<f64>, Dyn, Dyn>,
}

/// Result of Newton's method.
enum Newton {
    /// Steps taken and rate of convergence.
    Converged(u32, f64),
    /// It will not, at this step; by how much the step should shrink.
    Slow(f64),
    NoAnswer(Status),
}

impl Radau {
    pub(crate) fn new(rtol: f64, atol: f64, first: Option<f64>) -> Radau {
        let tolerance = 0.1 * rtol.powf(2.0 / 3.0);
        let newton = (10.0 * f64::EPSILON / tolerance).max(tolerance.sqrt().min(0.03));
        Radau {
            rtol: tolerance,
            atol: atol * tolerance / rtol,
            newton,
            step: first,
            ..Radau::default()
        }
    }

    /// A first step that moves x by about a hundredth of its size.
    fn first_step(&self, engine: &Engine, x: &[f64], scale: &[f64], room: f64) -> f64 {
        let size = norm(x, scale);
        let speed = norm(&engine.anchor.rate, scale);
        let step = if size < 1e-5 || speed < 1e-5 { 1e-6 } else { 0.01 * size / speed };
        step.min(room)
    }

    /// γ/h I − J and (α + iβ)/h I − J.
    fn factor(&mut self, engine: &mut Engine, step: f64, n: usize) {
        if self.factors.as_ref().is_some_and(|factors| factors.step == step) {
            return;
        }
        engine.counts.factorisations += 1;
        let J = DMatrix::from_row_slice(n, n, &self.jacobian);
        let shift = Complex::new(ALPHA / step, BETA / step);
        let complex = DMatrix::from_diagonal_element(n, n, shift) - J.map(Complex::from);
        let real = DMatrix::from_diagonal_element(n, n, GAMMA / step) - J;
        self.factors = Some(Factors { step, real: real.lu(), complex: complex.lu() });
    }

    /// Stages to begin with: the polynomial through those of the last step, carried on.
    fn predict(&mut self, n: usize, step: f64) {
        let Some((last, _)) = self.last else {
            self.z.iter_mut().chain(&mut self.w).for_each(|z| z.fill(0.0));
            return;
        };
        let nodes = [0.0, C[0], C[1], C[2]];
        // weights of the three stages at each new one
        let weights = C.map(|c| {
            let s = 1.0 + c * step / last;
            [1, 2, 3].map(|k| {
                (0..4)
                    .filter(|j| *j != k)
                    .map(|j| (s - nodes[j]) / (nodes[k] - nodes[j]))
                    .product::<f64>()
            })
        });
        for i in 0..n {
            let old = [self.z[0][i], self.z[1][i], self.z[2][i]];
            for (z, weights) in self.z.iter_mut().zip(&weights) {
                z[i] = (0..3).map(|k| weights[k] * old[k]).sum::<f64>() - old[2];
            }
            for (w, row) in self.w.iter_mut().zip(&T_INVERSE) {
                w[i] = (0..3).map(|k| row[k] * self.z[k][i]).sum();
            }
        }
    }

    /// Newton's method on the stages.
    fn iterate(
        &mut self,
        engine: &mut Engine,
        t: f64,
        x: &[f64],
        step: f64,
        scale: &[f64],
    ) -> Newton {
        let n = x.len();
        let mut last = 0.0;
        let mut ratio = 1.0;
        let mut theta = 0.0;
        let mut factor = 1.0;
        for k in 1..=NEWTON {
            for s in 0..3 {
                (0..n).for_each(|i| self.at[i] = x[i] + self.z[s][i]);
                if let Err(status) = engine.rate(t + C[s] * step, &self.at, &mut self.f[s]) {
                    return Newton::NoAnswer(status);
                }
            }
            let mixed =
                |s: usize, i: usize| (0..3).map(|k| T_INVERSE[s][k] * self.f[k][i]).sum::<f64>();
            let [u, v, w] = &self.w;
            let mut one = DVector::from_fn(n, |i, _| mixed(0, i) - GAMMA / step * u[i]);
            let mut two = DVector::from_fn(n, |i, _| {
                let pair = Complex::new(ALPHA / step, BETA / step) * Complex::new(v[i], w[i]);
                Complex::new(mixed(1, i), mixed(2, i)) - pair
            });
            let Some(factors) = &self.factors else { return Newton::Slow(0.5) };
            if !factors.real.solve_mut(&mut one) || !factors.complex.solve_mut(&mut two) {
                return Newton::Slow(0.5);
            }
            let square = (0..n)
                .map(|i| (one[i] * one[i] + two[i].norm_sqr()) / (scale[i] * scale[i]))
                .sum::<f64>();
            let size = (square / (3 * n) as f64).sqrt();
            // how fast it converges, and whether that will do
            if k > 1 {
                let quotient = size / last;
                theta = if k == 2 { quotient } else { (quotient * ratio).sqrt() };
                ratio = quotient;
                // NaN does not converge
                if theta.is_nan() || theta >= 0.99 {
                    return Newton::Slow(0.5);
                }
                factor = theta / (1.0 - theta);
                let left = f64::from(NEWTON - k);
                let expected = factor * size * theta.powf(left) / self.newton;
                if expected >= 1.0 {
                    return Newton::Slow(
                        0.8 * expected.clamp(1e-4, 20.0).powf(-1.0 / (4.0 + left)),
                    );
                }
            }
            if !size.is_finite() {
                return Newton::Slow(0.5);
            }
            last = size.max(f64::EPSILON);
            for i in 0..n {
                self.w[0][i] += one[i];
                self.w[1][i] += two[i].re;
                self.w[2][i] += two[i].im;
                for (z, row) in self.z.iter_mut().zip(&T) {
                    z[i] = (0..3).map(|k| row[k] * self.w[k][i]).sum();
                }
            }
            if factor * size <= self.newton {
                return Newton::Converged(k, theta);
            }
        }
        Newton::Slow(0.5)
    }

    /// The scaled error of the stages (8.19), filtered again where it is large for no good reason
    /// (8.20).
    fn error(
        &mut self,
        engine: &mut Engine,
        t: f64,
        x: &[f64],
        step: f64,
        scale: &[f64],
    ) -> Option<f64> {
        let n = x.len();
        let defect =
            DVector::from_fn(n, |i, _| (0..3).map(|k| E[k] / step * self.z[k][i]).sum::<f64>());
        let real = &self.factors.as_ref()?.real;
        let mut error = DVector::from_fn(n, |i, _| engine.anchor.rate[i] + defect[i]);
        real.solve_mut(&mut error).then_some(())?;
        let mut size = norm(error.as_slice(), scale);
        if size >= 1.0 && (self.last.is_none() || self.rejected) {
            (0..n).for_each(|i| self.at[i] = x[i] + error[i]);
            if engine.rate(t, &self.at, &mut self.f[0]).is_ok() {
                let mut again = DVector::from_fn(n, |i, _| self.f[0][i] + defect[i]);
                real.solve_mut(&mut again).then_some(())?;
                size = norm(again.as_slice(), scale);
            }
        }
        size.is_finite().then(|| size.max(1e-10))
    }

    /// The attempt failed: shrinks the step and discards the history.
    fn give_way(&mut self, step: f64, share: f64) -> Attempt {
        self.step = Some(step * share);
        self.rejected = true;
        // stages of a step that was not taken predict nothing
        self.last = None;
        self.good = self.fresh;
        Attempt::Rejected
    }

    /// The attempt failed because the right-hand side had no answer.
    fn no_answer(&mut self, engine: &mut Engine, step: f64, status: Status) -> Attempt {
        engine.counts.failed += 1;
        self.failures += 1;
        if self.failures > MOST_FAILURES {
            self.failures = 0;
            return Attempt::Failed(status);
        }
        self.give_way(step, 0.382)
    }
}

impl Stepper for Radau {
    fn attempt(&mut self, engine: &mut Engine, t: &mut f64, x: &mut [f64], limit: f64) -> Attempt {
        let n = x.len();
        let controlled = engine.mechanism.controlled();
        let scale: Vec<f64> = (0..n)
            .map(|i| if i < controlled { self.atol + self.rtol * x[i].abs() } else { FREE })
            .collect();
        self.z
            .iter_mut()
            .chain(&mut self.w)
            .chain(&mut self.f)
            .chain([&mut self.at])
            .for_each(|of| of.resize(n, 0.0));
        let room = limit - *t;
        let own = self.step.unwrap_or_else(|| self.first_step(engine, x, &scale, room));
        // no crumb is left before the limit
        let step = match own / room {
            share if share >= 0.999_999 => room,
            share if share > 0.5 => 0.5 * room,
            _ => own,
        };
        if *t + step <= *t {
            return Attempt::TooShort;
        }
        if !self.good {
            self.jacobian.resize(n * n, 0.0);
            self.factors = None;
            if let Err(status) = engine.jacobian(*t, x, &mut self.jacobian) {
                return Attempt::Failed(status);
            }
            (self.fresh, self.good) = (true, true);
        }
        self.factor(engine, step, n);
        self.predict(n, step);
        let (taken, theta) = match self.iterate(engine, *t, x, step, &scale) {
            Newton::Converged(taken, theta) => (taken, theta),
            Newton::Slow(share) => {
                engine.counts.rejected += 1;
                return self.give_way(step, share);
            }
            Newton::NoAnswer(status) => return self.no_answer(engine, step, status),
        };
        let Some(error) = self.error(engine, *t, x, step, &scale) else {
            engine.counts.rejected += 1;
            return self.give_way(step, 0.5);
        };
        // the next step: from this error alone, and from how it changed
        let safety = SAFETY * f64::from(2 * NEWTON + 1) / f64::from(2 * NEWTON + taken);
        let mut growth = safety.min(SAFETY) * error.powf(-0.25);
        if error >= 1.0 {
            engine.counts.rejected += 1;
            let share = if self.last.is_none() { 0.1 } else { growth.clamp(SHRINKAGE, 1.0) };
            return self.give_way(step, share);
        }
        let to = if step == room { limit } else { *t + step };
        let mut next: Vec<f64> = (0..n).map(|i| x[i] + self.z[2][i]).collect();
        if let Err(status) = engine.settle(to, &mut next) {
            return self.no_answer(engine, step, status);
        }
        if let Some((before, old)) = self.last {
            growth = growth.min(SAFETY * step / before * (old / (error * error)).powf(0.25));
        }
        growth = growth.clamp(SHRINKAGE, if self.rejected { 1.0 } else { GROWTH });
        (*t, self.failures, self.rejected) = (to, 0, false);
        x.copy_from_slice(&next);
        engine.counts.steps += 1;
        self.last = Some((step, error.max(1e-2)));
        (self.fresh, self.good) = (false, theta < KEEP);
        // a step that the limit cut short is no evidence against the longer one
        let next = if step < own { own.max(step * growth) } else { step * growth };
        self.step =
            Some(if self.good && next >= step && next <= SAME * step { step } else { next });
        Attempt::Done
    }

    fn restart(&mut self) {
        (self.fresh, self.good, self.last, self.factors) = (false, false, None, None);
    }
}

/// Root of the mean square of x / scale.
fn norm(x: &[f64], scale: &[f64]) -> f64 {
    let square: f64 = x.iter().zip(scale).map(|(x, scale)| x / scale * (x / scale)).sum();
    (square / x.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A of the collocation at C: a polynomial of degree two is integrated exactly.
    fn collocation() -> nalgebra::Matrix3<f64> {
        let powers = nalgebra::Matrix3::from_fn(|i, k| C[i].powi(k as i32));
        let integrals = nalgebra::Matrix3::from_fn(|i, k| C[i].powi(k as i32 + 1) / (k + 1) as f64);
        integrals * powers.try_inverse().unwrap()
    }

    #[test]
    fn the_constants_are_those_of_the_method() {
        let [t, inverse] = [T, T_INVERSE].map(|rows| nalgebra::Matrix3::from_fn(|i, j| rows[i][j]));
        assert!((t * inverse - nalgebra::Matrix3::identity()).abs().max() < 1e-14);
        // T⁻¹ A⁻¹ T = diag(γ, [α −β; β α])
        let found = inverse * collocation().try_inverse().unwrap() * t;
        let expected = nalgebra::Matrix3::new(GAMMA, 0.0, 0.0, 0.0, ALPHA, -BETA, 0.0, BETA, ALPHA);
        assert!((found - expected).abs().max() < 1e-13, "{found}");
        // the last stage is the end of the step
        assert!((C[2] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_error_estimate_has_order_three() {
        // γ₀ h f(x) + Σ eᵢ γ₀ zᵢ vanishes for polynomials up to degree three, with zᵢ = cᵢᵏ for x =
        // tᵏ
        for k in 1..=3 {
            let slope = if k == 1 { 1.0 } else { 0.0 };
            let sum: f64 = slope + (0..3).map(|i| E[i] * C[i].powi(k)).sum::<f64>();
            assert!(sum.abs() < 1e-14, "degree {k}: {sum}");
        }
        assert!((0..3).map(|i| E[i] * C[i].powi(4)).sum::<f64>().abs() > 1e-3);
    }
}
