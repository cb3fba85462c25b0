//! The robot's model in the bridge: each closed mechanism assessed as one.
//!
//! From the measured actuators u the model finds y, G and the forces. Every second cycle it follows
//! what was measured, in the cycles between in turn what is commanded and what gravity asks for. A
//! mechanism is assessed when all its actuators are measured and determine its pose, its forces
//! when this holds of all mechanisms that carry it or that it carries. Limits are ratchets: what is
//! beyond one when it gets power may come back, and may then not go out again.

mod cholesky;
mod effort;
mod evaluator;
mod linkage;
mod setup;
mod tracker;

use sarrus_proto::actuators::Reason;

use crate::config::{Configuration, Limits, ModelRules, MotorConfig};
use effort::{Contradiction, Filtered};
use evaluator::{Evaluator, Pose};
use linkage::{Linkage, Rows};
use tracker::Tracker;

/// Evaluations in one cycle at most, beside those that find out which mechanism cannot be closed.
const ROUNDS: usize = 4;
/// Assessed cycles without a pose after which there is none.
const LOST: u32 = 2;
/// A mechanism that is lost for longer is tried again only every so many assessments.
const RARELY: u64 = 16;
/// Part of the range of an independent by which it may be beyond its limits.
const MARGIN: f64 = 0.01;
/// Least clearance at which gravity is given, and at which efforts are compared: what the model is
/// wrong by grows with one by it.
const WEIGHED: f64 = 0.02;
const COMPARED: f64 = 0.15;
/// Part of its clearance by which a mechanism may come nearer to a singular pose than it was.
const NEARER: f64 = 0.9;

/// What a mechanism does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Activity {
    /// Its motors have no power.
    Idle,
    /// They have, and follow no command.
    Powered,
    /// They follow commands, and gains still grow.
    Ramping,
    /// They follow commands.
    Following,
}

/// What is known of an actuator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) effort: f64,
    /// The position that it was last told to go to, where it is told one.
    pub(super) setpoint: Option<f64>,
}

impl Measured {
    const NONE: Measured =
        Measured { position: f64::NAN, velocity: f64::NAN, effort: f64::NAN, setpoint: None };
}

/// One mechanism and its assessment.
#[derive(Debug)]
struct Assessed {
    linkage: Linkage,
    measured: Tracker,
    commanded: Tracker,
    activity: Activity,
    /// What its independents and its clearance may reach.
    bounds: Vec<[f64; 2]>,
    least_clearance: f64,
    contradiction: Contradiction,
    fault: Option<Reason>,
}

impl Assessed {
    /// Whether something is closed that its actuators determine.
    fn is_closed(&self) -> bool {
        self.linkage.is_determined() && !self.linkage.is_serial()
    }

    /// What it means that no pose has the measured actuators: more of them than it has degrees of
    /// freedom contradict each other.
    fn no_pose(&self) -> Reason {
        if self.linkage.actuators.len() > self.linkage.independents.len() {
            Reason::LoopResidual
        } else {
            Reason::Unreachable
        }
    }

    /// A mechanism that has no pose is tried again rarely.
    fn is_due(&self, assessment: u64) -> bool {
        self.measured.lost <= LOST || assessment.is_multiple_of(RARELY)
    }

    /// Limits and the clearance, as ratchets: without power they are where the mechanism is.
    fn assess_limits(&mut self, least_clearance: f64) {
        let is_powered = self.activity > Activity::Idle;
        let (mut is_beyond, clearance) = (false, self.measured.clearance);
        for (i, limits) in self.linkage.limits.iter().enumerate() {
            let y = self.measured.next[i];
            let range = limits[1] - limits[0];
            let margin = if range.is_finite() { MARGIN * range } else { MARGIN };
            let bounds = &mut self.bounds[i];
            is_beyond |= is_powered && (y < bounds[0] || y > bounds[1]);
            let lower = (limits[0] - margin).min(y - margin);
            let upper = (limits[1] + margin).max(y + margin);
            *bounds = if is_powered {
                [bounds[0].max(lower), bounds[1].min(upper)]
            } else {
                [lower, upper]
            };
        }
        let is_near = is_powered && clearance < self.least_clearance;
        let least = least_clearance.min(NEARER * clearance);
        self.least_clearance = if is_powered { self.least_clearance.max(least) } else { least };
        if is_near {
            self.fault = Some(Reason::NearSingular);
        } else if is_beyond {
            self.fault = Some(Reason::MechanismLimit);
        }
    }
}

/// The model of a bridge's robot.
#[derive(Debug)]
pub(super) struct RobotModel {
    rules: ModelRules,
    evaluator: Evaluator,
    rows: Rows,
    owners: Vec<Option<usize>>,
    coupled: Vec<Vec<usize>>,
    limits: Vec<Limits>,
    mechanisms: Vec<Assessed>,
    measured: Vec<Measured>,
    /// The newest positions, measured and commanded (n_u).
    u: Vec<f64>,
    target: Vec<f64>,
    zero: Pose,
    pose: Pose,
    commanded: Pose,
    /// y of the last assessment, filtered ẏ with ÿ (n_vy), and efforts (n_u).
    y_before: Vec<f64>,
    motion: Vec<Filtered>,
    efforts: Vec<Filtered>,
    yd: Vec<f64>,
    ydd: Vec<f64>,
    /// Efforts against gravity (n_u).
    gravity: Vec<f64>,
    /// Room for numbers of one mechanism (n_vy, n_u).
    rates: Vec<f64>,
    moving: Vec<f64>,
    cycle: u64,
    last_ns: Option<u64>,
}

impl RobotModel {
    /// The model of a configuration that has one. Allocates; nothing after it does.
    pub(super) fn new(configuration: &Configuration) -> Option<RobotModel> {
        let mut evaluator = Evaluator::new(configuration.model.clone()?)?;
        let zero = evaluator.zero()?;
        let (n_vy, n_u) = (evaluator.model.sizes().n_vy, evaluator.model.sizes().n_u);
        let mut limits = vec![Limits::NONE; n_u];
        for MotorConfig { actuator, limits: of_motor, .. } in &configuration.motors {
            if let Some(place) = limits.get_mut(*actuator) {
                *place = *of_motor;
            }
        }
        let structure = setup::structure(&mut evaluator, &zero, configuration, &limits)?;
        let mechanisms = structure.linkages.into_iter().map(|linkage| Assessed {
            measured: Tracker::new(&linkage, &zero),
            commanded: Tracker::new(&linkage, &zero),
            activity: Activity::Idle,
            bounds: vec![[f64::NEG_INFINITY, f64::INFINITY]; linkage.independents.len()],
            least_clearance: 0.0,
            contradiction: Contradiction::default(),
            fault: None,
            linkage,
        });
        Some(RobotModel {
            rules: configuration.model_rules,
            rows: structure.rows,
            owners: structure.owners,
            coupled: structure.coupled,
            limits,
            mechanisms: mechanisms.collect(),
            measured: vec![Measured::NONE; n_u],
            u: zero.u.clone(),
            target: zero.u.clone(),
            pose: zero.clone(),
            commanded: zero.clone(),
            zero,
            y_before: vec![f64::NAN; n_vy],
            motion: vec![Filtered::default(); n_vy],
            efforts: vec![Filtered::default(); n_u],
            yd: vec![0.0; n_vy],
            ydd: vec![0.0; n_vy],
            gravity: vec![0.0; n_u],
            rates: vec![0.0; n_vy],
            moving: vec![0.0; n_u],
            cycle: 0,
            last_ns: None,
            evaluator,
        })
    }

    /// Takes what is known of an actuator.
    pub(super) fn measure(&mut self, actuator: usize, measured: Measured) {
        if let Some(place) = self.measured.get_mut(actuator) {
            *place = measured;
        }
    }

    /// Takes what a mechanism does.
    pub(super) fn activity(&mut self, number: usize, activity: Activity) {
        if let Some(mechanism) = self.mechanisms.get_mut(number) {
            mechanism.activity = activity;
        }
    }

    /// Assesses; one of three things in each cycle.
    pub(super) fn cycle(&mut self, now_ns: u64) {
        match self.cycle % 8 {
            3 => self.weigh(),
            1 | 5 | 7 => self.follow_commanded(),
            _ => self.follow_measured(now_ns),
        }
        self.cycle += 1;
    }

    /// What is wrong with a mechanism that has power.
    pub(super) fn fault(&self, number: usize) -> Option<Reason> {
        self.mechanisms.get(number).and_then(|mechanism| mechanism.fault)
    }

    /// What keeps a mechanism whose motors all measure from getting power.
    pub(super) fn missing(&self, number: usize) -> Option<Reason> {
        let mechanism = self.mechanisms.get(number)?;
        let is_assessed = mechanism.is_closed() && self.is_measured(mechanism);
        (is_assessed && !mechanism.measured.is_found).then_some(mechanism.no_pose())
    }

    /// The effort that holds an actuator against gravity; 0 where that is not known `[N m, N]`.
    pub(super) fn gravity(&self, actuator: usize) -> f64 {
        self.gravity.get(actuator).copied().unwrap_or(0.0)
    }

    /// All actuators of a mechanism have measured.
    fn is_measured(&self, mechanism: &Assessed) -> bool {
        mechanism.linkage.actuators.iter().all(|u| self.measured[*u].position.is_finite())
    }

    /// The pose of a mechanism is known.
    fn is_known(&self, number: usize) -> bool {
        let Some(mechanism) = self.mechanisms.get(number) else { return false };
        self.is_measured(mechanism)
            && (mechanism.linkage.is_serial() || mechanism.measured.is_found)
    }

    /// The forces of a mechanism can be told: the poses that they depend on are known.
    fn is_weighable(&self, number: usize, least_clearance: f64) -> bool {
        let is_known = |v: &usize| self.owners[*v].is_some_and(|owner| self.is_known(owner));
        self.mechanisms[number].linkage.is_determined()
            && self.coupled[number].iter().all(is_known)
            && self.mechanisms[number].measured.clearance > least_clearance
    }

    /// The pose and the forces of what was measured.
    fn follow_measured(&mut self, now_ns: u64) {
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
            mechanism.fault = None;
            if !is_measured || !mechanism.linkage.is_determined() {
                continue;
            }
            if mechanism.linkage.is_serial() {
                mechanism.measured.next[0] = self.u[mechanism.linkage.actuators[0]];
            } else if !mechanism.is_due(assessment) {
                mechanism.measured.go_back();
            } else if mechanism.measured.lost > LOST && mechanism.activity == Activity::Idle {
                let y = mechanism.linkage.independents.iter().map(|(_, place)| self.zero.y[*place]);
                mechanism.measured.restart(y);
            }
            mechanism.measured.put(&mechanism.linkage, &mut self.pose.y);
        }

        // Newton's method until all are found
        let mut has_forces = false;
        for round in 0..ROUNDS {
            let is_closed = if round == 0 {
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
                measured.assess(linkage, &self.rows, &self.pose, &self.u);
                measured.put(linkage, &mut self.pose.y);
                is_complete &= measured.is_found;
            }
            if is_complete {
                break;
            }
        }

        // what it says of each mechanism
        for k in 0..self.mechanisms.len() {
            let is_measured = self.is_measured(&self.mechanisms[k]);
            let mechanism = &mut self.mechanisms[k];
            if !is_measured || !mechanism.is_closed() {
                continue;
            }
            let tracker = &mut mechanism.measured;
            tracker.lost = if tracker.is_found { 0 } else { tracker.lost.saturating_add(1) };
            if tracker.is_found {
                mechanism.assess_limits(self.rules.clearance);
            } else if tracker.lost >= LOST {
                mechanism.fault = Some(mechanism.no_pose());
            }
        }
        if self.rules.effort > 0.0 && has_forces && h > 0.0 {
            self.compare_efforts(now_ns);
            self.filter(h);
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
                measured.assess(linkage, &self.rows, &self.pose, &self.u);
            } else {
                measured.is_found = false;
                measured.halve();
            }
        }
    }

    /// ẏ and ÿ from what was measured, and the efforts, all filtered; `h` since the last time `[s]`.
    fn filter(&mut self, h: f64) {
        for k in 0..self.mechanisms.len() {
            let is_known = self.is_known(k);
            let Assessed { linkage, measured, .. } = &mut self.mechanisms[k];
            let rates = &mut self.rates[..linkage.independents.len()];
            let velocity = |u: usize| self.measured[u].velocity;
            let is_told = linkage.actuators.iter().all(|u| velocity(*u).is_finite());
            let is_told = is_told && linkage.factorise(&self.rows, &self.pose);
            if is_told {
                linkage.independents_of(&self.rows, &self.pose, |_, u| velocity(u), rates);
            }
            for (i, &(v, _)) in linkage.independents.iter().enumerate() {
                let change = (measured.next[i] - self.y_before[v]) / h;
                let rate = if is_told { rates[i] } else { change };
                self.y_before[v] = if is_known { measured.next[i] } else { f64::NAN };
                let motion = &mut self.motion[v];
                if is_known && rate.is_finite() && h > 0.0 {
                    motion.update(rate, h);
                } else {
                    *motion = Filtered::default();
                }
                (self.yd[v], self.ydd[v]) = (motion.value, motion.rate);
            }
        }
        for (effort, measured) in self.efforts.iter_mut().zip(&self.measured) {
            if measured.effort.is_finite() {
                effort.update_twice(measured.effort, h);
            }
        }
    }

    /// Reported efforts against those of the model.
    fn compare_efforts(&mut self, now_ns: u64) {
        for k in 0..self.mechanisms.len() {
            let is_following = self.mechanisms[k].activity == Activity::Following;
            let is_told = |u: &usize| self.measured[*u].effort.is_finite();
            let is_told = self.mechanisms[k].linkage.actuators.iter().all(is_told);
            let is_compared = is_following && is_told && self.is_weighable(k, COMPARED);
            let Assessed { linkage, contradiction, fault, .. } = &mut self.mechanisms[k];
            let mut is_beyond = false;
            if is_compared && linkage.factorise(&self.rows, &self.pose) {
                let (efforts, limits) = (&self.efforts, &self.limits);
                let (gravity, part) = (&self.gravity, self.rules.effort);
                let room = &mut self.moving;
                let tau_y = &self.pose.tau_y;
                linkage.efforts_of(
                    &self.rows,
                    &self.pose,
                    tau_y,
                    |_| 0.0,
                    |u, effort| {
                        room[u] = effort - gravity[u];
                    },
                );
                let reported = |u: usize| efforts[u].rate;
                linkage.efforts_of(&self.rows, &self.pose, tau_y, reported, |u, deviation| {
                    let allowed = part * limits[u].effort;
                    is_beyond |= Contradiction::is_beyond(deviation, room[u], allowed);
                });
            }
            if contradiction.update(now_ns, is_beyond) && fault.is_none() {
                *fault = Some(Reason::ModelEffort);
            }
        }
    }

    /// Whether there are poses that have the commanded positions.
    fn follow_commanded(&mut self) {
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
            if linkage.is_determined() && !linkage.is_serial() {
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
                    commanded.assess(linkage, &self.rows, &self.commanded, &self.target);
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
                    *fault = Some(Reason::MechanismLimit);
                }
            }
        }
    }

    /// A closed mechanism whose motors are all told positions.
    fn is_commanded(&self, number: usize) -> bool {
        let mechanism = &self.mechanisms[number];
        let is_told = |u: &usize| self.measured[*u].setpoint.is_some();
        mechanism.is_closed()
            && mechanism.activity >= Activity::Ramping
            && mechanism.measured.is_found
            && mechanism.linkage.actuators.iter().all(is_told)
    }

    /// The efforts that hold the robot against gravity where it is.
    fn weigh(&mut self) {
        if !self.evaluator.rest(&mut self.pose) {
            return;
        }
        for k in 0..self.mechanisms.len() {
            let is_weighable = self.is_weighable(k, WEIGHED);
            let Assessed { linkage, .. } = &mut self.mechanisms[k];
            let gravity = &mut self.gravity;
            if is_weighable && linkage.factorise(&self.rows, &self.pose) {
                let tau_y = &self.pose.tau_y;
                linkage.efforts_of(
                    &self.rows,
                    &self.pose,
                    tau_y,
                    |_| 0.0,
                    |u, effort| {
                        gravity[u] = effort;
                    },
                );
            } else {
                linkage.actuators.iter().for_each(|u| gravity[*u] = 0.0);
            }
        }
    }
}
