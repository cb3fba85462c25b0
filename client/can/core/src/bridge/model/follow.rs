//! Measured and commanded poses of the mechanisms.

use sarrus_proto::actuators::Reason;

use super::assessed::{Assessed, LOST};
use super::{Activity, RobotModel};

/// Most evaluations in one cycle, without those that identify a mechanism that cannot be closed.
const ROUNDS: usize = 4;

impl RobotModel {
    /// The measured pose and its forces.
    pub(super) fn follow_measured(&mut self, now_ns: u64) {
        let h = self.last_ns.map_or(0.0, |last| now_ns.saturating_sub(last) as f64 * 1e-9);
        self.last_ns = Some(now_ns);
        for (u, measured) in self.u.iter_mut().zip(&self.measured) {
            if measured.position.is_finite() {
                *u = measured.position;
            }
        }
        let assessment = self.cycle / 2;
        for k in 0..self.mechanisms.len() {
            let is_measured = self.is_measured(&self.mechanisms[k]);
            let mechanism = &mut self.mechanisms[k];
            mechanism.fault = Reason::None;
            if !is_measured || !mechanism.linkage.is_determined() {
                continue;
            }
            if mechanism.linkage.is_serial {
                mechanism.measured.next[0] = self.u[mechanism.linkage.actuators[0]];
            } else if !mechanism.is_due(assessment) {
                mechanism.measured.go_back();
            } else if mechanism.measured.lost > LOST && mechanism.activity == Activity::Idle {
                let y = mechanism.linkage.independents.iter().map(|(_, place)| self.home[*place]);
                mechanism.measured.restart(y);
            }
            mechanism.measured.put(&mechanism.linkage, &mut self.pose.y);
        }

        // Newton's method until all poses are found
        let mut has_forces = false;
        for round in 0..ROUNDS {
            let is_closed = if round == 0 && self.rules.effort.max(self.rules.external) > 0.0 {
                has_forces = self.evaluator.motion(&mut self.pose, &self.yd, &self.ydd);
                has_forces
            } else {
                self.evaluator.pose(&mut self.pose)
            };
            if !is_closed {
                self.follow_each(assessment);
                break;
            }
            let mut is_complete = true;
            for k in 0..self.mechanisms.len() {
                if !self.is_followed(k, assessment) {
                    continue;
                }
                let Assessed { linkage, measured, .. } = &mut self.mechanisms[k];
                measured.assess(linkage, &self.pose, &self.u);
                measured.put(linkage, &mut self.pose.y);
                is_complete &= measured.is_found;
            }
            if is_complete {
                break;
            }
        }

        // the result for each mechanism
        for k in 0..self.mechanisms.len() {
            let is_measured = self.is_measured(&self.mechanisms[k]);
            let mechanism = &mut self.mechanisms[k];
            let is_found = mechanism.linkage.is_serial || mechanism.measured.is_found;
            self.known[k] = is_measured && is_found;
            if !is_measured || !mechanism.is_closed() {
                continue;
            }
            let tracker = &mut mechanism.measured;
            tracker.lost = if tracker.is_found { 0 } else { tracker.lost.saturating_add(1) };
            if tracker.is_found {
                mechanism.foresee(&self.pose, &self.measured, &self.braking, h);
                mechanism.assess_limits(self.rules.clearance);
            } else if tracker.lost >= LOST {
                mechanism.fault = mechanism.no_pose();
            }
        }
        self.compare_encoders(now_ns);
        if has_forces && h > 0.0 {
            self.compare_efforts(Reason::ModelEffort);
            self.filter(h);
            self.observe(h);
        }
    }

    /// A closed mechanism whose pose is followed in this assessment.
    fn is_followed(&self, number: usize, assessment: u64) -> bool {
        let mechanism = &self.mechanisms[number];
        mechanism.is_closed() && mechanism.is_due(assessment) && self.is_measured(mechanism)
    }

    /// Some mechanism cannot be closed: each is tried alone, the others where they were last.
    fn follow_each(&mut self, assessment: u64) {
        for k in 0..self.mechanisms.len() {
            if !self.is_followed(k, assessment) {
                continue;
            }
            for (other, mechanism) in self.mechanisms.iter().enumerate() {
                if other == k {
                    mechanism.measured.put(&mechanism.linkage, &mut self.pose.y);
                } else if mechanism.is_closed() {
                    mechanism.measured.put_good(&mechanism.linkage, &mut self.pose.y);
                }
            }
            let is_closed = self.evaluator.pose(&mut self.pose);
            let Assessed { linkage, measured, .. } = &mut self.mechanisms[k];
            if is_closed {
                measured.assess(linkage, &self.pose, &self.u);
            } else {
                measured.is_found = false;
                measured.halve();
            }
        }
    }

    /// Whether there are poses that have the commanded positions.
    pub(super) fn follow_commanded(&mut self) {
        let mut is_any = false;
        self.commanded.y.copy_from_slice(&self.pose.y);
        for k in 0..self.mechanisms.len() {
            if !self.is_commanded(k) {
                let Assessed { measured, commanded, .. } = &mut self.mechanisms[k];
                commanded.begin_at(measured);
            } else {
                is_any = true;
            }
            let Assessed { linkage, commanded, .. } = &self.mechanisms[k];
            if linkage.is_determined() && !linkage.is_serial {
                commanded.put(linkage, &mut self.commanded.y);
            }
        }
        for (target, measured) in self.target.iter_mut().zip(&self.measured) {
            *target = measured.setpoint.unwrap_or(f64::NAN);
        }
        if !is_any {
            return;
        }
        for _ in 0..ROUNDS {
            let is_closed = self.evaluator.pose(&mut self.commanded);
            let mut is_complete = true;
            for k in 0..self.mechanisms.len() {
                if !self.is_commanded(k) {
                    continue;
                }
                let Assessed { linkage, commanded, .. } = &mut self.mechanisms[k];
                if is_closed {
                    commanded.assess(linkage, &self.commanded, &self.target);
                } else {
                    commanded.is_found = false;
                    commanded.halve();
                }
                commanded.put(linkage, &mut self.commanded.y);
                is_complete &= commanded.is_found;
            }
            if is_complete {
                break;
            }
        }
        for k in 0..self.mechanisms.len() {
            if self.is_commanded(k) {
                let Assessed { commanded, fault, .. } = &mut self.mechanisms[k];
                commanded.lost = if commanded.is_found { 0 } else { commanded.lost + 1 };
                if commanded.lost >= LOST {
                    *fault = Reason::MechanismLimit;
                }
            }
        }
    }

    /// A closed mechanism whose motors all get positions.
    fn is_commanded(&self, number: usize) -> bool {
        let mechanism = &self.mechanisms[number];
        let is_told = |u: &usize| self.measured[*u].setpoint.is_some();
        mechanism.is_closed()
            && mechanism.activity >= Activity::Ramping
            && mechanism.measured.is_found
            && mechanism.linkage.actuators.iter().all(is_told)
    }
}
