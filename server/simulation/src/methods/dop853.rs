//! The explicit method of Dormand and Prince of order eight with its own step, of the crate
//! `differential-equations`.

use std::cell::RefCell;

use differential_equations::error::Error;
use differential_equations::interpolate::Interpolation;
use differential_equations::methods::{DormandPrince, ExplicitRungeKutta, Ordinary};
use differential_equations::ode::{ODE, OrdinaryNumericalMethod};
use sarrus_dynamics::Status;

use crate::methods::{Attempt, FREE, Stepper};
use crate::motion::engine::Engine;

type Method = ExplicitRungeKutta<Ordinary, DormandPrince, f64, Vec<f64>, 8, 12, 16>;

/// Number of consecutive rejected steps without an answer after which the integration fails; each
/// reduces the step to a fifth or less.
const MOST_FAILURES: u32 = 24;

/// Accepted steps between two looks at how stiff the problem is.
const LOOK: u64 = 100;
/// Step times the largest eigenvalue from which on stability bounds the step and not the error; its
/// bound is near 6.
const STABILITY: f64 = 4.5;
/// Looks in a row that have to find it so.
const SURE: u32 = 5;
/// Multiplications by the Jacobian that estimate the eigenvalue.
const POWER: u32 = 20;

/// The method between steps.
#[derive(Default)]
pub(crate) struct Dop853 {
    rtol: f64,
    atol: f64,
    /// Where the simulation ends, and the step to begin with.
    end: f64,
    first: f64,
    method: Option<Box<Method>>,
    failures: u32,
    /// An evaluation behind the last step failed, and the next step makes it again.
    stale: bool,
    /// Looks in a row that found it stiff, and whether they were enough once.
    found: u32,
    stiff: bool,
}

/// The right-hand side as the crate wants it: NaN where it has no answer, which it rejects.
struct Bridge<'a>(RefCell<&'a mut Engine>);

impl ODE<f64, Vec<f64>> for Bridge<'_> {
    fn diff(&self, t: f64, x: &Vec<f64>, rate: &mut Vec<f64>) {
        let _ = self.0.borrow_mut().rate(t, x, rate);
    }
}

impl Dop853 {
    pub(crate) fn new(rtol: f64, atol: f64, end: f64, first: Option<f64>) -> Dop853 {
        Dop853 { rtol, atol, end, first: first.unwrap_or(0.0), ..Dop853::default() }
    }

    /// A method at its start; the step is chosen by the crate where none is known.
    fn start(&mut self, engine: &mut Engine, t: f64, x: &[f64]) -> Result<Box<Method>, Attempt> {
        let controlled = engine.mechanism.controlled();
        let allowed: Vec<f64> =
            (0..x.len()).map(|i| if i < controlled { self.atol } else { FREE }).collect();
        let step = self.first.min(self.end - t);
        let mut method = Box::new(
            ExplicitRungeKutta::dop853()
                .rtol(self.rtol)
                .atol(allowed)
                .max_steps(usize::MAX)
                .h0(step),
        );
        match method.init(&Bridge(RefCell::new(engine)), t, self.end, &x.to_vec()) {
            // an evaluation that failed ahead is not yet a failure
            Ok(_) => {
                engine.take_failure();
                Ok(method)
            }
            Err(_) => Err(engine.take_failure().map_or(Attempt::TooShort, Attempt::Failed)),
        }
    }
}

impl Stepper for Dop853 {
    fn attempt(&mut self, engine: &mut Engine, t: &mut f64, x: &mut [f64], limit: f64) -> Attempt {
        let under_way = self.method.take().filter(|_| !self.stale);
        self.stale = false;
        let mut method = match under_way.map_or_else(|| self.start(engine, *t, x), Ok) {
            Ok(method) => method,
            Err(attempt) => return attempt,
        };
        // no crumb is left before the limit
        let own = method.h();
        let room = limit - *t;
        let step = if own >= 0.999_999 * room { room } else { own.min(0.5 * room.max(own)) };
        if *t + step <= *t {
            return engine.take_failure().map_or(Attempt::TooShort, Attempt::Failed);
        }
        method.set_h(step);
        engine.take_failure();
        let outcome = method.step(&Bridge(RefCell::new(engine)));
        let failure = engine.take_failure();
        match outcome {
            Ok(_) if method.t() > *t => {
                let to = if step == room { limit } else { method.t() };
                let mut next = method.y().clone();
                if let Err(status) = engine.settle(to, &mut next) {
                    // the end of the step itself has no answer
                    return self.give_way(engine, step, Some(status));
                }
                (*t, self.failures) = (to, 0);
                x.copy_from_slice(&next);
                engine.counts.steps += 1;
                if engine.counts.steps.is_multiple_of(LOOK) && !self.stiff {
                    self.look(engine, to, x, step);
                }
                // a step that the limit cut short is no evidence against the longer one
                if step < own {
                    let longer = method.h().max(own);
                    method.set_h(longer);
                }
                self.first = method.h();
                self.stale = failure.is_some();
                self.method = Some(method);
                Attempt::Done
            }
            Ok(_) => {
                if failure.is_some() {
                    return self.give_way(engine, step, failure);
                }
                engine.counts.rejected += 1;
                self.first = method.h();
                self.method = Some(method);
                Attempt::Rejected
            }
            Err(Error::Stiffness { .. }) => {
                // its counter is never reset: a new one is made
                self.stiff = true;
                self.first = own;
                Attempt::Rejected
            }
            Err(_) => failure.map_or(Attempt::TooShort, Attempt::Failed),
        }
    }

    fn restart(&mut self) {
        self.method = None;
    }

    /// By the polynomial of order seven H(s) + s² (1 − s)² Q(s), where H is the cubic through both
    /// ends. The crate takes Q(1 − s) for Q(s), so it is asked at the mirrored time.
    fn within(&mut self, t: f64, [first, last]: [&[f64]; 2]) -> Option<Vec<f64>> {
        let method = self.method.as_mut().filter(|_| !self.stale)?;
        let from = method.t_prev();
        let to = method.t();
        let h = to - from;
        let s = (t - from) / h;
        let mirrored = method.interpolate((to - s * h).clamp(from, to)).ok()?;
        let start = method.y_prev();
        let end = method.y();
        let cubic = |i: usize, s: f64| {
            let change = end[i] - start[i];
            let bend = h * first[i] - change;
            let rest = change - h * last[i] - bend;
            start[i] + s * (change + (1.0 - s) * (bend + s * rest))
        };
        let x = mirrored.iter().enumerate();
        Some(x.map(|(i, x)| x + (cubic(i, s) - cubic(i, 1.0 - s))).collect())
    }

    fn finds_stiff(&self) -> bool {
        self.stiff
    }
}

impl Dop853 {
    /// Whether stability bounds the step: by the growth of a vector under the Jacobian.
    fn look(&mut self, engine: &mut Engine, t: f64, x: &[f64], step: f64) {
        let n = x.len();
        let mut jacobian = vec![0.0; n * n];
        if engine.jacobian(t, x, &mut jacobian).is_err() {
            engine.take_failure();
            return;
        }
        let size = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut v: Vec<f64> = (0..n).map(|i| 1.0 + 0.1 * (i % 7) as f64).collect();
        let mut growth = 0.0;
        for k in 0..POWER {
            let scale = size(&v);
            let next: Vec<f64> = jacobian
                .chunks_exact(n)
                .map(|row| row.iter().zip(&v).map(|(a, b)| a * b / scale).sum())
                .collect();
            // the first products still turn towards it
            growth += if k >= POWER / 2 { size(&next).ln() } else { 0.0 };
            v = next;
        }
        let eigenvalue = (growth / f64::from(POWER - POWER / 2)).exp();
        self.found = if step * eigenvalue > STABILITY { self.found + 1 } else { 0 };
        self.stiff |= self.found >= SURE;
    }

    /// Restarts with a shorter step after one without an answer.
    fn give_way(&mut self, engine: &mut Engine, step: f64, status: Option<Status>) -> Attempt {
        engine.counts.failed += 1;
        engine.take_failure();
        self.failures += 1;
        self.method = None;
        self.first = 0.23 * step;
        match status {
            Some(status) if self.failures > MOST_FAILURES => {
                self.failures = 0;
                Attempt::Failed(status)
            }
            _ => Attempt::Rejected,
        }
    }
}
