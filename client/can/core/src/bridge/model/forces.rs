//! Forces of the model: gravity, and whether reported efforts contradict it.

use sarrus_dynamics::Field;
use sarrus_proto::actuators::Reason;

use super::assessed::Assessed;
use super::effort::{self, Filtered, MOTION};
use super::{Activity, RobotModel};

/// Least clearance at which gravity is given, and at which efforts are compared: the model's error
/// grows as the inverse of the clearance.
const WEIGHED: f64 = 0.02;
const COMPARED: f64 = 0.15;

impl RobotModel {
    /// Measured ẏ and ÿ, and the efforts, all filtered, of mechanisms whose actuators have all
    /// measured anew, `interval` seconds after the last time. Where measurements are lost the
    /// velocity tells of the efforts in between, which are not known.
    pub(super) fn filter(&mut self, interval: f64) {
        for k in 0..self.mechanisms.len() {
            let is_known = self.is_known(k);
            let Assessed { linkage, measured, seen_ns, settled_ns, .. } = &mut self.mechanisms[k];
            let newest = linkage.actuators.iter().map(|u| self.measured[*u].measured_ns).min();
            let newest = newest.unwrap_or(0);
            if newest <= *seen_ns {
                continue;
            }
            let h = (newest - *seen_ns) as f64 * 1e-9;
            *seen_ns = newest;
            if h > effort::longest(interval) || !is_known {
                *settled_ns = newest + effort::SETTLED_NS;
            }
            let rates = &mut self.rates[..linkage.independents.len()];
            let velocity = |u: usize| self.measured[u].velocity;
            let is_reported = linkage.actuators.iter().all(|u| velocity(*u).is_finite());
            let is_reported = is_reported && linkage.factorise(&self.pose);
            if is_reported {
                linkage.independents_of(&self.pose, |_, u| velocity(u), rates);
            }
            for (i, &(v, _)) in linkage.independents.iter().enumerate() {
                let change = (measured.next[i] - self.y_before[v]) / h;
                let rate = if is_reported { rates[i] } else { change };
                self.y_before[v] = if is_known { measured.next[i] } else { f64::NAN };
                let motion = &mut self.motion[v];
                if is_known && rate.is_finite() {
                    motion.update(rate, h);
                } else {
                    *motion = Filtered::default();
                }
                (self.yd[v], self.ydd[v]) = (motion.value, motion.rate);
            }
            for &u in &linkage.actuators {
                let effort = self.measured[u].effort;
                if effort.is_finite() {
                    self.efforts[u].update_twice(effort, h);
                }
            }
        }
    }

    /// Forces that the model does not explain, for this reason: reported efforts beside the
    /// model's, or the pose's external forces.
    pub(super) fn compare_efforts(&mut self, reason: Reason) {
        let is_external = reason == Reason::ExternalForce;
        let part = if is_external { self.rules.external } else { self.rules.effort };
        for k in (0..self.mechanisms.len()).filter(|_| part > 0.0) {
            let is_following = self.mechanisms[k].activity == Activity::Following;
            let is_reported = |u: &usize| self.measured[*u].effort.is_finite();
            let is_reported = self.mechanisms[k].linkage.actuators.iter().all(is_reported);
            let is_known = is_reported && self.is_weighable(k, COMPARED);
            let Assessed { linkage, contradictions, seen_ns, settled_ns, fault, .. } =
                &mut self.mechanisms[k];
            let mut is_beyond = false;
            if is_external && !is_known {
                // the observer begins at none
                linkage.independents.iter().for_each(|(v, _)| self.observer[3 * v] = 0.0);
            } else if is_known && is_following && linkage.factorise(&self.pose) {
                linkage.efforts(&self.pose, &mut self.asked);
                let reported = |u: usize| if is_external { 0.0 } else { self.efforts[u].rate };
                linkage.efforts_beside(&self.pose, reported, |u, deviation| {
                    let moving = if is_external { 0.0 } else { self.asked[u] - self.gravity[u] };
                    let most = part * self.limits[u].effort + MOTION * moving.abs();
                    is_beyond |= deviation.abs() > most;
                });
            }
            let is_settled = *seen_ns >= *settled_ns;
            let contradiction = &mut contradictions[usize::from(is_external)];
            if is_settled && contradiction.update(*seen_ns, is_beyond) && *fault == Reason::None {
                *fault = reason;
            }
        }
    }

    /// A step of the observer of external forces, `h` seconds after the last one. Motion and
    /// efforts went through the same filter once, so that they are of one time.
    pub(super) fn observe(&mut self, h: f64) {
        let RobotModel { evaluator, pose, yd, asked, efforts, observer, .. } = self;
        asked.iter_mut().zip(efforts).for_each(|(asked, effort)| *asked = effort.value);
        let given = [(Field::Dt, &[h][..]), (Field::Yd, yd), (Field::TauU, asked)];
        if evaluator.observe(pose, given, observer) {
            self.compare_efforts(Reason::ExternalForce);
        }
    }

    /// The efforts that hold the robot against gravity where it is.
    pub(super) fn weigh(&mut self) {
        if !self.evaluator.rest(&mut self.pose) {
            return;
        }
        for k in 0..self.mechanisms.len() {
            let is_weighable = self.is_weighable(k, WEIGHED);
            let Assessed { linkage, .. } = &mut self.mechanisms[k];
            if is_weighable && linkage.factorise(&self.pose) {
                linkage.efforts(&self.pose, &mut self.gravity);
            } else {
                linkage.actuators.iter().for_each(|u| self.gravity[*u] = 0.0);
            }
        }
    }
}
