//! A plan with room for its numbers, by field.

use sarrus_dynamics::{Answer, Field, Model, Plan, PlanScalar, Query, Workspace};

use crate::error::SimulationError;

/// A plan with its input and output.
#[derive(Clone, Debug)]
pub(crate) struct Planned<T> {
    pub(crate) plan: Plan,
    input: Vec<T>,
    output: Vec<T>,
}

impl<T: PlanScalar> Planned<T> {
    pub(crate) fn new(model: &Model<T>, query: &Query) -> Result<Planned<T>, SimulationError> {
        let plan = Plan::new(model, query)?;
        let n = plan.given().len();
        let m = plan.want().len();
        Ok(Planned { plan, input: vec![T::ZERO; n], output: vec![T::ZERO; m] })
    }

    /// Sets a given field; one that the plan does not take is left out.
    pub(crate) fn give(&mut self, field: Field, numbers: &[T]) {
        if let Some(slot) = self.plan.given().slot(field) {
            self.input[slot.range()].copy_from_slice(numbers);
        }
    }

    pub(crate) fn run(&mut self, model: &Model<T>, workspace: &mut Workspace<T>) -> Answer {
        self.plan.run(model, workspace, &self.input, &mut self.output)
    }

    /// The numbers of a field; none where it was not asked.
    pub(crate) fn get(&self, field: Field) -> &[T] {
        self.plan.want().slot(field).map_or(&[], |slot| &self.output[slot.range()])
    }
}
