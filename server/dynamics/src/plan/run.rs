//! The road of one request: numbers in, state, dynamics, numbers out.

use sarrus_proto::{Request, Status, Warnings};

use crate::algorithms;
use crate::mechanism::Motion;
use crate::model::Model;
use crate::plan::{Answer, Plan};
use crate::scalar::Scalar;
use crate::workspace::Workspace;

/// What a run found besides the numbers in the workspace.
pub(super) struct Findings<T> {
    pub(super) status: Status,
    pub(super) iterations: u32,
    pub(super) warnings: Warnings,
    pub(super) residual: T,
    /// Distance to singularity of the cluster that could not be closed, if there is one; its good
    /// independents are in the workspace.
    pub(super) sigma_min: T,
    pub(super) failed: bool,
    /// How many of the tied clusters were closed.
    pub(super) closed: usize,
    /// The independents in q are the nearest ones to an unreachable target.
    pub(super) nearest: bool,
}

impl<T: Scalar> Findings<T> {
    /// Before anything is known.
    fn none() -> Findings<T> {
        let nan = T::from_f64(f64::NAN);
        Findings {
            status: Status::Ok,
            iterations: 0,
            warnings: Warnings::NONE,
            residual: nan,
            sigma_min: nan,
            failed: false,
            closed: 0,
            nearest: false,
        }
    }

    /// Notes that digits may be lost.
    pub(super) fn warn_if(&mut self, ill_conditioned: bool) {
        if ill_conditioned {
            self.warnings |= Warnings::ILL_CONDITIONED;
        }
    }
}

impl Plan {
    /// Answers one request.
    ///
    /// `input` holds the given fields packed by [`Plan::given`], `output` receives the wanted
    /// fields packed by [`Plan::want`]. The answer depends on model, plan and input alone. A
    /// workspace without room for the plan is of the wrong size. Allocates never; panics never. A
    /// failed answer is NaN wherever its status forbids a number.
    pub fn run<T: Scalar>(
        &self,
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        input: &[T],
        output: &mut [T],
    ) -> Answer {
        if input.len() != self.given.len() || output.len() != self.want.len() {
            output.fill(T::from_f64(f64::NAN));
            return Answer { status: Status::WrongSize, warnings: Warnings::NONE };
        }
        if !workspace.serves(self.needs()) {
            output.fill(T::from_f64(f64::NAN));
            return Answer { status: Status::WrongSize, warnings: Warnings::NONE };
        }
        if model.meta.fingerprint != self.fingerprint {
            output.fill(T::from_f64(f64::NAN));
            return Answer { status: Status::WrongModel, warnings: Warnings::NONE };
        }
        let mut found = Findings::none();
        found.status = match self.compute(model, workspace, input, &mut found) {
            Ok(()) => self.write(model, workspace, &found, output),
            // an angle without sine breaks whatever uses it first
            Err(_) if beyond_angles(model, workspace) => {
                found = Findings::none();
                Status::NonFiniteInput
            }
            Err(status) => status,
        };
        if found.status != Status::Ok {
            self.write_failure(model, workspace, &found, output);
            return Answer { status: found.status, warnings: Warnings::NONE };
        }
        found.warnings |= self.limits(model, workspace);
        Answer { status: Status::Ok, warnings: found.warnings }
    }

    fn compute<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        found: &mut Findings<T>,
    ) -> Result<(), Status> {
        if !input.iter().all(|x| x.is_finite()) {
            return Err(Status::NonFiniteInput);
        }
        self.close_state(model, ws, input, found)?;
        if self.steps.poses {
            for &(i, q) in &model.free {
                let (s, c) = ws.q[q].sin_cos();
                ws.turn[i] = (c, s);
            }
            algorithms::joint_poses(model, &ws.q, &ws.turn, &mut ws.motion);
        }
        match self.request {
            Request::InverseDynamics => self.inverse_dynamics(model, ws, input, found),
            Request::ForwardDynamics => self.forward_dynamics(model, ws, input, found),
            Request::Map => self.map_forces(model, ws, input, found),
            _ => Ok(()),
        }
    }

    /// Where a position, velocity or actuator force lies outside the model's limits.
    fn limits<T: Scalar>(&self, model: &Model<T>, ws: &Workspace<T>) -> Warnings {
        let mut warnings = Warnings::NONE;
        let velocities =
            self.steps.velocity.is_some() && self.steps.level >= crate::closure::Level::Velocity;
        for limit in &model.limits {
            let q = ws.q[limit.q].to_f64();
            let mut outside = q < limit.lower || q > limit.upper;
            outside |= velocities && ws.qd[limit.v].to_f64().abs() > limit.velocity;
            if outside {
                warnings |= Warnings::LIMITS_EXCEEDED;
            }
        }
        if self.request == Request::InverseDynamics && self.wants_any(&[sarrus_proto::Field::TauU])
        {
            for (tau, effort) in ws.tau_u.iter().zip(&model.effort) {
                if tau.to_f64().abs() > *effort {
                    warnings |= Warnings::LIMITS_EXCEEDED;
                }
            }
        }
        warnings
    }
}

/// True where some joint stands, or starts, at an angle of which a number says nothing.
fn beyond_angles<T: Scalar>(model: &Model<T>, ws: &Workspace<T>) -> bool {
    let turning = model.bodies.iter().skip(1).filter(|body| body.motion == Motion::Revolute);
    let without_sine = |q: T| q.is_finite() && !q.sin_cos().0.is_finite();
    turning.map(|body| body.q).any(|q| without_sine(ws.q[q]) || without_sine(ws.start[q]))
}
