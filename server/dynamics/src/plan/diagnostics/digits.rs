//! Counts the correct digits of a doubtful answer.
//!
//! Each request accumulates its doubt: a bound, up to a constant, on the growth factor of its
//! roundings. It is the gain of the closures ([`crate::closure::Outcome::gain`]), times the
//! cancellation of forces, divided by nearly vanishing actuators or inertias. The bound is
//! pessimistic; so an answer with a large one is computed again in double-double with perturbed
//! constants ([`crate::workspace::Probe`]), and the difference decides.

use sarrus_proto::Field;

use crate::closure::Level;
use crate::plan::Plan;
use crate::plan::run::RunReport;
use crate::scalar::{BranchValue, DOUBTFUL, Dd, Real};
use crate::workspace::Workspace;

/// Difference from double-double, relative to the largest number of a field, at which the field
/// keeps nine digits with a margin, as a nearby state may lose more.
const KEPT: f64 = 5e-11;
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
        let fits = probe.input.len() >= input.len() && probe.output.len() >= output.len();
        let keeps = fits && {
            let given = &mut probe.input[..input.len()];
            let found = &mut probe.output[..output.len()];
            // from the answer, so that a long path to it is not followed twice
            probe.workspace.resumes = true;
            for (to, x) in probe.workspace.start.iter_mut().zip(&ws.q) {
                *to = Dd::from(x.to_f64());
            }
            for (to, x) in given.iter_mut().zip(input) {
                *to = Dd::from(x.to_f64());
            }
            let answer = self.run(&probe.model, &mut probe.workspace, given, found);
            answer.status == sarrus_proto::Status::Ok && self.agree(output, found, report)
        };
        ws.probe = Some(probe);
        keeps
    }

    /// True where no field differs in its first nine digits.
    fn agree<T: Real>(&self, output: &[T], found: &[Dd], report: &RunReport<T>) -> bool {
        use Field::*;
        self.want().slots().iter().all(|slot| {
            let (least, part) = match slot.field {
                Residual | Iterations | NearestY | Branch | LambdaDeterminate
                | GoodIndependents | Uncontrolled | Projection | Limits | BaseParameters => {
                    return true;
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
            apart <= KEPT * size * part || part.is_infinite()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_of_several_is_no_number_wherever_one_of_them_is_none() {
        let largest = |x: [f64; 3]| x.into_iter().fold(1.0, larger);
        let nan = f64::NAN;
        for x in [[nan, 2.0, 3.0], [2.0, nan, 3.0], [2.0, 3.0, nan], [f64::INFINITY, nan, 0.0]] {
            assert!(largest(x).is_nan(), "{x:?}");
        }
        assert_eq!(largest([3.0, 2.0, f64::INFINITY]), f64::INFINITY);
        assert_eq!((largest([3.0, 7.0, 2.0]), largest([0.0, -1.0, 0.5])), (7.0, 1.0));
    }

    #[test]
    fn a_doubt_that_is_no_number_is_large_whatever_follows() {
        let mut doubt = Doubt::NONE;
        for gain in [2.0, f64::NAN, 3.0] {
            doubt.closure(gain, Level::Acceleration, 1.0);
        }
        assert!(doubt.is_large());
        let mut doubt = Doubt::NONE;
        [f64::NAN, 3.0].into_iter().for_each(|factor| doubt.times(factor));
        assert!(doubt.is_large());
    }
}
