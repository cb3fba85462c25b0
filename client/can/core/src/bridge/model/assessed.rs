//! One mechanism and its assessment.

use sarrus_proto::actuators::Reason;

use super::Measured;
use super::effort::Contradiction;
use super::evaluator::Pose;
use super::linkage::Linkage;
use super::tracker::Tracker;
use crate::state::{state, state_of_enum};

/// Assessments between two retries of a mechanism that is lost for longer.
const RARELY: u64 = 16;
/// Part of the range of an independent by which it may exceed its limits.
const MARGIN: f64 = 0.01;
/// Part of its clearance by which a mechanism may approach a singular pose.
const NEARER: f64 = 0.7;
/// Part of the least clearance that a stop may leave.
const NEAREST: f64 = 0.5;
/// Assessments without a pose after which the pose counts as lost.
pub(super) const LOST: u32 = 2;

/// Activity of a mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::bridge) enum Activity {
    /// Its motors have no power.
    Idle,
    /// Its motors have power and follow no command.
    Powered,
    /// They follow commands, and gains still grow.
    Ramping,
    /// They follow commands.
    Following,
}

/// One mechanism and its assessment.
#[derive(Debug)]
pub(super) struct Assessed {
    pub(super) linkage: Linkage,
    pub(super) measured: Tracker,
    pub(super) commanded: Tracker,
    pub(super) activity: Activity,
    /// Bounds of its independents and of its clearance.
    bounds: Vec<[f64; 2]>,
    least_clearance: f64,
    /// Velocities of its independents, the time until they have stopped, counted at these
    /// velocities, and the clearance then; clearance and independents of the pose before.
    rates: Vec<f64>,
    ahead: f64,
    clearance_ahead: f64,
    clearance_before: f64,
    y_before: Vec<f64>,
    /// Of reported efforts with the model, and external forces beyond their threshold.
    pub(super) contradictions: [Contradiction; 2],
    /// When all of its actuators had measured anew, at the last look at their motion `[ns]`.
    pub(super) seen_ns: u64,
    /// When filtered efforts and motion are of the same time again `[ns]`.
    pub(super) settled_ns: u64,
    /// [`Reason::None`] without one.
    pub(super) fault: Reason,
}

impl Assessed {
    /// At a pose. Allocates; nothing after it does.
    pub(super) fn new(linkage: Linkage, pose: &Pose) -> Assessed {
        Assessed {
            measured: Tracker::new(&linkage, pose),
            commanded: Tracker::new(&linkage, pose),
            activity: Activity::Idle,
            bounds: vec![[f64::NEG_INFINITY, f64::INFINITY]; linkage.independents.len()],
            least_clearance: 0.0,
            rates: vec![0.0; linkage.independents.len()],
            ahead: 0.0,
            clearance_ahead: 1.0,
            clearance_before: f64::NAN,
            y_before: vec![0.0; linkage.independents.len()],
            contradictions: [Contradiction::default(); 2],
            seen_ns: 0,
            settled_ns: 0,
            fault: Reason::None,
            linkage,
        }
    }

    /// Whether something is closed that its actuators determine.
    pub(super) fn is_closed(&self) -> bool {
        self.linkage.is_determined() && !self.linkage.is_serial
    }

    /// The reason where no pose has the measured actuators: with more actuators than degrees of
    /// freedom they contradict each other.
    pub(super) fn no_pose(&self) -> Reason {
        if self.linkage.actuators.len() > self.linkage.independents.len() {
            Reason::LoopResidual
        } else {
            Reason::Unreachable
        }
    }

    /// A mechanism that has no pose is tried again rarely.
    pub(super) fn is_due(&self, assessment: u64) -> bool {
        self.measured.lost <= LOST || assessment.is_multiple_of(RARELY)
    }

    /// Where the mechanism can stop: y + ẏ (t + |u̇| / (2 a)), with the delay t and deceleration a
    /// of its slowest actuator, and its clearance likewise; `h` seconds after the last assessment.
    /// Measurements of two poses may lie farther apart than the assessments: the time is then that
    /// of the way between the poses, Δy · ẏ / ẏ². The factor is that of the pose.
    pub(super) fn foresee(
        &mut self,
        pose: &Pose,
        measured: &[Measured],
        braking: &[[f64; 2]],
        h: f64,
    ) {
        let Assessed { linkage, rates, y_before, .. } = self;
        let mut ahead = 0.0_f64;
        for &u in &linkage.actuators {
            let [a, delay] = braking[u];
            ahead = ahead.max(delay + 0.5 * measured[u].velocity.abs() / a);
        }
        linkage.independents_of(pose, |_, u| measured[u].velocity, rates);
        // velocities that are not reported foresee nothing
        let is_reported = rates.iter().all(|rate| rate.is_finite());
        self.ahead = if is_reported { ahead } else { 0.0 };
        let clearance = self.measured.clearance;
        let mut way = 0.0;
        let mut square = 0.0;
        for ((y, before), rate) in self.measured.good.iter().zip(y_before).zip(rates) {
            way += (y - *before) * *rate;
            square += *rate * *rate;
            *before = *y;
        }
        // NaN at rest
        let rate = (clearance - self.clearance_before) / h.max(way / square);
        self.clearance_ahead = if rate < 0.0 { clearance + rate * self.ahead } else { clearance };
        self.clearance_before = clearance;
    }

    /// Limits and the clearance, as ratchets: without power they are where the mechanism is.
    pub(super) fn assess_limits(&mut self, least_clearance: f64) {
        let is_powered = self.activity > Activity::Idle;
        let mut is_beyond = false;
        let clearance = self.measured.clearance;
        for (i, limits) in self.linkage.limits.iter().enumerate() {
            let y = self.measured.next[i];
            let range = limits[1] - limits[0];
            let margin = if range.is_finite() { MARGIN * range } else { MARGIN };
            let bounds = &mut self.bounds[i];
            let rate = self.rates[i];
            let stops_at = if self.ahead > 0.0 { y + rate * self.ahead } else { y };
            is_beyond |= is_powered
                && (y < bounds[0]
                    || y > bounds[1]
                    || rate < 0.0 && stops_at < bounds[0]
                    || rate > 0.0 && stops_at > bounds[1]);
            let lower = (limits[0] - margin).min(y - margin);
            let upper = (limits[1] + margin).max(y + margin);
            *bounds = if is_powered {
                [bounds[0].max(lower), bounds[1].min(upper)]
            } else {
                [lower, upper]
            };
        }
        let is_near = is_powered
            && (clearance < self.least_clearance
                || self.clearance_ahead < NEAREST * self.least_clearance);
        let least = least_clearance.min(NEARER * clearance);
        self.least_clearance = if is_powered { self.least_clearance.max(least) } else { least };
        if is_near {
            self.fault = Reason::NearSingular;
        } else if is_beyond {
            self.fault = Reason::MechanismLimit;
        }
    }
}

state_of_enum!(Activity { Idle, Powered, Ramping, Following });

state!(Assessed {
    measured, commanded, activity, bounds, least_clearance, clearance_before, y_before,
    contradictions, seen_ns, settled_ns, fault;
    linkage, rates, ahead, clearance_ahead
});
