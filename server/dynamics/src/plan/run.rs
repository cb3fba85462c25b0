//! Runs a request: numbers in, state, dynamics, numbers out.

use sarrus_proto::{Request, Status, Warnings};

use crate::algorithms;
use crate::mechanism::{Motion, turn};
use crate::model::Model;
use crate::plan::diagnostics::digits::Doubt;
use crate::plan::{Answer, Plan, Space};
use crate::scalar::{Dd, Dual, Real, all_finite};
use crate::workspace::Workspace;

/// One run of a request: model, workspace, input numbers and report.
pub(super) struct Pass<'a, T: Real> {
    pub(super) model: &'a Model<T>,
    pub(super) ws: &'a mut Workspace<T>,
    pub(super) input: &'a [T],
    pub(super) report: &'a mut RunReport<T>,
}

/// Results of a run other than the numbers in the workspace.
pub(super) struct RunReport<T> {
    pub(super) status: Status,
    pub(super) iterations: u32,
    pub(super) warnings: Warnings,
    /// Bound on the growth of roundings.
    pub(super) doubt: Doubt,
    /// Largest gap of redundant rows, and distance of the given state, in radians or lengths.
    pub(super) open: f64,
    pub(super) projection: f64,
    pub(super) residual: T,
    /// Distance to singularity of the cluster that could not be closed, if any; its good
    /// independents are in the workspace.
    pub(super) sigma_min: T,
    pub(super) failed: bool,
    /// Number of clusters closed so far.
    pub(super) closed: usize,
    /// The independents in q are the nearest ones to an unreachable target.
    pub(super) nearest: bool,
}

impl<T: Real> RunReport<T> {
    /// The initial value.
    pub(super) fn none() -> RunReport<T> {
        let nan = T::from_f64(f64::NAN);
        RunReport {
            status: Status::Ok,
            iterations: 0,
            warnings: Warnings::NONE,
            doubt: Doubt::NONE,
            open: 0.0,
            projection: 0.0,
            residual: nan,
            sigma_min: nan,
            failed: false,
            closed: 0,
            nearest: false,
        }
    }

    /// Adds a warning where it is due.
    fn warn_if(&mut self, due: bool, warning: Warnings) {
        if due {
            self.warnings |= warning;
        }
    }
}

/// A scalar that plans run over.
///
/// Every crate that calls a generic function compiles it. For the common scalars this crate
/// compiles a whole request once; an implementation for another scalar is empty.
pub trait PlanScalar: Real {
    /// As [`Plan::run`].
    #[doc(hidden)]
    fn run_compiled(
        plan: &Plan,
        model: &Model<Self>,
        workspace: &mut Workspace<Self>,
        input: &[Self],
        output: &mut [Self],
    ) -> Answer {
        plan.execute::<_, false>(model, workspace, input, output)
    }
}

impl PlanScalar for f64 {
    #[inline(never)]
    fn run_compiled(
        plan: &Plan,
        model: &Model<f64>,
        workspace: &mut Workspace<f64>,
        input: &[f64],
        output: &mut [f64],
    ) -> Answer {
        // tasks and second derivatives are in doubles alone
        if let Some(tasks) = &plan.task {
            return plan.run_tasks(tasks, model, workspace, input, output);
        }
        let answer = plan.execute::<_, false>(model, workspace, input, output);
        if plan.first.is_some() && answer.status == Status::Ok {
            return plan.add_second(workspace, input, output, answer);
        }
        answer
    }
}

impl PlanScalar for Dd {
    #[inline(never)]
    fn run_compiled(
        plan: &Plan,
        model: &Model<Dd>,
        workspace: &mut Workspace<Dd>,
        input: &[Dd],
        output: &mut [Dd],
    ) -> Answer {
        plan.execute::<_, false>(model, workspace, input, output)
    }
}

impl<S: Real> PlanScalar for Dual<S> {}

impl Plan {
    /// Answers one request.
    ///
    /// `input` holds the given fields packed by [`Plan::given`], `output` receives the wanted
    /// fields packed by [`Plan::want`]. The answer depends on model, plan and input alone. A
    /// workspace without room for the plan is of the wrong size; a plan or a workspace of another
    /// model than `model` is [`Status::WrongModel`] (conversions of one model to other scalars are
    /// one model). Allocates never; panics never. A failed answer is NaN wherever its status
    /// forbids a number.
    #[inline]
    pub fn run<T: PlanScalar>(
        &self,
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        input: &[T],
        output: &mut [T],
    ) -> Answer {
        T::run_compiled(self, model, workspace, input, output)
    }

    /// Checks sizes and model, computes and writes the answer; if `CLOSED`, the precomputed closure
    /// results follow the given numbers.
    #[inline(always)]
    pub(super) fn execute<T: Real, const CLOSED: bool>(
        &self,
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        input: &[T],
        output: &mut [T],
    ) -> Answer {
        let given = self.given.len();
        let len = if CLOSED { given + self.closed.len() } else { given };
        let fits = input.len() == len && output.len() == self.want.len();
        if !fits || !workspace.serves(self.needs()) {
            output.fill(T::from_f64(f64::NAN));
            return Answer { status: Status::WrongSize, warnings: Warnings::NONE };
        }
        if model.meta.fingerprint != self.fingerprint || !workspace.belongs_to(model) {
            output.fill(T::from_f64(f64::NAN));
            return Answer { status: Status::WrongModel, warnings: Warnings::NONE };
        }
        let (input, closed) = input.split_at(given);
        let mut report = RunReport::none();
        let computed = self.compute::<T, CLOSED>(model, workspace, input, closed, &mut report);
        report.status = match computed {
            Ok(()) => {
                let written = self.write(model, workspace, &mut report, input, output);
                written.err().unwrap_or(Status::Ok)
            }
            // an angle without sine fails in the first step that uses it
            Err(_) if self.beyond_angles(model, workspace, &report) => {
                report = RunReport::none();
                Status::NonFiniteInput
            }
            Err(status) => status,
        };
        if report.status != Status::Ok {
            // in a packet the failing lane is unknown
            if T::STRAIGHT {
                output.fill(T::from_f64(f64::NAN));
            } else {
                self.write_failure(model, workspace, &report, output);
            }
            return Answer { status: report.status, warnings: Warnings::NONE };
        }
        let doubtful = report.doubt.is_large();
        let lost = doubtful && !self.keeps_digits(workspace, input, output, &report);
        report.warn_if(lost, Warnings::ILL_CONDITIONED);
        report.warn_if(report.open > self.query.loop_tolerance.bound(), Warnings::LOOP_OPEN);
        report.warn_if(
            report.projection > self.query.projection_tolerance.bound(),
            Warnings::INPUT_PROJECTED,
        );
        let no_limit = self.motors.is_some()
            && workspace.motors.as_ref().is_some_and(|motors| motors.no_limit);
        report.warn_if(no_limit, Warnings::NO_LIMIT);
        report.warnings |= self.limits(model, workspace);
        Answer { status: Status::Ok, warnings: report.warnings }
    }

    /// True if a workspace that does not answer in turns may have another answer than this status,
    /// the last one of this workspace.
    pub fn is_cut_short<T: Real>(&self, workspace: &Workspace<T>, status: Status) -> bool {
        let is_of_closures = matches!(
            status,
            Status::NotConverged
                | Status::BranchChanged
                | Status::Unreachable
                | Status::SingularClosure
                | Status::SingularIndependents
        );
        let has_more = workspace.scratch.left == 0 || self.searches();
        workspace.is_in_turns() && is_of_closures && has_more
    }

    fn compute<T: Real, const CLOSED: bool>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        closed: &[T],
        report: &mut RunReport<T>,
    ) -> Result<(), Status> {
        if !all_finite(input) {
            return Err(Status::NonFiniteInput);
        }
        ws.scratch.left = ws.budget(self.searches());
        self.set_state(model, ws, input)?;
        self.close_state::<T, CLOSED>(Pass { model, ws, input, report }, closed)?;
        if self.steps.derivatives {
            // near a singular pose they lose as much more as g does against G
            let more = report.doubt.factor.cbrt();
            report.doubt.times(if self.first.is_some() { more * more } else { more });
        }
        if self.steps.poses {
            turn(&self.needed.scope.free, &ws.q, &mut ws.cos_sin);
            algorithms::joint_poses(
                model,
                &self.needed.scope.posed,
                &ws.q,
                &ws.cos_sin,
                &mut ws.motion,
            );
        }
        let pass = Pass { model, ws, input, report };
        match self.request {
            Request::InverseDynamics => self.inverse_dynamics(pass),
            Request::ForwardDynamics => self.forward_dynamics(pass),
            Request::Map => self.map_forces(pass),
            Request::Observe if self.steps.observes => self.known_forces(pass),
            _ => Ok(()),
        }?;
        // no packet has them
        if self.steps.derivatives && !T::STRAIGHT {
            self.differentiate(model, ws, input)?;
        }
        Ok(())
    }

    /// True if some needed joint is, or starts, at an angle too large for a sine; dependents of
    /// unclosed clusters have no number of this request.
    fn beyond_angles<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        report: &RunReport<T>,
    ) -> bool {
        let closed = self.needed.scope.closed.get(..report.closed).unwrap_or_default();
        let is_set = |c: usize| self.steps.position != Space::Independent || closed.contains(&c);
        let without_sine = |q: T| q.is_finite() && !q.sin_cos().0.is_finite();
        self.needed.coordinates.iter().any(|c| {
            let cluster = &model.clusters[*c];
            cluster.bodies().any(|i| {
                let body = &model.bodies[i];
                let stands = is_set(*c) || model.is_independent(i);
                body.motion == Motion::Revolute
                    && (stands && without_sine(ws.q[body.q])
                        || !self.starts_nowhere() && without_sine(ws.start[body.q]))
            })
        })
    }
}
