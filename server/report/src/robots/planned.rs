//! A plan on the states of a robot, for timed calls.

use std::hint::black_box;

use sarrus_dynamics::{Answer, Field, Model, Plan, Status, Workspace};

use super::states::{State, packed};
use crate::measure::timing::Timed;

/// A plan with its inputs.
pub(crate) struct Planned {
    pub(crate) model: Model,
    pub(crate) plan: Plan,
    pub(crate) workspace: Workspace<f64>,
    pub(crate) inputs: Vec<Vec<f64>>,
    pub(crate) output: Vec<f64>,
}

impl Planned {
    /// A plan on these states, with the guesses of the variant with this index.
    pub(crate) fn new(model: &Model, plan: Plan, states: &[State], place: usize) -> Planned {
        Planned {
            workspace: Workspace::for_plans(model, [&plan]),
            inputs: states.iter().map(|state| packed(&plan, state, place)).collect(),
            output: vec![0.0; plan.want().len()],
            model: model.clone(),
            plan,
        }
    }

    /// The numbers of a field in the last answer; none if it is not wanted.
    pub(crate) fn get(&self, field: Field) -> &[f64] {
        let slot = self.plan.want().slot(field);
        slot.map_or(&[], |slot| &self.output[slot.range()])
    }

    /// The answer of the plan on the state with this index.
    #[inline]
    pub(crate) fn answer(&mut self, state: usize) -> Answer {
        let input = black_box(self.inputs[state].as_slice());
        self.plan.run(&self.model, &mut self.workspace, input, &mut self.output)
    }
}

impl Timed for Planned {
    fn name(&self) -> String {
        format!("{}: {}", self.model.name(), self.plan.query().want)
    }

    fn states(&self) -> usize {
        self.inputs.len()
    }

    #[inline]
    fn call(&mut self, state: usize) -> Status {
        let status = self.answer(state).status;
        black_box(&self.output);
        status
    }
}
