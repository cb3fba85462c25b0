//! Steps of a given length, by a method that makes one step; one without an answer is split.

use sarrus_dynamics::Status;

use crate::methods::{Attempt, Stepper};
use crate::motion::engine::Engine;

/// How often a step without an answer is split.
const SPLITS: u32 = 16;
/// Where: unequally, so that no part ends where the whole one or its middle did.
const PART: f64 = 0.381_966_011_250_105_2;

/// One step from a settled state to a new one.
pub(crate) trait OneStep {
    /// From t to `to`; x becomes the new settled state, or stays where that has no answer.
    fn step(&mut self, engine: &mut Engine, t: f64, x: &mut [f64], to: f64) -> Result<(), Status>;
}

/// A method of fixed step.
pub(crate) struct FixedStep<M> {
    method: M,
    step: f64,
}

impl<M: OneStep + Default> FixedStep<M> {
    pub(crate) fn new(step: f64) -> FixedStep<M> {
        FixedStep { method: M::default(), step }
    }

    /// One step, and if it has no answer two shorter ones; t and x stay at the last good state.
    fn walk(
        &mut self,
        engine: &mut Engine,
        t: &mut f64,
        x: &mut [f64],
        to: f64,
        splits: u32,
    ) -> Result<(), Status> {
        let Err(status) = self.method.step(engine, *t, x, to) else {
            *t = to;
            engine.counts.steps += 1;
            return Ok(());
        };
        engine.counts.failed += 1;
        let middle = *t + PART * (to - *t);
        if splits == 0 || middle <= *t || middle >= to {
            return Err(status);
        }
        self.walk(engine, t, x, middle, splits - 1)?;
        self.walk(engine, t, x, to, splits - 1)
    }
}

impl<M: OneStep + Default> Stepper for FixedStep<M> {
    fn attempt(&mut self, engine: &mut Engine, t: &mut f64, x: &mut [f64], limit: f64) -> Attempt {
        // the last step may be a little longer than the others, never a crumb
        let to = if *t + 1.000_001 * self.step >= limit { limit } else { *t + self.step };
        let walked = self.walk(engine, t, x, to, SPLITS);
        walked.map_or_else(Attempt::Failed, |()| Attempt::Done)
    }

    fn restart(&mut self) {}
}
