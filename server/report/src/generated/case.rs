//! The timed calls: a plan, alone or with its code, state by state or all at once.

use std::hint::black_box;
use std::sync::Arc;

use sarrus_dynamics::{Answer, Batch, Model, Plan, Status, Warnings};
use sarrus_generate::NativeKernel;

use crate::measure::timing::Timed;
use crate::robots::{Planned, Robot};

/// A plan, alone or with its code.
pub(super) struct Case {
    pub(super) planned: Planned,
    kernel: Option<Arc<NativeKernel>>,
    /// The input and output of all states at once.
    rows: Option<Rows>,
}

/// All states of a robot, one by one.
struct Rows {
    batch: Batch,
    input: Vec<f64>,
    output: Vec<f64>,
    answers: Vec<Answer>,
}

impl Case {
    pub(super) fn new(
        robot: &Robot,
        model: &Model,
        plan: Plan,
        kernel: Option<Arc<NativeKernel>>,
    ) -> Case {
        Case { planned: Planned::new(model, plan, &robot.states, 0), kernel, rows: None }
    }

    /// The case that answers all states at once.
    pub(super) fn in_rows(self, model: &Arc<Model>) -> Case {
        let Planned { plan, inputs, output, .. } = &self.planned;
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let rows = Rows {
            batch: Batch::new(model, plan),
            input: inputs.concat(),
            output: vec![0.0; inputs.len() * output.len()],
            answers: vec![unknown; inputs.len()],
        };
        Case { rows: Some(rows), ..self }
    }

    #[inline]
    pub(super) fn answer(&mut self, state: usize) -> Answer {
        let Planned { model, plan, workspace, inputs, output } = &mut self.planned;
        let input = black_box(inputs[state].as_slice());
        let by_code =
            |kernel: &Arc<NativeKernel>| kernel.answer((&*model, &*plan), workspace, input, output);
        self.kernel.as_ref().and_then(by_code).unwrap_or_else(|| self.planned.answer(state))
    }
}

impl Timed for Case {
    fn name(&self) -> String {
        self.planned.name()
    }

    fn states(&self) -> usize {
        if self.rows.is_some() { 1 } else { self.planned.states() }
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
        black_box(&self.planned.output);
        status
    }
}
