//! Poses and forces of the robot at given independent coordinates, without allocation.

use std::sync::Arc;

use crate::state::state;
use sarrus_dynamics::{
    Field, FieldSet, Model, Plan, Query, QueryError, QueryOptions, Request, Workspace,
};

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

/// A plan with room for its input and output.
#[derive(Debug)]
struct Prepared {
    plan: Plan,
    input: Vec<f64>,
    output: Vec<f64>,
}

impl Prepared {
    fn new(model: &Model, request: Request, given: &[Field], want: &[Field]) -> Option<Prepared> {
        let mut query = Query::new(request, FieldSet::of(given), FieldSet::of(want));
        if request == Request::Observe {
            query.options = query.options.with(QueryOptions::FRICTION);
        }
        let plan: Result<Plan, QueryError> = Plan::new(model, &query);
        let plan = plan.ok()?;
        let input = vec![0.0; plan.given().len()];
        let output = vec![0.0; plan.want().len()];
        Some(Prepared { plan, input, output })
    }

    /// Evaluates a pose at `pose.y`, from `pose.q`. False, and nothing changed, where it fails.
    fn run(&mut self, model: &Model, workspace: &mut Workspace<f64>, pose: &mut Pose) -> bool {
        self.give(Field::Y, &pose.y);
        self.give(Field::QGuess, &pose.q);
        let answer = self.plan.run(model, workspace, &self.input, &mut self.output);
        if answer.ok().is_err() {
            return false;
        }
        self.take(Field::Q, &mut pose.q);
        self.take(Field::U, &mut pose.u);
        self.take(Field::G, &mut pose.loop_jacobian);
        self.take(Field::TauY, &mut pose.tau_y);
        true
    }

    fn give(&mut self, field: Field, numbers: &[f64]) {
        if let Some(slot) = self.plan.given().slot(field) {
            self.input[slot.range()].copy_from_slice(numbers);
        }
    }

    fn take(&self, field: Field, into: &mut [f64]) {
        if let Some(slot) = self.plan.want().slot(field) {
            into.copy_from_slice(&self.output[slot.range()]);
        }
    }
}

/// A model with its plans and scratch.
#[derive(Debug)]
pub(super) struct Evaluator {
    pub(super) model: Arc<Model>,
    workspace: Workspace<f64>,
    pose: Prepared,
    rest: Prepared,
    motion: Prepared,
    /// `None` where nothing is observed.
    observer: Option<Prepared>,
}

impl Evaluator {
    /// Allocates; nothing after it does. `None` for a model that has no such answers.
    pub(super) fn new(model: Arc<Model>, observes: bool) -> Option<Evaluator> {
        use Field::{Dt, G, Gain, Observer, Q, QGuess, TauExternal, TauU, TauY, U, Y, Yd, Ydd};
        let workspace = Workspace::new(&model);
        let forces = |given: &[Field]| {
            Prepared::new(&model, Request::InverseDynamics, given, &[Q, U, G, TauY])
        };
        let observer = || {
            let given = [Y, QGuess, Yd, TauU, Dt, Gain, Observer];
            Prepared::new(&model, Request::Observe, &given, &[TauExternal, Observer])
        };
        Some(Evaluator {
            pose: Prepared::new(&model, Request::Kinematics, &[Y, QGuess], &[Q, U, G])?,
            rest: forces(&[Y, QGuess])?,
            motion: forces(&[Y, Yd, Ydd, QGuess])?,
            observer: if observes { Some(observer()?) } else { None },
            workspace,
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
        let mut first = Prepared::new(&self.model, Request::Kinematics, &[Field::Y], &fields)?;
        first.run(&self.model, &mut self.workspace, &mut pose).then_some(pose)
    }

    /// Closes the loops at `pose.y`, from `pose.q`. False, and nothing changed, where they cannot
    /// be closed.
    pub(super) fn pose(&mut self, pose: &mut Pose) -> bool {
        self.pose.run(&self.model, &mut self.workspace, pose)
    }

    /// As [`Evaluator::pose`], with the forces that hold the robot there.
    pub(super) fn rest(&mut self, pose: &mut Pose) -> bool {
        self.rest.run(&self.model, &mut self.workspace, pose)
    }

    /// As [`Evaluator::pose`], with the forces of a motion.
    pub(super) fn motion(&mut self, pose: &mut Pose, yd: &[f64], ydd: &[f64]) -> bool {
        self.motion.give(Field::Yd, yd);
        self.motion.give(Field::Ydd, ydd);
        self.motion.run(&self.model, &mut self.workspace, pose)
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
        let is_known = step.run(&self.model, &mut self.workspace, pose);
        if is_known {
            step.take(Field::Observer, observer);
            step.take(Field::TauExternal, &mut pose.tau_y);
        }
        is_known
    }
}

state!(Pose { y, q, u, loop_jacobian, tau_y });
