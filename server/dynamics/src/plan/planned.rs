//! A plan with room for its numbers, by field.

use sarrus_proto::{Answer, Field, Query, QueryError};

use crate::model::Model;
use crate::plan::{Plan, PlanScalar};
use crate::workspace::Workspace;

/// A plan with its scratch, one input and the last answer.
#[derive(Clone, Debug)]
pub struct Planned<T: PlanScalar = f64> {
    /// The plan.
    pub plan: Plan,
    /// Given numbers, packed by [`Plan::given`]; zeros at first.
    pub input: Vec<T>,
    /// The last answer, packed by [`Plan::want`]; zeros at first.
    pub output: Vec<T>,
    workspace: Workspace<T>,
}

impl<T: PlanScalar> Planned<T> {
    /// The plan of a query. Allocates.
    ///
    /// # Errors
    ///
    /// As [`Plan::new`].
    pub fn new(model: &Model<T>, query: &Query) -> Result<Planned<T>, QueryError> {
        Plan::new(model, query).map(|plan| Planned::of(model, plan))
    }

    /// The plan of a query with its answer to these numbers; `None` without one. Allocates.
    ///
    /// # Panics
    ///
    /// As [`Planned::give`].
    pub fn answered(
        model: &Model<T>,
        query: &Query,
        given: &[(Field, &[T])],
    ) -> Option<Planned<T>> {
        let mut planned = Planned::new(model, query).ok()?;
        given.iter().for_each(|(field, numbers)| planned.give(*field, numbers));
        planned.run(model).ok().ok()?;
        Some(planned)
    }

    /// Room for a plan of this model. Allocates.
    pub fn of(model: &Model<T>, plan: Plan) -> Planned<T> {
        Planned {
            workspace: Workspace::for_plans(model, [&plan]),
            input: vec![T::ZERO; plan.given().len()],
            output: vec![T::ZERO; plan.want().len()],
            plan,
        }
    }

    /// Sets a given field; one that the plan does not take is left out.
    ///
    /// # Panics
    ///
    /// Where the field has another number of numbers.
    pub fn give(&mut self, field: Field, numbers: &[T]) {
        if let Some(slot) = self.plan.given().slot(field) {
            self.input[slot.range()].copy_from_slice(numbers);
        }
    }

    /// Answers the input, as [`Plan::run`].
    #[inline]
    pub fn run(&mut self, model: &Model<T>) -> Answer {
        self.plan.run(model, &mut self.workspace, &self.input, &mut self.output)
    }

    /// The numbers of a field in the last answer; none where it was not asked.
    pub fn get(&self, field: Field) -> &[T] {
        self.plan.want().slot(field).map_or(&[], |slot| &self.output[slot.range()])
    }
}
