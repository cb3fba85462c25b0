//! Poses and forces of the robot at given independent coordinates, without allocation.

use std::sync::Arc;

use crate::state::state;
use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, QueryOptions, Request};

/// Bandwidth of the observer of external forces `[1/s]`.
const GAIN: f64 = 50.0;

/// The robot at one pose.
#[derive(Clone, Debug)]
pub(super) struct Pose {
    /// Independents of the pose to evaluate `[m, rad]` (n_qy).
    pub(super) y: Vec<f64>,
    /// Tree coordinates of the last evaluation, from which the next one starts (n_q).
    pub(super) q: Vec<f64>,
    /// Actuator coordinates there `[m, rad]` (n_u).
    pub(super) u: Vec<f64>,
    /// Loop Jacobian there (n_v × n_vy).
    pub(super) loop_jacobian: Vec<f64>,
    /// Generalised forces that the motion there requires `[N, N m]` (n_vy).
    pub(super) tau_y: Vec<f64>,
}

impl Pose {
    /// An entry of the loop Jacobian.
    pub(super) fn jacobian_entry(&self, row: usize, column: usize) -> f64 {
        self.loop_jacobian[row * self.tau_y.len() + column]
    }
}

fn planned(model: &Model, request: Request, given: &[Field], want: &[Field]) -> Option<Planned> {
    let mut query = Query::new(request, FieldSet::of(given), FieldSet::of(want));
    if request == Request::Observe {
        query.options = query.options.with(QueryOptions::FRICTION);
    }
    Planned::new(model, &query).ok()
}

/// Evaluates a pose at `pose.y`, from `pose.q`. False, and nothing changed, where it fails.
fn run(planned: &mut Planned, model: &Model, pose: &mut Pose) -> bool {
    planned.give(Field::Y, &pose.y);
    planned.give(Field::QGuess, &pose.q);
    if planned.run(model).ok().is_err() {
        return false;
    }
    take(planned, Field::Q, &mut pose.q);
    take(planned, Field::U, &mut pose.u);
    take(planned, Field::G, &mut pose.loop_jacobian);
    take(planned, Field::TauY, &mut pose.tau_y);
    true
}

/// Takes a field of the last answer, where it is wanted.
fn take(planned: &Planned, field: Field, into: &mut [f64]) {
    if let numbers @ [_, ..] = planned.get(field) {
        into.copy_from_slice(numbers);
    }
}

/// A model with its plans and scratch.
#[derive(Debug)]
pub(super) struct Evaluator {
    pub(super) model: Arc<Model>,
    pose: Planned,
    rest: Planned,
    motion: Planned,
    /// `None` where nothing is observed.
    observer: Option<Planned>,
}

impl Evaluator {
    /// Allocates; nothing after it does. `None` for a model that has no such answers.
    pub(super) fn new(model: Arc<Model>, observes: bool) -> Option<Evaluator> {
        use Field::{Dt, G, Gain, Observer, Q, QGuess, TauExternal, TauU, TauY, U, Y, Yd, Ydd};
        let forces =
            |given: &[Field]| planned(&model, Request::InverseDynamics, given, &[Q, U, G, TauY]);
        let observer = || {
            let given = [Y, QGuess, Yd, TauU, Dt, Gain, Observer];
            planned(&model, Request::Observe, &given, &[TauExternal, Observer])
        };
        Some(Evaluator {
            pose: planned(&model, Request::Kinematics, &[Y, QGuess], &[Q, U, G])?,
            rest: forces(&[Y, QGuess])?,
            motion: forces(&[Y, Yd, Ydd, QGuess])?,
            observer: if observes { Some(observer()?) } else { None },
            model,
        })
    }

    /// The closed pose where all independent coordinates are zero; `None` where there is none.
    /// Allocates.
    pub(super) fn zero(&mut self) -> Option<Pose> {
        let sizes = self.model.sizes();
        // a quaternion at rest ends with 1
        let y: Vec<f64> = self
            .model
            .independent_q_names()
            .iter()
            .map(|name| if name.ends_with("/qw") { 1.0 } else { 0.0 })
            .collect();
        let mut pose = Pose {
            y,
            q: vec![0.0; sizes.n_q],
            u: vec![0.0; sizes.n_u],
            loop_jacobian: vec![0.0; sizes.n_v * sizes.n_vy],
            tau_y: vec![0.0; sizes.n_vy],
        };
        let fields = [Field::Q, Field::U, Field::G];
        let mut first = planned(&self.model, Request::Kinematics, &[Field::Y], &fields)?;
        run(&mut first, &self.model, &mut pose).then_some(pose)
    }

    /// Closes the loops at `pose.y`, from `pose.q`. False, and nothing changed, where they cannot
    /// be closed.
    pub(super) fn pose(&mut self, pose: &mut Pose) -> bool {
        run(&mut self.pose, &self.model, pose)
    }

    /// As [`Evaluator::pose`], with the forces that hold the robot there.
    pub(super) fn rest(&mut self, pose: &mut Pose) -> bool {
        run(&mut self.rest, &self.model, pose)
    }

    /// As [`Evaluator::pose`], with the forces of a motion.
    pub(super) fn motion(&mut self, pose: &mut Pose, yd: &[f64], ydd: &[f64]) -> bool {
        self.motion.give(Field::Yd, yd);
        self.motion.give(Field::Ydd, ydd);
        run(&mut self.motion, &self.model, pose)
    }

    /// A step of the observer to a pose with the time since the last, the motion and the forces of
    /// the actuators: the external forces are those of the pose. False, and nothing changed, where
    /// nothing is observed.
    pub(super) fn observe(
        &mut self,
        pose: &mut Pose,
        given: [(Field, &[f64]); 3],
        observer: &mut [f64],
    ) -> bool {
        let Some(step) = &mut self.observer else { return false };
        let own = [(Field::Gain, &[GAIN][..]), (Field::Observer, observer)];
        given.into_iter().chain(own).for_each(|(field, numbers)| step.give(field, numbers));
        let is_known = run(step, &self.model, pose);
        if is_known {
            take(step, Field::Observer, observer);
            take(step, Field::TauExternal, &mut pose.tau_y);
        }
        is_known
    }
}

state!(Pose { y, q, u, loop_jacobian, tau_y });
