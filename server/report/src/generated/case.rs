//! The timed calls: a plan, alone or with its code, one state after the other or all at once.

use std::hint::black_box;
use std::sync::Arc;

use sarrus_dynamics::{Answer, Batch, Model, Plan, Status, Warnings, Workspace};
use sarrus_generate::NativeKernel;

use crate::measure::timing::Timed;
use crate::robots::{Robot, packed};

/// A plan, alone or with its code.
pub(super) struct Case<'a> {
    model: &'a Model,
    plan: Plan,
    kernel: Option<Arc<NativeKernel>>,
    workspace: Workspace<f64>,
    inputs: Vec<Vec<f64>>,
    pub(super) output: Vec<f64>,
    /// Where all states are asked at once.
    rows: Option<Rows>,
}

/// All states of a robot, one after the other.
struct Rows {
    batch: Batch,
    input: Vec<f64>,
    output: Vec<f64>,
    answers: Vec<Answer>,
}

impl<'a> Case<'a> {
    pub(super) fn new(
        robot: &Robot,
        model: &'a Model,
        plan: Plan,
        kernel: Option<Arc<NativeKernel>>,
    ) -> Case<'a> {
        Case {
            model,
            workspace: Workspace::for_plans(model, [&plan]),
            inputs: robot.states.iter().map(|state| packed(&plan, state, 0)).collect(),
            output: vec![0.0; plan.want().len()],
            plan,
            kernel,
            rows: None,
        }
    }

    /// The case that answers all states at once.
    pub(super) fn in_rows(self, model: &Arc<Model>) -> Case<'a> {
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let rows = Rows {
            batch: Batch::new(model, &self.plan),
            input: self.inputs.concat(),
            output: vec![0.0; self.inputs.len() * self.output.len()],
            answers: vec![unknown; self.inputs.len()],
        };
        Case { rows: Some(rows), ..self }
    }

    #[inline]
    pub(super) fn answer(&mut self, state: usize) -> Answer {
        let input = black_box(self.inputs[state].as_slice());
        let of = (self.model, &self.plan);
        let by_code = self
            .kernel
            .as_ref()
            .and_then(|kernel| kernel.answer(of, &mut self.workspace, input, &mut self.output));
        by_code.unwrap_or_else(|| {
            self.plan.run(self.model, &mut self.workspace, input, &mut self.output)
        })
    }
}

impl Timed for Case<'_> {
    fn name(&self) -> String {
        format!("{}: {}", self.model.name(), self.plan.query().want)
    }

    fn states(&self) -> usize {
        if self.rows.is_some() { 1 } else { self.inputs.len() }
    }

    #[inline]
    fn call(&mut self, state: usize) -> Status {
        if let (Some(rows), Some(kernel)) = (&mut self.rows, &self.kernel) {
            let Rows { batch, input, output, answers } = rows;
            let (plan, scratch) = batch.parts();
            kernel.answer_rows(plan, scratch, black_box(input), output, answers);
            black_box(output);
            let mut statuses = answers.iter().map(|answer| answer.status);
            return statuses.find(|status| *status != Status::Ok).unwrap_or(Status::Ok);
        }
        let status = self.answer(state).status;
        black_box(&self.output);
        status
    }
}
