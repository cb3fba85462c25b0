//! Counts the correct digits of a doubtful answer.
//!
//! Each request accumulates its doubt: a bound, up to a constant, on the growth factor of its
//! roundings. It is the gain of the closures ([`crate::closure::Outcome::gain`]), times the
//! cancellation of forces, divided by nearly vanishing actuators or inertias. The bound is
//! pessimistic; so an answer with a large one is computed again ([`crate::workspace::Probe`]): in
//! doubles on perturbed constants and inputs, which samples its roundings, and unless the samples
//! are alike in double-double on perturbed constants, whose difference decides.

#[cfg(test)]
mod tests;

use sarrus_proto::Field;

use crate::closure::Level;
use crate::plan::Plan;
use crate::plan::run::{PlanScalar, RunReport};
use crate::scalar::{BranchValue, DOUBTFUL, Real};
use crate::workspace::{Again, Probe, Workspace};

/// Difference from double-double, relative to the largest number of a field, at which the field
/// keeps nine digits with a margin, as a nearby state may lose more.
const KEPT: f64 = 5e-11;
/// Difference from every sample of roundings below which no comparison in double-double is needed.
const ALIKE: f64 = KEPT / 16.0;
/// Growth of roundings below which one sample decides, and above which samples are seldom alike.
const ONE_ENOUGH: f64 = 2e4;
const SAMPLED: f64 = 1e8;
/// Part of the largest term of a force below which the sum counts as zero.
pub(in crate::plan) const ZERO: f64 = 1e-4;
/// Part of one radian or metre below which a position counts as zero.
const AT_ZERO: f64 = 1e-4;

/// Growth of the roundings of a request, and sizes below which a field counts as zero.
#[derive(Clone, Copy, Debug)]
pub(in crate::plan) struct Doubt {
    /// Bound of the growth.
    pub(in crate::plan) factor: f64,
    /// Forces and accelerations that count as zero, relative to the largest one.
    pub(in crate::plan) force: f64,
    pub(in crate::plan) acceleration: f64,
}

impl Doubt {
    pub(in crate::plan) const NONE: Doubt = Doubt { factor: 1.0, force: 1.0, acceleration: 1.0 };

    /// The doubt of a closure with this gain, up to a level, and this remaining control of its
    /// actuators.
    pub(in crate::plan) fn closure(&mut self, gain: f64, level: Level, control: f64) {
        let growth = match level {
            // positions may be as small as the size that counts as zero
            Level::Position | Level::Jacobian | Level::Velocity => gain,
            Level::Acceleration => gain * gain.sqrt(),
        };
        self.factor = larger(self.factor, growth / control);
    }

    /// Roundings of all that was computed so far grow by this much.
    pub(in crate::plan) fn times(&mut self, factor: f64) {
        self.factor *= larger(1.0, factor);
    }

    /// True where digits have to be counted, or are no numbers.
    pub(in crate::plan) fn is_large(&self) -> bool {
        self.factor.is_nan() || self.factor >= DOUBTFUL
    }
}

/// The larger one; NaN where either is, so that it stays however many others follow.
#[inline(always)]
pub(in crate::plan) fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// Growth of roundings from terms of one size to a sum of another, of which `zero` counts as zero;
/// and zero relative to the sum.
pub(in crate::plan) fn cancellation<T: Real>(terms: T, left: T, zero: T) -> (f64, f64) {
    if terms > T::ZERO && zero > T::ZERO {
        let growth = terms / T::select_lt(left, zero, zero, left);
        let part = (zero / left).to_branch_value(BranchValue::OfDoubt);
        (growth.to_branch_value(BranchValue::Growth), f64::max(1.0, part))
    } else {
        (1.0, 1.0)
    }
}

impl Plan {
    /// True where every field of the answer keeps nine digits. Allocates never.
    pub(in crate::plan) fn keeps_digits<T: Real>(
        &self,
        ws: &mut Workspace<T>,
        input: &[T],
        output: &[T],
        report: &RunReport<T>,
    ) -> bool {
        if self.first.is_some() {
            // no digits of second derivatives are counted
            return false;
        }
        let Some(mut probe) = ws.probe.take() else { return false };
        let Probe { samples, exact } = &mut *probe;
        let q = &ws.q;
        let is_alike = |again: &mut _| self.differs_by(again, q, input, output, report) <= ALIKE;
        let count = match report.doubt.factor {
            factor if factor < ONE_ENOUGH => 1,
            factor if factor < SAMPLED => samples.len(),
            _ => 0,
        };
        let alike = count > 0 && samples[..count].iter_mut().all(is_alike);
        let keeps = alike || self.differs_by(exact, q, input, output, report) <= KEPT;
        ws.probe = Some(probe);
        keeps
    }

    /// The largest difference of an answer from the one computed again, of every field relative to
    /// its largest number; infinite where that fails.
    fn differs_by<T: Real, S: PlanScalar>(
        &self,
        again: &mut Again<S>,
        q: &[T],
        input: &[T],
        output: &[T],
        report: &RunReport<T>,
    ) -> f64 {
        if again.input.len() < input.len() || again.output.len() < output.len() {
            return f64::INFINITY;
        }
        again.resume(input, q);
        let found = &mut again.output[..output.len()];
        let given = &again.input[..input.len()];
        let answer = self.run(&again.model, &mut again.workspace, given, found);
        if answer.status != sarrus_proto::Status::Ok {
            return f64::INFINITY;
        }
        self.difference(output, found, report)
    }

    /// The largest difference of two answers, of every field relative to its largest number.
    fn difference<T: Real, S: Real>(
        &self,
        output: &[T],
        found: &[S],
        report: &RunReport<T>,
    ) -> f64 {
        use Field::*;
        self.want().slots().iter().fold(0.0, |most, slot| {
            let (least, part) = match slot.field {
                Residual | Iterations | NearestY | Branch | LambdaDeterminate
                | GoodIndependents | Uncontrolled | Projection | Limits | BaseParameters => {
                    return most;
                }
                Q | Y | U | FramePose => (AT_ZERO, 1.0),
                Ydd | Qdd | Udd | FrameAcc => (0.0, report.doubt.acceleration),
                TauQ | TauY | TauU | TauUnactuated => (0.0, report.doubt.force),
                _ => (0.0, 1.0),
            };
            let mut size = least;
            let mut apart = 0.0_f64;
            for (x, y) in output[slot.range()].iter().zip(&found[slot.range()]) {
                let x = x.to_f64();
                let y = y.to_f64();
                // a condition may be infinite
                let is_alike = x == y || x.is_nan() && y.is_nan() && slot.field.is_of_motors();
                let distance = if is_alike { 0.0 } else { (x - y).abs() };
                let x = if is_alike && x.is_nan() { 0.0 } else { x };
                (size, apart) = (larger(size, x.abs()), larger(apart, distance));
            }
            // of nothing, rounding is all there is
            if apart == 0.0 || part.is_infinite() {
                most
            } else {
                larger(most, apart / (size * part))
            }
        })
    }
}
