//! The robot's model in the bridge: assesses each closed mechanism as a whole.
//!
//! From the measured actuators u the model finds y, G and the forces. Every second cycle it solves
//! the measured pose; the cycles between alternate between the commanded pose and the forces of
//! gravity. A mechanism is assessed once all its actuators are measured and determine its pose, its
//! forces once the same holds for every mechanism that carries it or that it carries. Limits are
//! ratchets: a joint beyond its limit at power-up may move inwards, and then not out again.

mod assessed;
mod effort;
mod encoders;
mod evaluator;
mod follow;
mod forces;
mod linkage;
mod setup;
mod tracker;

use sarrus_proto::actuators::Reason;

use super::monitors::position;
use crate::config::{Configuration, Limits, ModelRules};
use crate::state::{State, Words, state};
pub(super) use assessed::Activity;
use assessed::Assessed;
use effort::Filtered;
use encoders::Encoder;
use evaluator::{Evaluator, Pose};

/// Measurements of an actuator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) effort: f64,
    /// When they came `[ns]`.
    pub(super) measured_ns: u64,
    /// The last commanded position, if there is one.
    pub(super) setpoint: Option<f64>,
}

impl Measured {
    const NONE: Measured = Measured {
        position: f64::NAN,
        velocity: f64::NAN,
        effort: f64::NAN,
        measured_ns: 0,
        setpoint: None,
    };
}

/// The model of a bridge's robot.
#[derive(Debug)]
pub(super) struct RobotModel {
    rules: ModelRules,
    evaluator: Evaluator,
    owners: Vec<Option<usize>>,
    coupled: Vec<Vec<usize>>,
    limits: Vec<Limits>,
    /// Deceleration of a stop of each actuator, and its delay `[rad/s², m/s², s]`.
    braking: Vec<[f64; 2]>,
    mechanisms: Vec<Assessed>,
    encoders: Vec<Encoder>,
    feedback_ns: u64,
    measured: Vec<Measured>,
    /// The newest positions, measured and commanded (n_u).
    u: Vec<f64>,
    target: Vec<f64>,
    /// Where mechanisms are looked for at first.
    home: Vec<f64>,
    pose: Pose,
    commanded: Pose,
    /// y of the last assessment, filtered ẏ with ÿ (n_vy), and efforts (n_u).
    y_before: Vec<f64>,
    motion: Vec<Filtered>,
    efforts: Vec<Filtered>,
    yd: Vec<f64>,
    ydd: Vec<f64>,
    /// State of the observer of external forces (3 n_vy).
    observer: Vec<f64>,
    /// Efforts against gravity (n_u).
    gravity: Vec<f64>,
    /// Whether the pose of each mechanism is known.
    known: Vec<bool>,
    /// Room for numbers of one mechanism (n_vy, n_u).
    rates: Vec<f64>,
    asked: Vec<f64>,
    cycle: u64,
    last_ns: Option<u64>,
}

impl RobotModel {
    /// The model of a configuration that has one. Allocates; nothing after it does.
    pub(super) fn new(configuration: &Configuration) -> Option<RobotModel> {
        let mut evaluator =
            Evaluator::new(configuration.model.clone()?, configuration.model_rules.external > 0.0)?;
        let mut zero = evaluator.zero()?;
        let n_vy = evaluator.model.sizes().n_vy;
        let n_u = evaluator.model.sizes().n_u;
        let mut limits = vec![Limits::NONE; n_u];
        let mut braking = vec![[f64::INFINITY, 0.0]; n_u];
        for motor in &configuration.motors {
            let u = motor.actuator;
            if let (Some(limits), Some(braking)) = (limits.get_mut(u), braking.get_mut(u)) {
                *limits = motor.limits;
                *braking = [motor.braking(), position::delay(configuration.period_ns())];
            }
        }
        let structure = setup::structure(&mut evaluator, &zero, configuration, &limits)?;
        zero.y.copy_from_slice(&structure.home);
        let mechanisms =
            structure.linkages.into_iter().map(|linkage| Assessed::new(linkage, &zero));
        let mut model = RobotModel {
            rules: configuration.model_rules,
            owners: structure.owners,
            coupled: structure.coupled,
            limits,
            braking,
            mechanisms: mechanisms.collect(),
            encoders: Vec::new(),
            feedback_ns: configuration.feedback_ns(),
            measured: vec![Measured::NONE; n_u],
            u: zero.u.clone(),
            target: zero.u.clone(),
            pose: zero.clone(),
            commanded: zero.clone(),
            home: zero.y,
            y_before: vec![f64::NAN; n_vy],
            motion: vec![Filtered::default(); n_vy],
            efforts: vec![Filtered::default(); n_u],
            yd: vec![0.0; n_vy],
            ydd: vec![0.0; n_vy],
            observer: vec![0.0; 3 * n_vy],
            gravity: vec![0.0; n_u],
            known: vec![false; configuration.n_mechanisms()],
            rates: vec![0.0; n_vy],
            asked: vec![0.0; n_u],
            cycle: 0,
            last_ns: None,
            evaluator,
        };
        model.add_encoders(configuration);
        Some(model)
    }

    /// Takes the measurements of an actuator.
    pub(super) fn measure(&mut self, actuator: usize, measured: Measured) {
        if let Some(place) = self.measured.get_mut(actuator) {
            *place = measured;
        }
    }

    /// Takes the activity of a mechanism.
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

    /// The fault of a mechanism that has power.
    pub(super) fn fault(&self, number: usize) -> Option<Reason> {
        let fault = self.mechanisms.get(number).map(|mechanism| mechanism.fault);
        fault.filter(|fault| *fault != Reason::None)
    }

    /// The reason that keeps a mechanism whose motors all measure from getting power.
    pub(super) fn missing(&self, number: usize, now_ns: u64) -> Option<Reason> {
        let mechanism = self.mechanisms.get(number)?;
        let is_assessed = mechanism.is_closed() && self.is_measured(mechanism);
        (is_assessed && !mechanism.measured.is_found)
            .then_some(mechanism.no_pose())
            .or_else(|| self.of_encoders(number, now_ns))
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
        self.known.get(number).copied().unwrap_or(false)
    }

    /// The forces of a mechanism are known: the poses that they depend on are known.
    fn is_weighable(&self, number: usize, least_clearance: f64) -> bool {
        let is_known = |v: &usize| self.owners[*v].is_some_and(|owner| self.is_known(owner));
        self.mechanisms[number].linkage.is_determined()
            && self.coupled[number].iter().all(is_known)
            && self.mechanisms[number].measured.clearance > least_clearance
    }
}

state!(Measured { position, velocity, effort, measured_ns, setpoint });
state!(RobotModel {
    mechanisms, encoders, measured, u, target, pose, commanded, y_before, motion, efforts, yd, ydd,
    observer, gravity, known, cycle, last_ns;
    rules, evaluator, owners, coupled, limits, braking, feedback_ns, home, rates, asked
});

/// There is one where the configuration has a robot.
impl State for Option<RobotModel> {
    fn carry(&mut self, words: &mut Words<'_>) {
        self.iter_mut().for_each(|model| model.carry(words));
    }
}
