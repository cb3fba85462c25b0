//! Counts the correct digits of a doubtful answer.
//!
//! Each request accumulates its doubt: a bound, up to a constant, on the growth factor of its
//! roundings. It is the gain of the closures ([`crate::closure::Outcome::gain`]), times the
//! cancellation of forces, divided by nearly vanishing actuators or inertias. The bound is
//! pessimistic; so an answer with a large one is computed again ([`crate::workspace::Probe`]): in
//! doubles on perturbed constants and inputs, which samples its roundings, and where a sample
//! differs by more than a small part of what is allowed in double-double on perturbed constants,
//! and that difference decides.

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

#[cfg(test)]
mod tests {
    use sarrus_proto::{FieldSet, Query, Request};

    use super::*;
    use crate::builder::{CutJoint, DescriptionBuilder, LinkId};
    use crate::description::Inertial;

    /// A slider-crank, crank 3 and rod 5, that the slider moves: singular where they are in line.
    /// Every number of the robot is whole.
    #[test]
    fn samples_take_no_answer_for_good_that_double_double_does_not() {
        let y = [0.0, 1.0, 0.0];
        let mut robot = DescriptionBuilder::new("slider-crank");
        robot.default_inertial(Inertial::new(2.0, [1.0, 0.0, 1.0], [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]));
        let crank = robot.revolute("crank", LinkId::BASE, y).link();
        let rod = robot.revolute("rod", crank, y).at([0.0, 0.0, 3.0]).link();
        let slider = robot.prismatic("slider", LinkId::BASE, [1.0, 0.0, 0.0]);
        let slider = slider.at([4.0, 0.0, 0.0]).link();
        robot
            .cut("pin", rod, slider)
            .at([4.0, 0.0, 0.0])
            .joint(CutJoint::PlanarRevolute { axis: y });
        robot.independent([slider]);
        let model = robot.compile().unwrap().model;
        let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
        let want = FieldSet::of(&[Field::Q, Field::Qd, Field::Qdd, Field::TauU]);
        let plan = Plan::new(&model, &Query::new(Request::InverseDynamics, given, want)).unwrap();
        let mut ws = Workspace::for_plans(&model, [&plan]);
        let mut output = vec![0.0; plan.want().len()];
        let [mut answered, mut alike, mut lost] = [0; 3];
        for k in 0..800 {
            // from a tenth to 1e-11 before or behind one of both singular poses
            let away = 10_f64.powf(-1.0 - 10.0 * f64::from(k) / 800.0);
            let at = if k % 2 == 0 { 4.0 - away } else { away - 2.0 };
            let input = [at, (f64::from(k) * 0.7).sin(), (f64::from(k) * 1.3).cos()];
            if plan.run(&model, &mut ws, &input, &mut output).status != sarrus_proto::Status::Ok {
                continue;
            }
            answered += 1;
            let mut probe = ws.probe.take().unwrap();
            let Probe { samples, exact } = &mut *probe;
            let report = RunReport::<f64>::none();
            let off = |again: &mut _| plan.differs_by(again, &ws.q, &input, &output, &report);
            let is_alike = samples.iter_mut().map(off).all(|off| off <= ALIKE);
            let off = plan.differs_by(exact, &ws.q, &input, &output, &report);
            alike += u32::from(is_alike);
            lost += u32::from(off > KEPT);
            assert!(!is_alike || off <= KEPT, "{input:?}: {off:e}");
            ws.probe = Some(probe);
        }
        // both ends of the range are decided
        assert!(alike > 60 && lost > 60, "{alike} {lost} of {answered}");
    }

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
