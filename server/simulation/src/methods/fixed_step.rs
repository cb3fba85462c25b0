//! Steps of a given length: semi-implicit Euler and the classical method of Runge and Kutta.

use sarrus_dynamics::Status;

use crate::methods::{Attempt, Stepper};
use crate::motion::engine::Engine;

/// How often a step without an answer is split.
const SPLITS: u32 = 16;
/// Where: unequally, so that no part ends where the whole one or its middle did.
const PART: f64 = 0.381_966_011_250_105_2;

/// Which of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    Euler,
    RungeKutta,
}

/// A method of fixed step.
pub(crate) struct Fixed {
    rule: Rule,
    step: f64,
    stages: [Vec<f64>; 4],
    at: Vec<f64>,
    next: Vec<f64>,
}

impl Fixed {
    pub(crate) fn new(rule: Rule, step: f64) -> Fixed {
        Fixed { rule, step, stages: Default::default(), at: Vec::new(), next: Vec::new() }
    }

    /// One step, and if it has no answer two shorter ones; t and x stay at the last good state.
    fn walk(
        &mut self,
        engine: &mut Engine,
        t: &mut f64,
        x: &mut [f64],
        to: f64,
        splits: u32,
    ) -> Status {
        let status = match self.rule {
            Rule::Euler => self.euler(engine, *t, x, to),
            Rule::RungeKutta => self.runge_kutta(engine, *t, x, to),
        };
        if status == Status::Ok {
            *t = to;
            engine.counts.steps += 1;
            return status;
        }
        engine.counts.failed += 1;
        let middle = *t + PART * (to - *t);
        if splits == 0 || middle <= *t || middle >= to {
            return status;
        }
        match self.walk(engine, t, x, middle, splits - 1) {
            Status::Ok => self.walk(engine, t, x, to, splits - 1),
            other => other,
        }
    }

    /// ẏ += h ÿ at the old state, then y along the new ẏ by the exponential map.
    fn euler(&mut self, engine: &mut Engine, t: f64, x: &mut [f64], to: f64) -> Status {
        let (n_qy, n_vy, h) = (engine.mechanism.sizes.n_qy, engine.mechanism.sizes.n_vy, to - t);
        self.next.clear();
        self.next.extend_from_slice(x);
        let rate = &engine.anchor.rate;
        (n_qy..x.len()).for_each(|i| self.next[i] += h * rate[i]);
        let (y, rest) = self.next.split_at_mut(n_qy);
        engine.mechanism.y.advance(y, &rest[..n_vy], h);
        self.accept(engine, to, x)
    }

    /// Four stages; the first is known.
    fn runge_kutta(&mut self, engine: &mut Engine, t: f64, x: &mut [f64], to: f64) -> Status {
        let (n, h) = (x.len(), to - t);
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
        self.accept(engine, to, x)
    }

    fn accept(&mut self, engine: &mut Engine, t: f64, x: &mut [f64]) -> Status {
        let status = engine.settle(t, &mut self.next);
        if status == Status::Ok {
            x.copy_from_slice(&self.next);
        }
        status
    }
}

impl Stepper for Fixed {
    fn attempt(&mut self, engine: &mut Engine, t: &mut f64, x: &mut [f64], limit: f64) -> Attempt {
        // the last step may be a little longer than the others, never a crumb
        let to = if *t + 1.000_001 * self.step >= limit { limit } else { *t + self.step };
        match self.walk(engine, t, x, to, SPLITS) {
            Status::Ok => Attempt::Done,
            status => Attempt::Failed(status),
        }
    }

    fn restart(&mut self) {}
}
