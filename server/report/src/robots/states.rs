//! Random states, the same in every run.

use sarrus_dynamics::description::{Description, Joint, JointKind, Limits};
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Planned, Query, Request, Sizes, Status};

use super::catalogue::{Subject, Variant, variants};
use super::question::Question;
use super::random::Random;
use crate::Outcome;

/// Positions within ± this many radians or metres and within the limits of y, velocities (1/s),
/// accelerations (1/s²), actuator forces (N or N m).
const ANGLE: f64 = 0.25;
const LENGTH: f64 = 0.03;
const VELOCITY: f64 = 1.0;
const ACCELERATION: f64 = 5.0;
const FORCE: f64 = 10.0;
/// Time from the closing of a guess to its state, in seconds.
const EARLIER: f64 = 1e-3;

/// If more than half of the states have no answer, the reach is halved, at most this often.
const HALVINGS: u32 = 5;

/// A robot with its variants and states valid for all of them.
#[derive(Debug)]
pub struct Robot {
    /// Its entry in the catalogue.
    pub subject: Subject,
    /// Its name in the tables.
    pub name: &'static str,
    /// The robot as read.
    pub description: Description,
    /// Every measured way to close its loops.
    pub variants: Vec<Variant>,
    /// Inputs that fit all variants.
    pub states: Vec<State>,
    /// Discarded states, on which some variant has no answer.
    pub left_out: usize,
    /// The share of the usual reach for the positions.
    pub reach: f64,
}

/// One state and, for each variant, the closed pose shortly before it.
#[derive(Clone, Debug)]
pub struct State {
    /// Independent positions.
    pub y: Vec<f64>,
    /// Independent velocities.
    pub yd: Vec<f64>,
    /// Independent accelerations.
    pub ydd: Vec<f64>,
    /// Actuator forces.
    pub tau_u: Vec<f64>,
    /// For each variant, a closed pose shortly before.
    pub guesses: Vec<Vec<f64>>,
}

impl Robot {
    /// Loads every variant and draws the states.
    ///
    /// # Errors
    ///
    /// A robot that does not load, or whose loops close at less than half of the states.
    pub fn load(subject: Subject, n_states: usize) -> Outcome<Robot> {
        Robot::load_some(subject, n_states, |_| true)
    }

    /// Loads a robot with the variants of some names only.
    ///
    /// # Errors
    ///
    /// As [`Robot::load`].
    pub fn load_some(
        subject: Subject,
        n_states: usize,
        query: impl Fn(&str) -> bool,
    ) -> Outcome<Robot> {
        let (description, variants) = variants(subject, query)?;
        Robot::with_variants(subject, description, variants, n_states)
    }

    /// Draws states valid for all of these variants.
    pub(crate) fn with_variants(
        subject: Subject,
        description: Description,
        variants: Vec<Variant>,
        n_states: usize,
    ) -> Outcome<Robot> {
        let mut robot = Robot {
            subject,
            name: subject.name(),
            description,
            variants,
            states: Vec::new(),
            left_out: 0,
            reach: 1.0,
        };
        let Some(Variant { compiled, .. }) = robot.variants.first() else { return Ok(robot) };
        let model = &compiled.model;
        let dofs = dofs(model, &robot.description);
        let models = robot.variants.iter().map(|variant| &variant.compiled.model);
        let mut checks = models.map(Check::new).collect::<Outcome<Vec<_>>>()?;

        let mut random = Random(0);
        while robot.states.len() < n_states {
            let mut state = drawn(&dofs, robot.reach, model.sizes(), &mut random);
            let earlier = earlier(&dofs, &state);
            let mut all = checks.iter_mut().enumerate();
            if all.all(|(k, check)| check.fits(k, &earlier, &mut state)) {
                robot.states.push(state);
            } else {
                robot.left_out += 1;
            }
            if robot.left_out > n_states.max(16) {
                robot.reach /= 2.0;
                (robot.states, robot.left_out, random) = (Vec::new(), 0, Random(0));
            }
            if robot.reach < 0.5_f64.powi(HALVINGS as i32) {
                let name = robot.name;
                return Err(format!("{name}: more than half of the states have no answer").into());
            }
        }
        Ok(robot)
    }
}

/// The numbers of a state in the order of a plan.
pub fn packed(plan: &Plan, state: &State, variant: usize) -> Vec<f64> {
    let mut input = vec![0.0; plan.given().len()];
    for slot in plan.given().slots() {
        let numbers = match slot.field {
            Field::Y => &state.y,
            Field::Yd => &state.yd,
            Field::Ydd => &state.ydd,
            Field::TauU => &state.tau_u,
            _ => &state.guesses[variant],
        };
        input[slot.range()].copy_from_slice(numbers);
    }
    input
}

/// y between the limits of its joints, each at the place that `place` gives, 0 for the lower limit
/// and 1 for the upper one; a limit that is missing is at 0.6, one that is far at 3 `[rad, m]`.
pub fn within_limits(model: &Model, mut place: impl FnMut() -> f64) -> Vec<f64> {
    let info = model.info();
    let of = |name: &String| {
        let limits = info.limits_of(name);
        let bound = |x: Option<f64>, none: f64| x.unwrap_or(none).clamp(-3.0, 3.0);
        let lower = bound(limits.and_then(|of| of.lower), -0.6);
        let upper = bound(limits.and_then(|of| of.upper), 0.6);
        lower + place() * (upper - lower)
    };
    info.independent_q.iter().map(of).collect()
}

/// The motion of one coordinate, or of the four of a quaternion.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Dof {
    Angle,
    Length,
    Turn,
}

/// The dofs of y in the caller's order, each with the index of its first velocity and its limits.
fn dofs(model: &Model, description: &Description) -> Vec<(Dof, usize, Limits)> {
    let names = model.independent_names();
    let slides = |name: &String| {
        let is = |joint: &Joint| joint.name == *name && joint.kind == JointKind::Prismatic;
        description.joints.iter().any(is)
    };
    let limits = |name: &String| {
        let joint = description.joints.iter().find(|joint| joint.name == *name);
        joint.and_then(|joint| joint.limits).unwrap_or(Limits::NONE)
    };
    let mut dofs = Vec::new();
    for (v, name) in names.iter().enumerate() {
        match name.rsplit_once('/') {
            None if slides(name) => dofs.push((Dof::Length, v, limits(name))),
            None => dofs.push((Dof::Angle, v, limits(name))),
            Some((joint, "rx")) => {
                // the position of a floating joint precedes its quaternion
                if names.contains(&format!("{joint}/tx")) {
                    dofs.extend((v + 3..v + 6).map(|v| (Dof::Length, v, Limits::NONE)));
                }
                dofs.push((Dof::Turn, v, Limits::NONE));
            }
            Some(_) => {}
        }
    }
    dofs
}

/// A random state without guesses.
fn drawn(dofs: &[(Dof, usize, Limits)], reach: f64, sizes: Sizes, random: &mut Random) -> State {
    let mut y = Vec::new();
    for (dof, _, limits) in dofs {
        let size = reach * if *dof == Dof::Length { LENGTH } else { ANGLE };
        match dof {
            Dof::Angle | Dof::Length => {
                let lower = limits.lower.max(-size);
                let upper = limits.upper.min(size);
                y.push(0.5 * (lower + upper) + 0.5 * (upper - lower) * random.next());
            }
            Dof::Turn => {
                let [a, b, c] = [(); 3].map(|()| 0.5 * size * random.next());
                y.extend(unit([a, b, c, 1.0]));
            }
        }
    }
    let mut numbers = |n: usize, size: f64| (0..n).map(|_| size * random.next()).collect();
    State {
        y,
        yd: numbers(sizes.n_vy, VELOCITY),
        ydd: numbers(sizes.n_vy, ACCELERATION),
        tau_u: numbers(sizes.n_u, FORCE),
        guesses: Vec::new(),
    }
}

/// y shortly before a state.
fn earlier(dofs: &[(Dof, usize, Limits)], state: &State) -> Vec<f64> {
    let mut y = state.y.clone();
    let mut at = 0;
    for (dof, v, _) in dofs {
        let step = |j: usize| -EARLIER * state.yd[v + j];
        if *dof != Dof::Turn {
            // a floating body is nearly parallel to its parent
            y[at] += step(0);
            at += 1;
            continue;
        }
        // q + q ω dt / 2
        let [a, b, c] = [0, 1, 2].map(|j| 0.5 * step(j));
        let [x, y_, z, w] = [0, 1, 2, 3].map(|j| state.y[at + j]);
        let turned = unit([
            x + w * a + y_ * c - z * b,
            y_ + w * b + z * a - x * c,
            z + w * c + x * b - y_ * a,
            w - x * a - y_ * b - z * c,
        ]);
        y[at..at + 4].copy_from_slice(&turned);
        at += 4;
    }
    y
}

/// A quaternion of unit length.
fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

/// Checks for answers of a variant.
struct Check<'a> {
    model: &'a Model,
    /// Closing, inverse and forward dynamics.
    plans: [Planned; 3],
}

impl<'a> Check<'a> {
    fn new(model: &'a Model) -> Outcome<Check<'a>> {
        let close =
            Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));
        let plans = [
            Planned::new(model, &close)?,
            Planned::new(model, &Question::InverseDynamics.query())?,
            Planned::new(model, &Question::ForwardDynamics.query())?,
        ];
        Ok(Check { model, plans })
    }

    /// Finds the guess; false if the variant with this index cannot close its loops or has no
    /// dynamics.
    fn fits(&mut self, variant: usize, earlier: &[f64], state: &mut State) -> bool {
        let Check { model, plans: [close, dynamics @ ..] } = self;
        close.give(Field::Y, earlier);
        let closed = close.run(model);
        state.guesses.push(close.get(Field::Q).to_vec());
        let is_ok = |planned: &mut Planned| {
            planned.input = packed(&planned.plan, state, variant);
            planned.run(model).status == Status::Ok
        };
        closed.status == Status::Ok && dynamics.iter_mut().all(is_ok)
    }
}
