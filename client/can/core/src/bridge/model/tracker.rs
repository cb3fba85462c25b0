//! The pose of one closed mechanism from its actuators: Newton's method with step halving, a few
//! evaluations per cycle, from the pose of the last cycle.
//!
//! A pose counts as found when the actuators of the model are within a margin of the given ones.
//! The margin exceeds the noise, which can move measurements out of the workspace near its border.
//! If no step reduces the deviation, no pose matches the actuators.

use super::evaluator::Pose;
use super::linkage::Linkage;
use crate::state::state;

/// Longest step, as part of the range of an independent without limits `[m, rad]`.
const LONGEST: f64 = 0.2;
/// A step is good if at most this part of the deviation remains.
const GOOD: f64 = 0.9;
/// The shortest fraction of a step.
const LEAST_PART: f64 = 1.0 / 16.0;

/// The state of the pose search of one mechanism.
#[derive(Debug)]
pub(super) struct Tracker {
    /// The independents of the last good pose, and the next ones to evaluate.
    pub(super) good: Vec<f64>,
    pub(super) next: Vec<f64>,
    step: Vec<f64>,
    part: f64,
    /// The target actuator positions.
    target: Vec<f64>,
    /// Deviation of the last good pose from them, in margins; infinite before the first.
    deviation: f64,
    /// The last good pose matches the target.
    pub(super) is_found: bool,
    /// Cycles without such a pose.
    pub(super) lost: u32,
    /// Distance of the last good pose from a singular one.
    pub(super) clearance: f64,
}

impl Tracker {
    /// Begins at the independents of a pose. Allocates; nothing after it does.
    pub(super) fn new(linkage: &Linkage, pose: &Pose) -> Tracker {
        let y: Vec<f64> = linkage.independents.iter().map(|(_, place)| pose.y[*place]).collect();
        Tracker {
            step: vec![0.0; y.len()],
            next: y.clone(),
            good: y,
            part: 1.0,
            target: vec![0.0; linkage.actuators.len()],
            deviation: f64::INFINITY,
            is_found: false,
            lost: 0,
            clearance: 1.0,
        }
    }

    /// Begins anew where another one is.
    pub(super) fn begin_at(&mut self, other: &Tracker) {
        self.good.copy_from_slice(&other.good);
        self.next.copy_from_slice(&other.good);
        (self.deviation, self.is_found, self.lost) = (f64::INFINITY, other.is_found, 0);
        self.clearance = other.clearance;
    }

    /// Begins anew at independents.
    pub(super) fn restart(&mut self, y: impl Iterator<Item = f64>) {
        self.good.iter_mut().zip(y).for_each(|(good, y)| *good = y);
        self.next.copy_from_slice(&self.good);
        self.deviation = f64::INFINITY;
    }

    /// Goes back to the last good pose.
    pub(super) fn go_back(&mut self) {
        self.next.copy_from_slice(&self.good);
        self.deviation = f64::INFINITY;
    }

    /// Puts the independents to be evaluated next into a pose.
    pub(super) fn put(&self, linkage: &Linkage, y: &mut [f64]) {
        let places = linkage.independents.iter().map(|(_, place)| *place);
        places.zip(&self.next).for_each(|(place, next)| y[place] = *next);
    }

    /// Puts the last good pose there.
    pub(super) fn put_good(&self, linkage: &Linkage, y: &mut [f64]) {
        let places = linkage.independents.iter().map(|(_, place)| *place);
        places.zip(&self.good).for_each(|(place, good)| y[place] = *good);
    }

    /// The pose was evaluated at `next`: takes it, or half the step; then aims at the newest
    /// actuators.
    pub(super) fn assess(&mut self, linkage: &mut Linkage, pose: &Pose, newest: &[f64]) {
        let before = self.deviation;
        let now = deviation(linkage, pose, &self.target);
        let is_first = before == f64::INFINITY;
        let is_found = !is_first && now <= 1.0;
        let is_better = is_first || is_found || now <= GOOD * before;
        if !is_better || !linkage.factorise(pose) {
            self.is_found = false;
            return self.halve();
        }
        self.is_found = is_found;
        self.clearance = linkage.clearance(pose);
        self.good.copy_from_slice(&self.next);
        for (target, &u) in self.target.iter_mut().zip(&linkage.actuators) {
            *target = newest[u];
        }
        self.deviation = deviation(linkage, pose, &self.target);
        let target = &self.target;
        let step = &mut self.step;
        linkage.independents_of(pose, |k, u| target[k] - pose.u[u], step);
        // no longer than allowed, all in one direction
        let longest = step.iter().zip(&linkage.limits).fold(1.0_f64, |most, (step, limits)| {
            let range = limits[1] - limits[0];
            let range = if range.is_finite() { range } else { 1.0 };
            most.max(step.abs() / (LONGEST * range))
        });
        step.iter_mut().for_each(|step| *step /= longest);
        self.part = 1.0;
        self.advance();
    }

    /// The pose could not be evaluated, or is no better: half the step, and from its least part on
    /// none.
    pub(super) fn halve(&mut self) {
        self.part *= 0.5;
        if self.part < LEAST_PART {
            self.go_back();
        } else {
            self.advance();
        }
    }

    fn advance(&mut self) {
        for ((next, good), step) in self.next.iter_mut().zip(&self.good).zip(&self.step) {
            *next = good + self.part * step;
        }
    }
}

/// How far the actuators of a pose are from those aimed at, in margins.
fn deviation(linkage: &Linkage, pose: &Pose, target: &[f64]) -> f64 {
    let square = linkage.actuators.iter().zip(&linkage.weights).zip(target).fold(
        0.0,
        |sum, ((&u, weight), target)| {
            let off = weight * (target - pose.u[u]);
            sum + off * off
        },
    );
    square.sqrt()
}

state!(Tracker { good, next, step, part, target, deviation, is_found, lost, clearance });
