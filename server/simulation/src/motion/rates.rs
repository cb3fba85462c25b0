//! The right-hand side: from t and x = [y; ẏ; ϑ; θ̇ and θ of each elastic motor; work] to ẋ.
//!
//! ```text
//!   ẏ from y's own velocity (a quaternion: ½ q ω of the unit quaternion),
//!   ÿ = FD(y, ẏ, τ_q(t, q, q̇), springs),   work' = τ_q · q̇ − losses,
//!   T ϑ' = (τ / τ_c)² − ϑ of the windings whose time constant and continuous force are known,
//!   J θ̈ = τ_m − k (θ − u) of rotors behind springs
//! ```
//! The work of inputs and dampers is integrated beside the state, so that energy less work stays
//! constant; of a motor on a rotor behind a spring it is that of τ_m along θ.

use std::borrow::Cow;

use sarrus_dynamics::description::{Description, Friction, Joint};
use sarrus_dynamics::{
    Answer, Field, FieldSet, Model, ModelInfo, PlanScalar, Planned, Query, QueryOptions, Request,
    Sizes, Status, Warnings,
};

use crate::coordinates::Coordinates;
use crate::error::Outcome;
use crate::forces::inputs::OnTree;
use crate::forces::springs::{Effect, Springs};
use crate::motion::elastic::Rotor;

/// Numbers of G up to which it is asked for to continue closures along.
const LARGEST: usize = 1 << 16;

/// The forces on a robot, and the composition of its coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Mechanism {
    pub(crate) sizes: Sizes,
    pub(crate) y: Coordinates,
    pub(crate) q: Coordinates,
    pub(crate) springs: Springs,
    pub(crate) inputs: Vec<OnTree>,
    /// Velocity and damping of each joint that has some.
    dampers: Vec<(usize, f64)>,
    /// The effects that the settings ask for.
    pub(crate) effects: Effects,
    /// Velocity and friction of each joint that has some, where it counts.
    frictions: Vec<(usize, Friction)>,
    /// Velocity of each actuator.
    actuators: Vec<usize>,
    /// Each winding that warms up: its actuator, continuous force and time constant.
    windings: Vec<(usize, f64, f64)>,
    stops: Vec<Stop>,
}

/// Effects that simulations leave out unless they are asked.
#[derive(Clone, Debug, Default)]
pub(crate) struct Effects {
    pub(crate) friction: bool,
    pub(crate) limited: bool,
    /// Stiffness of stops at the limits of joints.
    pub(crate) stops: Option<f64>,
    /// Rotors behind springs; the description has none at their joints.
    pub(crate) rotors: Vec<Rotor>,
}

/// Part of the temperature of the continuous force from which on the largest force falls to it.
const WARM: f64 = 0.95;

/// A stop of a joint of one freedom, by its coordinate and velocity.
#[derive(Clone, Copy, Debug)]
struct Stop {
    q: usize,
    v: usize,
    lower: f64,
    upper: f64,
}

/// Part of a stop's force that comes with each unit of speed into it `[s/m, s/rad]`: a blow at one
/// unit leaves with about two thirds of its speed.
const LOSS: f64 = 0.5;

impl Mechanism {
    pub(crate) fn new<C>(
        model: &Model<C>,
        description: &Description,
        springs: Springs,
        inputs: Vec<OnTree>,
        effects: Effects,
    ) -> Mechanism {
        let place = |name: &String| model.tree_names().iter().position(|of| of == name);
        let rough =
            |joint: &&Joint| effects.friction && joint.terms.friction != Friction::default();
        let rough = description.joints.iter().filter(rough);
        let windings = model.active_names().iter().enumerate().filter_map(|(u, name)| {
            let joint = description.joints.iter().find(|joint| joint.name == *name)?;
            let motor = joint.motor.as_ref().filter(|motor| motor.thermal_time.is_finite())?;
            Some((u, motor.continuous, motor.thermal_time))
        });
        let is_driven = effects.limited && inputs.iter().any(|input| input.is_of_motors);
        let damped = description.joints.iter().filter(|joint| joint.terms.damping != 0.0);
        Mechanism {
            windings: windings.filter(|_| is_driven).collect(),
            sizes: model.sizes(),
            y: Coordinates::of(model.independent_q_names(), model.independent_names()),
            q: Coordinates::of(model.tree_q_names(), model.tree_names()),
            springs,
            inputs,
            dampers: damped
                .filter_map(|joint| Some((place(&joint.name)?, joint.terms.damping)))
                .collect(),
            frictions: rough
                .filter_map(|joint| Some((place(&joint.name)?, joint.terms.friction)))
                .collect(),
            actuators: model.active_names().iter().filter_map(place).collect(),
            stops: if effects.stops.is_some() { stops(model.info()) } else { Vec::new() },
            effects,
        }
    }

    /// True where work is done that has to be followed.
    pub(crate) fn works(&self) -> bool {
        !self.inputs.is_empty()
            || !self.dampers.is_empty()
            || !self.frictions.is_empty()
            || !self.stops.is_empty()
            || self.springs.have_dampers()
    }

    /// Power of the inputs less the dampers' losses: τ_q · q̇ − losses.
    pub(crate) fn power<T: PlanScalar>(&self, qd: &[T], tau_q: &[T], loss: T) -> T {
        let given = qd.iter().zip(tau_q).fold(T::ZERO, |sum, (v, tau)| v.mul_add(*tau, sum));
        let loss = self.frictions.iter().fold(loss, |loss, (v, friction)| {
            let Friction { coulomb, viscous, speed } = *friction;
            let dry = T::from_f64(coulomb) * (qd[*v] / T::from_f64(speed)).tanh();
            (dry + T::from_f64(viscous) * qd[*v]).mul_add(qd[*v], loss)
        });
        self.dampers
            .iter()
            .fold(given - loss, |sum, (v, damping)| sum - T::from_f64(*damping) * qd[*v] * qd[*v])
    }

    /// Numbers in x whose error is controlled: all but the work.
    pub(crate) fn controlled(&self) -> usize {
        self.rotor(self.effects.rotors.len())
    }

    /// Place of the k-th rotor's θ̇ and θ in x.
    pub(crate) fn rotor(&self, k: usize) -> usize {
        self.sizes.n_qy + self.sizes.n_vy + self.windings.len() + 2 * k
    }

    /// Numbers in x.
    pub(crate) fn n(&self) -> usize {
        self.controlled() + usize::from(self.works())
    }

    /// Numbers of the forces: on the tree, then of motors on rotors behind springs.
    pub(crate) fn forced(&self) -> usize {
        self.sizes.n_v + self.effects.rotors.len()
    }

    /// True where closures continue along G: a robot with loops that is not too large.
    pub(crate) fn follows_G(&self) -> bool {
        self.sizes.n_c > 0 && self.sizes.n_v * self.sizes.n_vy <= LARGEST
    }

    /// The next time after t at which a force has a kink.
    pub(crate) fn next_kink(&self, t: f64) -> f64 {
        let kinks = self.inputs.iter().flat_map(|input| input.kinks());
        kinks.copied().filter(|time| *time > t).fold(f64::INFINITY, f64::min)
    }

    /// True where the forces depend on where the robot is.
    fn feels(&self) -> bool {
        let limits = self.effects.limited && self.inputs.iter().any(|input| input.is_of_motors);
        limits
            || !self.effects.rotors.is_empty()
            || !self.stops.is_empty()
            || !self.springs.is_empty()
            || self.inputs.iter().any(OnTree::is_feedback)
    }

    /// The forces of the inputs on the tree at x, and after them those of motors on rotors behind
    /// springs. Calls `each` with an actuator, its force, and whether that is kept within its
    /// limits.
    pub(crate) fn forces<T: PlanScalar>(
        &self,
        model: &Model<T>,
        (t, x): (f64, &[T]),
        (q, qd): (&[T], &[T]),
        tau_q: &mut [T],
        mut each: impl FnMut(usize, T, bool),
    ) {
        let warmth = x.get(self.sizes.n_qy + self.sizes.n_vy..).unwrap_or_default();
        tau_q.fill(T::ZERO);
        // a motor behind a spring sees its rotor
        let mut seen = (Cow::Borrowed(q), Cow::Borrowed(qd));
        for (k, rotor) in self.effects.rotors.iter().enumerate() {
            seen.1.to_mut()[rotor.v] = x[self.rotor(k)];
            seen.0.to_mut()[rotor.q] = x[self.rotor(k) + 1];
        }
        let of_motors = |input: &&OnTree| input.is_of_motors;
        let motors = self.inputs.iter().filter(of_motors);
        motors.for_each(|input| input.add(t, &seen.0, &seen.1, tau_q));
        for (u, v) in self.actuators.iter().enumerate().filter(|_| self.effects.limited) {
            let speed = seen.1.get(*v).map_or(0.0, |speed| speed.to_f64());
            let Some(limits) = model.actuator_forces(u, speed) else { continue };
            let winding = self.windings.iter().zip(warmth).find(|((of, ..), _)| *of == u);
            let [lower, upper] = limits.map(|limit| {
                let Some(((_, continuous, _), warmth)) = winding else { return T::from_f64(limit) };
                let room = ((1.0 - warmth.to_f64()) / (1.0 - WARM)).clamp(0.0, 1.0);
                let more = (limit.abs() - continuous).max(0.0);
                T::from_f64(limit.signum() * (limit.abs() - (1.0 - room) * more))
            });
            let tau = T::select_lt(upper, tau_q[*v], upper, tau_q[*v]);
            let tau = T::select_lt(tau, lower, lower, tau);
            each(u, tau, tau != tau_q[*v]);
            tau_q[*v] = tau;
        }
        for (k, rotor) in self.effects.rotors.iter().enumerate() {
            tau_q[self.sizes.n_v + k] = tau_q[rotor.v];
            tau_q[rotor.v] = rotor.force(x[self.rotor(k) + 1], q);
        }
        let others = self.inputs.iter().filter(|input| !input.is_of_motors);
        others.for_each(|input| input.add(t, q, qd, tau_q));
        let stiffness = T::from_f64(self.effects.stops.unwrap_or(0.0));
        for Stop { q: at, v, lower, upper } in &self.stops {
            // k e (1 + a ė) outwards, and nothing that pulls
            for (sign, bound) in [(T::ONE, *upper), (-T::ONE, *lower)] {
                let into = (q[*at] - T::from_f64(bound)) * sign;
                let grip = T::from_f64(LOSS).mul_add(qd[*v] * sign, T::ONE);
                if T::ZERO.lt(into) && T::ZERO.lt(grip) {
                    tau_q[*v] += -(stiffness * into * grip * sign);
                }
            }
        }
    }

    /// How far each joint with stops is beyond one of them, and how fast it goes there; negative
    /// before it.
    pub(crate) fn beyond(&self, q: &[f64], qd: &[f64]) -> Vec<[f64; 2]> {
        let of = |stop: &Stop| {
            let [low, high] = [stop.lower - q[stop.q], q[stop.q] - stop.upper];
            if low > high { [low, -qd[stop.v]] } else { [high, qd[stop.v]] }
        };
        self.stops.iter().map(of).collect()
    }

    /// Tree velocity of the k-th joint with stops.
    pub(crate) fn stopped(&self, k: usize) -> usize {
        self.stops[k].v
    }
}

/// The joints of one freedom with a finite range.
fn stops(info: &ModelInfo) -> Vec<Stop> {
    let joints = info.joints().filter(|joint| joint.v.len() == 1);
    let stops = joints.filter_map(|joint| {
        let limits = info.limits.get(joint.v.start).copied().flatten()?;
        let lower = limits.lower.unwrap_or(f64::NEG_INFINITY);
        let upper = limits.upper.unwrap_or(f64::INFINITY);
        let stop = Stop { q: joint.q.start, v: joint.v.start, lower, upper };
        (lower.is_finite() || upper.is_finite()).then_some(stop)
    });
    stops.collect()
}

/// The right-hand side over one scalar.
#[derive(Clone, Debug)]
pub(crate) struct Rates<T: PlanScalar> {
    model: Model<T>,
    /// Where the robot is, for the forces that depend on it.
    pose: Option<Planned<T>>,
    forward: Planned<T>,
    y: Vec<T>,
    tau_q: Vec<T>,
    /// Force of each actuator with limits (n_u).
    given: Vec<T>,
    wrenches: Vec<T>,
    effect: Effect<T>,
}

impl<T: PlanScalar> Rates<T> {
    pub(crate) fn new(model: Model<T>, mechanism: &Mechanism) -> Outcome<Rates<T>> {
        use Field::*;
        // the guess is a pose of the loops
        let has_loops = mechanism.sizes.n_c > 0;
        let given = FieldSet::of(if has_loops { &[Y, Yd, QGuess, QdGuess] } else { &[Y, Yd] });
        let links = &mechanism.springs.links;
        let pose = if mechanism.feels() {
            let want = if links.is_empty() {
                FieldSet::of(&[Q, Qd])
            } else {
                FieldSet::of(&[Q, Qd, FramePose, FrameTwist])
            };
            let query = Query::new(Request::Kinematics, given, want).with_frames(links);
            Some(Planned::new(&model, &query)?)
        } else {
            None
        };
        let want =
            FieldSet::of(if mechanism.follows_G() { &[Ydd, Q, Qd, G] } else { &[Ydd, Q, Qd] });
        let mut query = Query::new(Request::ForwardDynamics, given.with(TauQ), want);
        if !links.is_empty() {
            query = query.with_wrenches(links);
        }
        if mechanism.effects.friction {
            query = query.with_options(QueryOptions::FRICTION);
        }
        let forward = Planned::new(&model, &query)?;
        let of = |n: usize| vec![T::ZERO; n];
        Ok(Rates {
            pose,
            forward,
            y: of(mechanism.sizes.n_qy),
            tau_q: of(mechanism.forced()),
            given: of(mechanism.sizes.n_u),
            wrenches: of(6 * links.len()),
            effect: Effect { energy: T::ZERO, loss: T::ZERO },
            model,
        })
    }

    /// ẋ at t and x, with a guess of q and q̇; NaN where the status is not ok.
    pub(crate) fn evaluate(
        &mut self,
        mechanism: &Mechanism,
        t: f64,
        x: &[T],
        guess: (&[T], &[T]),
        rate: &mut [T],
    ) -> Answer {
        let n_qy = mechanism.sizes.n_qy;
        let n_vy = mechanism.sizes.n_vy;
        let answer = self.accelerate(mechanism, t, x, guess);
        if answer.status != Status::Ok {
            rate.fill(T::from_f64(f64::NAN));
            return answer;
        }
        mechanism.y.rate(&x[..n_qy], &self.y, &x[n_qy..n_qy + n_vy], &mut rate[..n_qy]);
        rate[n_qy..n_qy + n_vy].copy_from_slice(self.forward.get(Field::Ydd));
        for (k, (u, continuous, time)) in mechanism.windings.iter().enumerate() {
            let part = self.given[*u] / T::from_f64(*continuous);
            rate[n_qy + n_vy + k] = (part * part - x[n_qy + n_vy + k]) / T::from_f64(*time);
        }
        let [q, qd] = [Field::Q, Field::Qd].map(|field| self.forward.get(field));
        let mut power = mechanism.power(qd, &self.tau_q, self.effect.loss);
        for (k, rotor) in mechanism.effects.rotors.iter().enumerate() {
            let at = mechanism.rotor(k);
            let force = rotor.force(x[at + 1], q);
            let motor = self.tau_q[mechanism.sizes.n_v + k];
            rate[at] = (motor - force) / T::from_f64(rotor.inertia);
            rate[at + 1] = x[at];
            // the spring's force is no input
            power += motor * x[at] - force * qd[rotor.v];
        }
        if mechanism.works() {
            rate[mechanism.controlled()] = power;
        }
        // an overflow is no motion either
        if rate.iter().all(|x| x.is_finite()) { answer } else { failed(Status::NonFiniteInput) }
    }

    fn accelerate(
        &mut self,
        mechanism: &Mechanism,
        t: f64,
        x: &[T],
        (q, qd): (&[T], &[T]),
    ) -> Answer {
        let n_qy = mechanism.sizes.n_qy;
        let n_vy = mechanism.sizes.n_vy;
        // a number that is none would not have a unit quaternion
        if !x.iter().all(|x| x.is_finite()) {
            return failed(Status::NonFiniteInput);
        }
        self.y.copy_from_slice(&x[..n_qy]);
        mechanism.y.normalise(&mut self.y);
        for planned in self.pose.iter_mut().chain([&mut self.forward]) {
            planned.give(Field::Y, &self.y);
            planned.give(Field::Yd, &x[n_qy..n_qy + n_vy]);
            planned.give(Field::QGuess, q);
            planned.give(Field::QdGuess, qd);
        }
        if let Some(pose) = &mut self.pose {
            let answer = pose.run(&self.model);
            if answer.status != Status::Ok {
                return answer;
            }
            self.forward.give(Field::QGuess, pose.get(Field::Q));
        }
        let (q, qd) = self
            .pose
            .as_ref()
            .map_or((&[] as &[T], &[] as &[T]), |pose| (pose.get(Field::Q), pose.get(Field::Qd)));
        let given = &mut self.given;
        let state = (q, qd);
        mechanism.forces(&self.model, (t, x), state, &mut self.tau_q, |u, tau, _| given[u] = tau);
        self.pull(mechanism);
        self.forward.give(Field::TauQ, &self.tau_q[..mechanism.sizes.n_v]);
        self.forward.give(Field::Wrenches, &self.wrenches);
        self.forward.run(&self.model)
    }

    /// The springs' wrenches at the last pose.
    fn pull(&mut self, mechanism: &Mechanism) {
        if let (Some(pose), false) = (&self.pose, mechanism.springs.is_empty()) {
            let poses = pose.get(Field::FramePose);
            let twists = pose.get(Field::FrameTwist);
            self.effect = mechanism.springs.wrenches(poses, twists, &mut self.wrenches);
        }
    }

    /// The springs' forces at the last evaluation.
    pub(crate) fn effect(&self) -> Effect<T> {
        self.effect
    }

    /// q, q̇ or G of the last good evaluation.
    pub(crate) fn get(&self, field: Field) -> &[T] {
        self.forward.get(field)
    }
}

/// No answer, for this reason.
fn failed(status: Status) -> Answer {
    Answer { status, warnings: Warnings::NONE }
}
